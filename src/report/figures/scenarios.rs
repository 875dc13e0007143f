//! The catalogue of named stiff and extreme scenes, each run and judged.
//!
//! **Invariant:** a scene that is not run is listed as not run, one that falls short as falling short.

use crate::report::experiments::scenarios;
use crate::report::scenes::{LiveRun, LiveScene, live_scenes};
use crate::report::section::{Cell, Section, Table, lines};
use crate::report::svg::{HEIGHT, Key, Panel, PlotNumber, WIDTH, escape, number, plain, seconds};
use crate::study::matrix::largest;

pub(super) fn make(section: &mut Section) {
    let all = scenarios::all();
    let live = live_scenes();
    let mut table = Table::new(
        "scenarios",
        "Every scene, as expected and as observed",
        "Expectations come from theory or from the arm's own prediction, never from an earlier run.",
        ["", "Scene", "Expected", "Observed", ""],
    );
    let (mut run, mut short, mut panels) = (0, Vec::new(), Vec::new());
    for scene in &all {
        let Some(live) = live.iter().find(|live| live.id == scene.id) else {
            continue;
        };
        // Slow ones take seconds each, which a quick look does not have.
        let verdict = (!scene.slow || !section.quick).then(|| scene.run());
        let holds = verdict.as_ref().map(|verdict| verdict.holds);
        let name = format!("{} {}", scene.id, live.name);
        run += usize::from(holds.is_some());
        if holds == Some(false) {
            short.push(name.clone());
        }
        let (observed, cell) = match verdict {
            Some(verdict) => (plain(&verdict.observed), Cell::verdict(verdict.holds)),
            None => (
                "not run in a quick report".to_owned(),
                Cell::new("not run").class("soft"),
            ),
        };
        panels.push(picture(&name, live, holds));
        table.rows.push(vec![
            Cell::new(scene.id),
            Cell::new(&live.name).detail(plain(scene.parameters)),
            Cell::new(plain(scene.expected)),
            Cell::new(observed),
            cell,
        ]);
    }
    let names = short.join(", ");
    let finding = format!(
        "**{} of {run} stiff and extreme scenes do as theory says**",
        run - short.len()
    );
    section.find(match short.is_empty() {
        true => finding + ".",
        false => format!("{finding}; these fall short: {names}."),
    });
    let seen = match (short.is_empty(), all.len() - run) {
        (true, 0) => "all of them".to_owned(),
        (true, left) => format!("all that were run; {left} were not"),
        (false, _) => format!("not {names}"),
    };
    section.claim(
        format!("All {} named scenes do as expected", all.len()),
        seen,
        short.is_empty(),
    );
    section.figure(
        "scenarios",
        "The stiff and extreme scenes, each as one live arm",
        "Joint angles from their start, by the live arm's own steps. The scale is that of the largest angle, which is \
         written below. A cross ends a run that would have left the finite numbers. Below: the time watched, the \
         largest angle, and whether the scene does as theory says; the table has the details. A name opens the arm on \
         the page of a running program at 127.0.0.1:9095, which applies the settings on a click.",
        &panels,
    );
    section.table(&table);
}

/// Class and name of each joint's line.
const JOINTS: [(&str, &str); 3] = [("j1", "joint 1"), ("j2", "joint 2"), ("j3", "joint 3")];

/// The page that a picture's name opens.
const PAGE: &str = "http://127.0.0.1:9095/#";

/// Half of a panel's paper, and where the curves are.
const SMALL_WIDTH: f64 = 0.5 * WIDTH;
const SMALL_HEIGHT: f64 = 0.5 * HEIGHT;
const LEFT: f64 = 8.0;
const RIGHT: f64 = SMALL_WIDTH - LEFT;
const TOP: f64 = 40.0;
const MIDDLE: f64 = 0.5 * (TOP + SMALL_HEIGHT - 24.0);

