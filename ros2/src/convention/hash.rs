//! Type hashes (RIHS01): the SHA-256 of a type's description as JSON, by which ROS 2 compares the types of two
//! endpoints.
//!
//! **Invariant:** the description has every inner type, sorted by name, and neither constants nor defaults.

use std::collections::BTreeMap;

use pendularm::protocol::catalog::Field;
use pendularm::protocol::catalog::types::{self, Type};
use sha2::{Digest, Sha256};

/// Added to the number of a type for arrays of it.
const ARRAY: u32 = 48;
const BOUNDED: u32 = 96;
const UNBOUNDED: u32 = 144;
/// The number of a type that has fields.
const NESTED: u32 = 1;

/// The hash of a type: `RIHS01_` and 64 digits. Inner types that are not in the catalog are searched in `beside`.
#[must_use]
pub fn type_hash(first: Type, beside: &[Type]) -> String {
    let digest = Sha256::digest(description(first, beside));
    format!("RIHS01_{digest:x}")
}

/// The hashed text.
fn description(first: Type, beside: &[Type]) -> String {
    let mut inside = BTreeMap::new();
    collect(first, beside, &mut inside);
    let inside: Vec<String> = inside.values().map(own_description).collect();
    format!(
        r#"{{"type_description": {}, "referenced_type_descriptions": [{}]}}"#,
        own_description(&first),
        inside.join(", ")
    )
}

/// Adds every type inside `one` to `found`.
fn collect(one: Type, beside: &[Type], found: &mut BTreeMap<&'static str, Type>) {
    for field in one.fields {
        let base = Kind::of(field).base;
        let near = beside.iter().find(|one| one.name == base).copied();
        let inner = near.or_else(|| types::find(base).filter(|one| one.name == base));
        if let Some(inner) = inner
            && found.insert(inner.name, inner).is_none()
        {
            collect(inner, beside, found);
        }
    }
}

fn own_description(one: &Type) -> String {
    let fields: Vec<String> = one.fields.iter().map(field_description).collect();
    format!(
        r#"{{"type_name": "{}", "fields": [{}]}}"#,
        one.name,
        fields.join(", ")
    )
}

fn field_description(field: &Field) -> String {
    let kind = Kind::of(field);
    let number = number(kind.base);
    let nested = if number == NESTED { kind.base } else { "" };
    format!(
        r#"{{"name": "{}", "type": {{"type_id": {}, "capacity": {}, "string_capacity": 0, "nested_type_name": "{nested}"}}}}"#,
        field.name,
        number + kind.many,
        kind.capacity
    )
}

/// The parts of a field's type.
struct Kind {
    base: &'static str,
    /// Added to its number.
    many: u32,
    capacity: usize,
}

impl Kind {
    fn of(field: &Field) -> Self {
        let array = field.kind.strip_suffix(']');
        let Some((base, count)) = array.and_then(|kind| kind.rsplit_once('[')) else {
            return Self {
                base: field.kind,
                many: 0,
                capacity: 0,
            };
        };
        let (many, count) = match count.strip_prefix("<=") {
            Some(bound) => (BOUNDED, bound),
            None if count.is_empty() => (UNBOUNDED, "0"),
            None => (ARRAY, count),
        };
        Self {
            base,
            many,
            capacity: count.parse().unwrap_or_default(),
        }
    }
}

/// The number of a type, from `type_description_interfaces/msg/FieldType`.
fn number(base: &str) -> u32 {
    match base {
        "int8" => 2,
        // A ROS `char` is an unsigned byte.
        "uint8" | "char" => 3,
        "int16" => 4,
        "uint16" => 5,
        "int32" => 6,
        "uint32" => 7,
        "int64" => 8,
        "uint64" => 9,
        "float32" => 10,
        "float64" => 11,
        "bool" => 15,
        "byte" => 16,
        "string" => 17,
        _ => NESTED,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// From `get_typestore(Stores.ROS2_JAZZY).hash_rihs01(name)` of the Python package rosbags.
    const JAZZY: [(&str, &str); 6] = [
        (
            "sensor_msgs/msg/JointState",
            "RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e",
        ),
        (
            "diagnostic_msgs/msg/DiagnosticArray",
            "RIHS01_5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e",
        ),
        (
            "rcl_interfaces/msg/ParameterDescriptor",
            "RIHS01_52175dbfda6c51153101d33d2a9da05743f66f02d5ab2ca9ec4709b46b73d704",
        ),
        (
            "action_msgs/msg/GoalStatusArray",
            "RIHS01_6c1684b00f177d37438febe6e709fc4e2b0d4248dca4854946f9ed8b30cda83e",
        ),
        (
            "trajectory_msgs/msg/MultiDOFJointTrajectory",
            "RIHS01_3a18fd095292a65cfde8833c72985a30af981f3ec44494655c6267262b443a4a",
        ),
        // From the code that ROS 2 generates for it.
        (
            "control_msgs/msg/JointComponentTolerance",
            "RIHS01_739ea7566931944d33830fa10f1bf5e7a7fbdc3172bce7a7eaac642bd6e3ffa4",
        ),
    ];

    #[test]
    fn standard_types_have_the_hashes_that_jazzy_has() {
        for (name, expected) in JAZZY {
            let one = types::find(name).unwrap();
            assert_eq!(type_hash(one, &[]), expected, "{name}");
        }
    }
}
