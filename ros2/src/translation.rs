//! Translates between messages of ROS 2, which always have every field, and those of the arm, where fields may be
//! absent. Pure.
//!
//! **Invariant:** a request with only default values changes nothing, except by its `bool`s.

use pendularm::protocol::catalog::Field;
use pendularm::protocol::catalog::types;
use serde_json::{Map, Value};

use crate::interfaces::ServiceInterface;

/// The arguments of a call without empty optional fields: 0, NaN, an empty text or array, or an object with only
/// such members. A `bool` is never empty.
#[must_use]
pub fn arguments(fields: &[Field], request: &mut Value) -> Value {
    let mut arguments = Map::new();
    for field in fields {
        let Some(mut value) = request.get_mut(field.name).map(Value::take) else {
            continue;
        };
        if value.is_object()
            && let Some(inner) = types::find(field.kind)
        {
            value = self::arguments(inner.fields, &mut value);
        }
        if field.required || !is_empty(&value) {
            arguments.insert(field.name.to_owned(), value);
        }
    }
    Value::Object(arguments)
}

fn is_empty(value: &Value) -> bool {
    match value {
        Value::Null => true,
        Value::Bool(_) => false,
        Value::Number(number) => number.as_f64() == Some(0.0),
        Value::String(text) => text.is_empty(),
        Value::Array(entries) => entries.is_empty(),
        Value::Object(members) => members.is_empty(),
    }
}

/// A response with the arm's values, and with the outcome of the call if the type has fields for it.
#[must_use]
pub fn response(of: &ServiceInterface, values: Value, is_success: bool, status: &str) -> Value {
    let mut members = match values {
        Value::Object(members) => members,
        // A service of the arm returns an object. A refusal may have a text instead.
        _ => Map::new(),
    };
    for value in members.values_mut() {
        flatten(value);
    }
    if of.tells_outcome() {
        members.insert("success".to_owned(), is_success.into());
        members.insert("message".to_owned(), status.into());
    }
    Value::Object(members)
}

/// Joins the rows of an array of arrays.
fn flatten(value: &mut Value) {
    let Value::Array(rows) = value else { return };
    if rows.first().is_some_and(Value::is_array) {
        let rows = std::mem::take(rows).into_iter();
        *value = rows
            .flat_map(|row| match row {
                Value::Array(entries) => entries,
                other => vec![other],
            })
            .collect();
    }
}

#[cfg(test)]
mod tests {
    use pendularm::protocol::catalog::Service;
    use serde_json::json;

    use super::*;

    #[test]
    fn optional_fields_that_are_empty_are_absent_and_switches_never_are() {
        let mut request = json!({"gravity": 0.0, "masses": [1.0, 2.0], "lengths": []});
        let fields = Service::SetParams.fields();
        assert_eq!(
            arguments(fields, &mut request),
            json!({"masses": [1.0, 2.0]})
        );
        let mut request = json!({"gravity": null, "masses": [], "lengths": []});
        assert_eq!(arguments(fields, &mut request), json!({}));
        let mut request = json!({"data": false});
        let fields = Service::Pause.fields();
        assert_eq!(arguments(fields, &mut request), json!({"data": false}));
    }

    #[test]
    fn required_fields_are_there_however_empty() {
        let mut request = json!({"effort": [], "duration": 0.0});
        let fields = Service::Disturb.fields();
        assert_eq!(
            arguments(fields, &mut request),
            json!({"effort": [], "duration": 0.0})
        );
    }

    #[test]
    fn an_object_of_which_all_is_empty_is_absent() {
        let gains = json!({"kp": [], "ki": [], "kd": []});
        let params = json!({"gravity": 1.62, "masses": [], "lengths": []});
        let mut request =
            json!({"integrator": "", "gains": gains, "params": params, "setpoint": []});
        let fields = Service::Stability.fields();
        assert_eq!(
            arguments(fields, &mut request),
            json!({"params": {"gravity": 1.62}})
        );
    }

    #[test]
    fn a_refusal_has_the_present_values() {
        let of = ServiceInterface::of_catalogue(Service::SetParams);
        let told = response(&of, json!({"gravity": 9.81}), false, "masses: too few");
        assert_eq!(
            told,
            json!({"gravity": 9.81, "success": false, "message": "masses: too few"})
        );
    }

    #[test]
    fn rows_are_put_one_behind_the_other() {
        let mut rows = json!([[1.0, 2.0], [3.0, null]]);
        flatten(&mut rows);
        assert_eq!(rows, json!([1.0, 2.0, 3.0, null]));
        let mut plain = json!([1.0]);
        flatten(&mut plain);
        assert_eq!(plain, json!([1.0]));
    }
}
