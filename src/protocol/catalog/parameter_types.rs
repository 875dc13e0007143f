//! The types of `rcl_interfaces` in the parameter services of every ROS 2 node.
//!
//! **Invariant:** fields are those of ROS 2's definitions. Parts that no parameter here has are empty.

use super::entry::{Type, message, required};

/// The types. A type follows the types that contain it.
pub(super) const TYPES: [Type; 7] = [
    message(
        "rcl_interfaces/msg/Parameter",
        &[
            required("name", "string", ""),
            required("value", "rcl_interfaces/msg/ParameterValue", ""),
        ],
    ),
    message(
        "rcl_interfaces/msg/ParameterValue",
        &[
            required("type", "uint8", ""),
            required("bool_value", "bool", ""),
            required("integer_value", "int64", ""),
            required("double_value", "float64", ""),
            required("string_value", "string", ""),
            required("byte_array_value", "byte[]", ""),
            required("bool_array_value", "bool[]", ""),
            required("integer_array_value", "int64[]", ""),
            required("double_array_value", "float64[]", ""),
            required("string_array_value", "string[]", ""),
        ],
    ),
    message(
        "rcl_interfaces/msg/ParameterDescriptor",
        &[
            required("name", "string", ""),
            required("type", "uint8", ""),
            required("description", "string", ""),
            required("additional_constraints", "string", ""),
            required("read_only", "bool", ""),
            required("dynamic_typing", "bool", ""),
            required(
                "floating_point_range",
                "rcl_interfaces/msg/FloatingPointRange[<=1]",
                "",
            ),
            required("integer_range", "rcl_interfaces/msg/IntegerRange[<=1]", ""),
        ],
    ),
    message(
        "rcl_interfaces/msg/FloatingPointRange",
        &[
            required("from_value", "float64", ""),
            required("to_value", "float64", ""),
            required("step", "float64", ""),
        ],
    ),
    message(
        "rcl_interfaces/msg/IntegerRange",
        &[
            required("from_value", "int64", ""),
            required("to_value", "int64", ""),
            required("step", "uint64", ""),
        ],
    ),
    message(
        "rcl_interfaces/msg/ListParametersResult",
        &[
            required("names", "string[]", ""),
            required("prefixes", "string[]", ""),
        ],
    ),
    message(
        "rcl_interfaces/msg/SetParametersResult",
        &[
            required("successful", "bool", ""),
            required("reason", "string", ""),
        ],
    ),
];