fn picture(name: &str, live: &LiveScene, holds: Option<bool>) -> Panel {
    /// A letter of a heading is no wider on average, in pixels.
    const LETTER: f64 = 8.2;
    let bottom = SMALL_HEIGHT - 8.0;
    let (class, verdict) = match holds {
        Some(true) => ("good", "holds"),
        Some(false) => ("bad", "falls short"),
        None => ("soft", "not run"),
    };
    let mut heading = String::new();
    for (y, line) in [15, 31].into_iter().zip(lines(name, RIGHT - LEFT, LETTER)) {
        let line = escape(&line);
        heading += &format!("<text class=\"title\" x=\"{LEFT}\" y=\"{y}\">{line}</text>");
    }
    let (drawn, rows) = match live.watch() {
        Ok(watched) => {
            let link = escape(&live.fragment());
            let angles = watched.samples.iter().flat_map(|(_, angles)| angles);
            let largest = largest(angles.map(|angle| angle.abs()));
            let scale = format!("{}, ±{} rad", seconds(live.seconds()), number(largest));
            let drawn = format!(
                "<a href=\"{PAGE}{link}\">{heading}</a>{}<text class=\"note\" x=\"{LEFT}\" y=\"{bottom}\">{scale}\
                 </text>",
                curves(&watched, largest)
            );
            (drawn, rows(name, &watched))
        }
        Err(why) => {
            let why = escape(&why);
            let note = format!("<text class=\"note\" x=\"{LEFT}\" y=\"{MIDDLE}\">{why}</text>");
            (heading + &note, Vec::new())
        }
    };
    Panel {
        svg: format!(
            "<svg class=\"plot\" viewBox=\"0 0 {SMALL_WIDTH} {SMALL_HEIGHT}\" role=\"img\" aria-label=\"{}\">{drawn}\
             <text class=\"note {class}\" x=\"{RIGHT}\" y=\"{bottom}\" text-anchor=\"end\">{verdict}</text></svg>",
            escape(name)
        ),
        keys: JOINTS
            .map(|(class, label)| Key::line(class, label))
            .to_vec(),
        axes: ["time [s]", "angle from the start [rad]"].map(str::to_owned),
        rows,
    }
}

fn rows(name: &str, watched: &LiveRun) -> Vec<PlotNumber> {
    let samples = watched.samples.iter();
    let row = |(time, angles): &(f64, Vec<f64>)| {
        let angles = angles.iter().zip(JOINTS);
        let row = |(angle, (_, joint)): (&f64, (&str, &str))| {
            (format!("{name}: {joint}"), *time, *angle, String::new())
        };
        angles.map(row).collect::<Vec<_>>()
    };
    samples.flat_map(row).collect()
}

fn curves(watched: &LiveRun, largest: f64) -> String {
    let end = watched.samples.last().map_or(1.0, |(time, _)| *time);
    let x = |time: f64| LEFT + (RIGHT - LEFT) * time / end;
    let part = |angle: f64| if largest > 0.0 { angle / largest } else { 0.0 };
    let y = |angle: f64| MIDDLE - (MIDDLE - TOP) * part(angle);
    let mut out = String::new();
    for (joint, (class, _)) in JOINTS.iter().enumerate() {
        let points = watched.samples.iter().filter_map(|(time, angles)| {
            Some(format!("{:.1} {:.1}", x(*time), y(*angles.get(joint)?)))
        });
        let points: Vec<String> = points.collect();
        if !points.is_empty() {
            let path = points.join("L");
            out += &format!("<g class=\"series {class}\"><path class=\"line\" d=\"M{path}\"/></g>");
        }
    }
    if watched.diverged {
        let (x, y) = (RIGHT - 8.0, MIDDLE - 4.0);
        out += "<g class=\"series ink\">";
        out += &format!("<path class=\"lost\" d=\"M{x} {y}l8 8m0 -8l-8 8\"/></g>");
    }
    out
}
