//! The page's list of methods.

use crate::papers::text;
use pendularm::math::integrator::Method;

/// Each method with its order, if it is a Runge-Kutta method with as many evaluations.
#[test]
fn the_page_has_every_method_in_its_order() {
    let script = text("page/format.js");
    let line = script
        .lines()
        .find_map(|line| line.strip_prefix("export const METHODS = "));
    let line = line.unwrap().trim_end_matches(';');
    let rows: Vec<Vec<serde_json::Value>> = serde_json::from_str(line).unwrap();
    let named: Vec<(&str, Option<u64>)> = rows
        .iter()
        .map(|row| {
            (
                row[0].as_str().unwrap(),
                row.get(2).map(|one| one.as_u64().unwrap()),
            )
        })
        .collect();
    let expected = Method::ALL.map(|method| {
        let is_runge_kutta = method != Method::Verlet;
        (
            method.name(),
            is_runge_kutta.then(|| u64::from(method.order())),
        )
    });
    assert_eq!(named, expected);
}
