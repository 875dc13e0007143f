//! The source of the package with this project's own types, which a ROS 2 workspace builds to use the bridge.
//!
//! **Invariant:** types built from it have the hashes in the graph. No type has an inner type of another package, so
//! only ROS 2's generators are needed.

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::Path;

use pendularm::protocol::catalog::types::{self, Type};
use pendularm::protocol::catalog::{Action, Service};

use crate::interfaces::{NOTHING, ServiceInterface};

/// The package's name.
pub const NAME: &str = "pendularm_interfaces";
/// The separator between the parts of a service or an action.
const DIVIDER: &str = "---\n";

/// Writes the package into `folder`, and returns its number of types.
///
/// # Errors
/// If a folder or a file cannot be written.
pub fn write(folder: &Path) -> io::Result<usize> {
    let interfaces = interfaces();
    for kind in ["msg", "srv", "action"] {
        fs::create_dir_all(folder.join(kind))?;
    }
    for (path, text) in &interfaces {
        fs::write(folder.join(path), text)?;
    }
    fs::write(folder.join("package.xml"), manifest())?;
    fs::write(folder.join("CMakeLists.txt"), recipe(interfaces.keys()))?;
    Ok(interfaces.len())
}

/// The definitions by their paths.
fn interfaces() -> BTreeMap<String, String> {
    let mut texts = BTreeMap::new();
    let mut add = |name: &str, parts: &[Type]| {
        let Some(path) = name
            .strip_prefix(NAME)
            .and_then(|rest| rest.strip_prefix('/'))
        else {
            return;
        };
        let (kind, _) = path.split_once('/').unwrap_or_default();
        let parts: Vec<String> = parts.iter().map(text).collect();
        texts.insert(format!("{path}.{kind}"), parts.join(DIVIDER));
    };
    for one in types::all() {
        add(one.name, &[one]);
    }
    for service in Service::ALL {
        let of = ServiceInterface::of_catalogue(service);
        add(of.name, &[of.request, of.response]);
    }
    for action in Action::ALL {
        add(action.type_name(), &action.parts());
    }
    texts
}

/// A part's definition.
fn text(part: &Type) -> String {
    // ROS 2 adds its filler to an empty type itself.
    if part.fields == NOTHING {
        return String::new();
    }
    types::own_text(*part)
}

fn manifest() -> String {
    format!(
        r#"<?xml version="1.0"?>
<package format="3">
  <name>{NAME}</name>
  <version>{}</version>
  <description>Messages, services and actions of pendularm, written by pendularm-ros2</description>
  <maintainer email="pendularm@example.com">pendularm</maintainer>
  <license>MIT OR Apache-2.0</license>
  <buildtool_depend>ament_cmake</buildtool_depend>
  <buildtool_depend>rosidl_default_generators</buildtool_depend>
  <depend>action_msgs</depend>
  <exec_depend>rosidl_default_runtime</exec_depend>
  <member_of_group>rosidl_interface_packages</member_of_group>
  <export>
    <build_type>ament_cmake</build_type>
  </export>
</package>
"#,
        env!("CARGO_PKG_VERSION")
    )
}

fn recipe<'a>(paths: impl Iterator<Item = &'a String>) -> String {
    let paths: String = paths.map(|path| format!("  \"{path}\"\n")).collect();
    format!(
        "cmake_minimum_required(VERSION 3.8)
project({NAME})
find_package(ament_cmake REQUIRED)
find_package(rosidl_default_generators REQUIRED)
rosidl_generate_interfaces(${{PROJECT_NAME}}
{paths})
ament_export_dependencies(rosidl_default_runtime)
ament_package()
"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn services_say_how_a_call_went_and_have_units() {
        let texts = interfaces();
        let text = &texts["srv/SetIntegrator.srv"];
        assert_eq!(
            text,
            "string method\nfloat64 timestep  # s\n---\nstring method\nfloat64 timestep  # s\nbool success\nstring message\n"
        );
    }

    #[test]
    fn no_type_has_one_of_another_package_inside() {
        for (path, text) in interfaces() {
            for line in text.lines() {
                let kind = line.split(' ').next().unwrap();
                let package = kind.split_once('/').map_or(NAME, |(package, _)| package);
                assert_eq!(package, NAME, "{path}: {line}");
            }
        }
    }
}
