//! The named scenes of the study: those that are quick, here; the others in the report.

use pendularm::report::experiments::scenarios::{Scenario, all};

fn check(scenes: impl Iterator<Item = Scenario>) {
    let mut failed = vec![];
    for scene in scenes {
        let begun = std::time::Instant::now();
        let verdict = scene.run();
        let mark = if verdict.holds {
            "holds"
        } else {
            "FALLS SHORT"
        };
        let line = format!(
            "{} {} {mark}: {} (expected: {})",
            scene.id, scene.name, verdict.observed, scene.expected
        );
        println!("{line} [{:.2?}]", begun.elapsed());
        if !verdict.holds {
            failed.push(line);
        }
    }
    assert!(failed.is_empty(), "{failed:#?}");
}

#[test]
fn there_are_39_scenes_in_order() {
    let scenes = all();
    assert_eq!(scenes.len(), 39);
    for (number, scene) in (1..).zip(&scenes) {
        assert_eq!(scene.id, format!("S{number:02}"));
        assert!(
            !scene.name.is_empty() && !scene.parameters.is_empty() && !scene.expected.is_empty()
        );
    }
}

#[test]
fn every_quick_scene_is_as_expected() {
    check(all().into_iter().filter(|scene| !scene.slow));
}

#[test]
#[ignore = "takes some seconds; the report runs them"]
fn every_slow_scene_is_as_expected() {
    check(all().into_iter().filter(|scene| scene.slow));
}
