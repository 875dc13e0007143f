//! The page's list of methods.

use crate::papers::text;
use pendularm::math::integrator::Method;
use serde_json::Value;

/// Each method with its order, if it is a Runge-Kutta method with as many evaluations.
#[test]
fn the_page_has_every_method_in_its_order() {
    let script = text("page/format.js");
    let mut lines = script.lines();
    let line = lines.find_map(|line| line.strip_prefix("export const METHODS = "));
    let line = line.unwrap().trim_end_matches(';');
    let rows: Vec<Vec<Value>> = serde_json::from_str(line).unwrap();
    let order = |row: &[Value]| row.get(2).map(|order| order.as_u64().unwrap());
    let rows = rows.iter();
    let named: Vec<_> = rows
        .map(|row| (row[0].as_str().unwrap(), order(row)))
        .collect();
    let expected = Method::ALL.map(|method| {
        let order = (method != Method::Verlet).then(|| u64::from(method.order()));
        (method.name(), order)
    });
    assert_eq!(named, expected);
}
