//! The catalogue of named stiff and extreme scenes, each simulated and checked.
//!
//! **Invariant:** a scene that is not run is listed as not run, and one that fails as failed.

use crate::report::experiments::scenarios;
use crate::report::scenes::{LiveScene, live_scenes};
use crate::report::section::{Cell, Section, Table, verdict};
use crate::report::svg::{Axis, Curve, Key, Plot, Thumbnail, number, plain, seconds};
use crate::study::matrix::largest;

pub(super) fn make(section: &mut Section) {
    let all = scenarios::all();
    let live = live_scenes();
    let mut table = Table::new(
        "scenarios",
        "Every scene, as expected and as observed",
        "Expectations come from theory or from the arm's own prediction. Only the rates of S05 and S06 are from earlier runs.",
        ["", "Scene", "Expected", "Observed", ""],
    );
    let (mut run, mut short, mut panels) = (0, Vec::new(), Vec::new());
    for scene in &all {
        let Some(live) = live.iter().find(|live| live.id == scene.id) else {
            continue;
        };
        // Slow scenes take seconds each, too long for a quick report.
        let verdict = (!scene.slow || !section.quick).then(|| scene.run());
        let holds = verdict.as_ref().map(|verdict| verdict.0);
        let name = format!("{} {}", scene.id, live.name);
        run += usize::from(holds.is_some());
        if holds == Some(false) {
            short.push(name.clone());
        }
        let observed = verdict.map(|(_, observed)| plain(&observed));
        let observed = observed.unwrap_or_else(|| "not run in a quick report".to_owned());
        panels.push(picture(&name, live, holds));
        table.rows.push(vec![
            Cell::new(scene.id),
            Cell::new(&live.name).detail(plain(scene.parameters)),
            Cell::new(plain(scene.expected)),
            Cell::new(observed),
            Cell::verdict(holds),
        ]);
    }
    let names = short.join(", ");
    let finding = format!(
        "**{} of {run} stiff and extreme scenes agree with theory**",
        run - short.len()
    );
    section.findings.push(match short.is_empty() {
        true => finding + ".",
        false => format!("{finding}; these do not: {names}."),
    });
    let seen = match (short.is_empty(), all.len() - run) {
        (true, 0) => "all of them".to_owned(),
        (true, left) => format!("all that were run; {left} were not"),
        (false, _) => format!("not {names}"),
    };
    section.claim(
        format!("All {} named scenes behave as expected", all.len()),
        seen,
        short.is_empty(),
    );
    section.figure(
        "scenarios",
        "The stiff and extreme scenes, each as one live arm",
        "Joint angles from their start, by the live arm's own steps. The scale is that of the largest angle, which is \
         written below. A cross marks the end of a run that diverged. Below: the duration, the largest angle, and \
         whether the scene is as expected; the table has the details. The step Stiff and extreme of the page has \
         all but S36.",
        &panels,
    );
    section.table(&table);
}

/// Class and name of each joint's line.
const JOINTS: [(&str, &str); 3] = [("j1", "joint 1"), ("j2", "joint 2"), ("j3", "joint 3")];

/// Joint angles over time of the scene's live arm, or the reason why there are none.
fn picture(name: &str, live: &LiveScene, holds: Option<bool>) -> Plot {
    let watched = live.watch();
    let samples = watched.as_ref().map_or(&[][..], |watched| &watched.samples);
    let angles = samples.iter().flat_map(|(_, angles)| angles);
    let largest = largest(angles.map(|angle| angle.abs()));
    let lost = watched.as_ref().ok().and_then(|watched| watched.lost_at);
    let end = lost.or(samples.last().map(|it| it.0)).unwrap_or(0.0);
    let [width, reach] = [end, largest].map(|it| if it > 0.0 { it } else { 1.0 });
    let x = Axis::linear("time [s]", (0.0, width));
    let y = Axis::linear("angle from the start [rad]", (-reach, reach));
    let mut plot = Plot::new(name, x, y);
    for (joint, (class, label)) in JOINTS.into_iter().enumerate() {
        let points = samples.iter();
        let points = points.filter_map(|(time, angles)| Some((*time, *angles.get(joint)?)));
        plot.add(Curve::line(Key::line(class, label), points));
    }
    plot.add(Curve::dots(
        Key::line("ink", ""),
        lost.map(|time| (time, f64::INFINITY)),
    ));
    let note = match watched {
        Ok(_) => {
            let lasted = lost.unwrap_or(live.seconds());
            format!("{}, ±{} rad", seconds(lasted), number(largest))
        }
        Err(why) => why,
    };
    plot.thumbnail = Some(Thumbnail {
        note,
        verdict: verdict(holds),
    });
    plot
}
