//! The named scenes of the study. `report.rs` runs the quick ones.

use pendularm::report::experiments::scenarios::all;
use pendularm::report::scenes::live_scenes;

#[test]
fn there_are_43_scenes_in_order() {
    let (scenes, live) = (all(), live_scenes());
    assert_eq!((scenes.len(), live.len()), (43, 43));
    for ((number, scene), live) in (1..).zip(&scenes).zip(live) {
        assert_eq!(scene.id, format!("S{number:02}"));
        assert_eq!(live.id, scene.id);
        assert!(!live.name.is_empty() && !scene.parameters.is_empty());
        assert!(!scene.expected.is_empty());
    }
}

/// Each scene has a picture of a live arm, or a reason why there is none.
#[test]
fn scenes_are_shown_by_live_arms() {
    let (mut hidden, mut diverged) = (Vec::new(), Vec::new());
    for scene in live_scenes() {
        let Ok(watched) = scene.watch() else {
            hidden.push(scene.id);
            continue;
        };
        let is_shown = watched.samples.len() > 1 || watched.lost_at.is_some();
        assert!(is_shown, "{}", scene.id);
        if watched.lost_at.is_some() {
            diverged.push(scene.id);
        }
    }
    assert_eq!(hidden, ["S34", "S35", "S36"]);
    // Both are taken, and overflow is reported.
    assert_eq!(diverged, ["S31", "S33"]);
}
