//! The catalogue of named stiff and extreme scenes, each run and judged.
//!
//! **Invariant:** a scene that is not run is listed as not run, one that falls short as falling short.

use crate::report::csv::Csv;
use crate::report::experiments::scenarios;
use crate::report::making::Making;
use crate::report::section::{Block, Cell, Section, Table, Verdict};
use crate::report::svg::plain;

pub(super) fn make(making: &mut Making<'_>) -> Section {
    let all = scenarios::all();
    let mut table = Table::new(
        "scenarios",
        "Every scene, as expected and as observed",
        "Expectations come from theory or from the arm's own prediction, never from an earlier run.",
        &["", "Scene", "Expected", "Observed", ""],
    );
    let mut csv = Csv::new("id,name,parameters,expected,observed,holds");
    let (mut run, mut short) = (0, Vec::new());
    for (index, scene) in all.iter().enumerate() {
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
        making.at(index + 1, all.len());
    }
    making.keep("scenarios", csv);
    let held = run - short.len();
    let mut finding = format!("**{held} of {run} stiff and extreme scenes do as theory says**");
    if short.is_empty() {
        finding.push('.');
    } else {
        finding.push_str(&format!("; short fall {}.", short.join(", ")));
    }
    Section {
        findings: vec![finding],
        verdicts: vec![Verdict {
            claim: format!("All {} named scenes do as expected", all.len()),
            seen: match (short.is_empty(), all.len() - run) {
                (true, 0) => "all of them".to_owned(),
                (true, left) => format!("all that were run; {left} were not"),
                (false, _) => format!("not {}", short.join(", ")),
            },
            holds: short.is_empty(),
        }],
        blocks: vec![Block::Table(table)],
        ..Section::default()
    }
}
