//! The catalogue of named stiff and extreme scenes, each run and judged.
//!
//! **Invariant:** a scene that is not run is listed as not run, one that falls short as falling short.

use std::fmt::Write;

use crate::report::csv::Csv;
use crate::report::experiments::scenarios::{self, LiveRun, Scenario, live};
use crate::report::making::Making;
use crate::report::section::{Block, Cell, Figure, Section, Table, Verdict};
use crate::report::svg::{HEIGHT, Key, WIDTH, escape, number, plain, seconds};

pub(super) fn make(making: &mut Making<'_>) -> Section {
    let all = scenarios::all();
    let mut table = Table::new(
        "scenarios",
        "Every scene, as expected and as observed",
        "Expectations come from theory or from the arm's own prediction, never from an earlier run.",
        &["", "Scene", "Expected", "Observed", ""],
    );
    let mut csv = Csv::new("id,name,parameters,expected,observed,holds");
    let (mut run, mut short, mut panels) = (0, Vec::new(), Vec::new());
    for scene in &all {
        // Slow ones take seconds each, which a quick look does not have.
        let verdict = (!scene.slow || !making.quick).then(|| scene.run());
        let plainly = verdict.as_ref().map(|verdict| plain(&verdict.observed));
        let (observed, cell) = match &verdict {
            Some(verdict) => (
                plainly.as_deref().unwrap_or_default(),
                Cell::verdict(verdict.holds),
            ),
            None => (
                "not run in a quick report",
                Cell::new("not run").class("soft"),
            ),
        };
        if let Some(verdict) = &verdict {
            run += 1;
            if !verdict.holds {
                short.push(format!("{} {}", scene.id, scene.name));
            }
        }
        csv.row(&[
            scene.id.into(),
            scene.name.into(),
            scene.parameters.into(),
            scene.expected.into(),
            observed.into(),
            verdict
                .as_ref()
                .map(|verdict| u64::from(verdict.holds))
                .into(),
        ]);
        table.rows.push(vec![
            Cell::new(scene.id),
            Cell::new(scene.name).detail(plain(scene.parameters)),
            Cell::new(plain(scene.expected)),
            Cell::new(observed),
            cell,
        ]);
        panels.push(picture(
            scene,
            verdict.as_ref().map(|verdict| verdict.holds),
        ));
    }
    making.keep("scenarios", csv);
    Section {
        findings: vec![finding(run, &short)],
        verdicts: vec![Verdict {
            claim: format!("All {} named scenes do as expected", all.len()),
            seen: match (short.is_empty(), all.len() - run) {
                (true, 0) => "all of them".to_owned(),
                (true, left) => format!("all that were run; {left} were not"),
                (false, _) => format!("not {}", short.join(", ")),
            },
            holds: short.is_empty(),
        }],
        blocks: vec![Block::Figure(pictures(panels)), Block::Table(table)],
        ..Section::default()
    }
}

/// The outcomes of the scenes that were run; `short` names those that fall short.
fn finding(run: usize, short: &[String]) -> String {
    let held = run - short.len();
    let finding = format!("**{held} of {run} stiff and extreme scenes do as theory says**");
    if short.is_empty() {
        finding + "."
    } else {
        finding + "; these fall short: " + &short.join(", ") + "."
    }
}

fn pictures(panels: Vec<String>) -> Figure {
    Figure::of_panels(
        "scenarios",
        "The stiff and extreme scenes, each as one live arm",
        "Joint angles from their start, by the live arm's own steps; the scale is that of the largest angle, which is \
         written at the right. A cross ends a run that would have left the finite numbers. Below: the time watched, \
         and whether the scene does as theory says; the table has the details. A name opens the arm on the page of a \
         running program at 127.0.0.1:9095, which applies the settings on a click.",
        &JOINTS.map(|(class, label)| Key::line(class, label)),
        panels,
    )
}

/// Class and name of each joint's line.
const JOINTS: [(&str, &str); 3] = [("j1", "joint 1"), ("j2", "joint 2"), ("j3", "joint 3")];

/// The page that a picture's name opens.
const PAGE: &str = "http://127.0.0.1:9095/#";

/// Characters of a name that fit above a picture.
const LONGEST_NAME: usize = 20;

/// Half of a panel's paper.
const SMALL_WIDTH: f64 = 0.5 * WIDTH;
const SMALL_HEIGHT: f64 = 0.5 * HEIGHT;
/// Where the curves are.
const LEFT: f64 = 8.0;
const TOP: f64 = 30.0;
const BOTTOM: f64 = 24.0;

fn picture(scene: &Scenario, holds: Option<bool>) -> String {
    let title = escape(&format!("{} {}", scene.id, scene.name));
    let mut out = format!(
        "<svg class=\"plot\" viewBox=\"0 0 {SMALL_WIDTH} {SMALL_HEIGHT}\" role=\"img\" aria-label=\"{title}\">"
    );
    let (class, verdict) = match holds {
        Some(true) => ("good", "holds"),
        Some(false) => ("bad", "falls short"),
        None => ("soft", "not run"),
    };
    let bottom = SMALL_HEIGHT - 8.0;
    let heading: String = match scene.name.char_indices().nth(LONGEST_NAME) {
        Some((end, _)) => format!(
            "{} {}…",
            scene.id,
            scene.name.get(..end).unwrap_or_default()
        ),
        None => format!("{} {}", scene.id, scene.name),
    };
    let name = format!(
        "<text class=\"title\" x=\"{LEFT}\" y=\"17\">{}</text>",
        escape(&heading)
    );
    let verdict = format!(
        "<text class=\"note {class}\" x=\"{}\" y=\"{bottom}\" text-anchor=\"end\">{verdict}</text>",
        SMALL_WIDTH - LEFT
    );
    let watched = live(scene.id).and_then(|live| {
        let watched = live.watch().map_err(|_| "no such arm")?;
        Ok((live, watched))
    });
    // Writing to a string cannot fail.
    let _ = match watched {
        Ok((live, watched)) => write!(
            out,
            "<a href=\"{PAGE}{}\">{name}</a>{}<text class=\"note\" x=\"{LEFT}\" y=\"{bottom}\">{}</text>",
            escape(&live.fragment()),
            curves(&watched),
            seconds(live.seconds),
        ),
        Err(why) => write!(
            out,
            "{name}<text class=\"note\" x=\"{LEFT}\" y=\"{}\">{}</text>",
            0.5 * SMALL_HEIGHT,
            escape(why)
        ),
    };
    out + &verdict + "</svg>"
}

fn curves(watched: &LiveRun) -> String {
    let all = watched.samples.iter().flat_map(|(_, angles)| angles);
    let largest = all.fold(0.0_f64, |largest, angle| largest.max(angle.abs()));
    let end = watched.samples.last().map_or(1.0, |(time, _)| *time);
    let middle = 0.5 * (TOP + SMALL_HEIGHT - BOTTOM);
    let half = middle - TOP;
    let x = |time: f64| LEFT + (SMALL_WIDTH - 2.0 * LEFT) * time / end;
    let y = |angle: f64| middle - half * if largest > 0.0 { angle / largest } else { 0.0 };
    let mut out = String::new();
    for (joint, (class, _)) in JOINTS.iter().enumerate() {
        let points = watched.samples.iter().filter_map(|(time, angles)| {
            let angle = angles.get(joint)?;
            Some(format!("{:.1} {:.1}", x(*time), y(*angle)))
        });
        let points: Vec<String> = points.collect();
        if !points.is_empty() {
            let _ = write!(
                out,
                "<g class=\"series {class}\"><path class=\"line\" d=\"M{}\"/></g>",
                points.join("L")
            );
        }
    }
    if watched.diverged {
        let (x, y) = (SMALL_WIDTH - LEFT - 4.0, middle);
        let _ = write!(
            out,
            "<g class=\"series ink\"><path class=\"lost\" d=\"M{:.1} {:.1}l8 8m0 -8l-8 8\"/></g>",
            x - 4.0,
            y - 4.0
        );
    }
    let _ = write!(
        out,
        "<text class=\"note\" x=\"{}\" y=\"{}\" text-anchor=\"end\">{} rad</text>",
        SMALL_WIDTH - LEFT,
        TOP + 4.0,
        number(largest)
    );
    out
}
