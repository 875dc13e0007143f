//! The parameters of `get_param` and `set_param`: fields of the arm's services, by name. One row each.
//!
//! **Invariant:** a parameter has no separate value. It is a field of the service that sets it.

use crate::protocol::catalog::{Node, Service, table};
use crate::protocol::names;

table! {
    /// A parameter of the arm.
    pub enum Parameter of ParameterEntry {
        /// Gravity \[m/s²\].
        Gravity = field_of(Service::SetParams, "gravity"),
        /// Masses of the links \[kg\].
        Masses = field_of(Service::SetParams, "masses"),
        /// Lengths of the links \[m\].
        Lengths = field_of(Service::SetParams, "lengths"),
        /// Viscous friction of the joints \[N m s/rad\].
        Viscous = field_of(Service::SetFriction, "viscous"),
        /// Proportional gains.
        Kp = field_of(Service::SetGains, "kp"),
        /// Integral gains.
        Ki = field_of(Service::SetGains, "ki"),
        /// Derivative gains.
        Kd = field_of(Service::SetGains, "kd"),
        /// The integration method.
        Integrator = ParameterEntry {
            name: "integrator",
            ..field_of(Service::SetIntegrator, "method")
        },
        /// The timestep \[s\].
        Timestep = field_of(Service::SetIntegrator, "timestep"),
        /// The time between two runs of the control law \[s\].
        ControlPeriod = ParameterEntry {
            name: "control_period",
            ..field_of(Service::SetPeriod, "period")
        },
        /// The largest efforts of the motors \[N m\]; without entries for no limit.
        EffortLimit = ParameterEntry {
            name: "effort_limit",
            ..field_of(Service::SetLimits, "effort")
        },
        /// What the integral does while an effort is at its limit.
        AntiWindup = field_of(Service::SetLimits, "anti_windup"),
        /// The tracking time of the back calculation \[s\].
        TrackingTime = field_of(Service::SetLimits, "tracking_time"),
        /// The steps of the encoders \[rad\].
        EncoderStep = field_of(Service::SetSensors, "encoder_step"),
        /// How the controller measures velocities.
        MeasuredVelocity = ParameterEntry {
            name: "measured_velocity",
            ..field_of(Service::SetSensors, "velocity")
        },
        /// The delay of the efforts \[control periods\].
        ControlDelay = ParameterEntry {
            name: "control_delay",
            ..field_of(Service::SetSensors, "delay")
        },
        /// The arm as URDF, computed from lengths and masses; read only.
        RobotDescription = ParameterEntry { name: "robot_description", field: None },
    }
}

/// The answer for an unknown parameter.
pub const NO_SUCH: &str = "name must be that of a parameter, such as /arm_sim:gravity; \
    /rosapi/get_param_names and `pendularm param list` list all";

/// Most parameters in one call of a parameter service: each of them several times.
pub const MAX_NAMED: usize = 64;

/// The type of a parameter, a value of `rcl_interfaces/msg/ParameterType`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ParameterType {
    /// A whole number.
    Integer = 2,
    /// A number.
    Double = 3,
    /// A string.
    Text = 4,
    /// A number for each joint.
    DoubleArray = 8,
}

impl ParameterType {
    /// The type's name in ROS 2.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Integer => "integer",
            Self::Double => "double",
            Self::Text => "string",
            Self::DoubleArray => "double array",
        }
    }
}

/// A row: the parameter's name, and the field with its value.
pub(super) struct ParameterEntry {
    name: &'static str,
    field: Option<(Service, &'static str)>,
}

/// A parameter with the name of its field.
const fn field_of(service: Service, name: &'static str) -> ParameterEntry {
    ParameterEntry {
        name,
        field: Some((service, name)),
    }
}

/// The node that has the parameters.
const NODE: Node = Node::ArmSim;
/// The node that has the description in other systems, so tools query it.
const DESCRIBING_NODE: &str = "robot_state_publisher";

impl Parameter {
    /// The name without a node.
    #[must_use]
    pub const fn name(self) -> &'static str {
        self.entry().name
    }

    /// The name in `get_param_names`: `/arm_sim:gravity`.
    #[must_use]
    pub fn full_name(self) -> String {
        format!("/{}:{}", NODE.name(), self.name())
    }

    /// The parameter of that name: `gravity`, `/gravity`, `arm_sim:gravity` or `/arm_sim:gravity`.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        let (node, name) = match name.rsplit_once(':') {
            Some((node, name)) => (Some(names::relative(node)), name),
            None => (None, names::relative(name)),
        };
        let found = Self::ALL.into_iter().find(|one| one.name() == name)?;
        let described = found == Self::RobotDescription && node == Some(DESCRIBING_NODE);
        (described || node.is_none_or(|node| node == NODE.name())).then_some(found)
    }

    /// The type of its value.
    #[must_use]
    pub fn kind(self) -> ParameterType {
        match self.unit_and_kind() {
            (_, "uint64") => ParameterType::Integer,
            (_, "float64") => ParameterType::Double,
            (_, "float64[]") => ParameterType::DoubleArray,
            _ => ParameterType::Text,
        }
    }

    /// A description in a few words.
    #[must_use]
    pub fn description(self) -> String {
        match (self.field(), self.unit_and_kind().0) {
            (None, _) => "the arm as URDF, made from lengths and masses".to_owned(),
            (Some((service, field)), "") => format!("{field} of {}", service.name()),
            (Some((service, field)), unit) => format!("{field} of {}, in {unit}", service.name()),
        }
    }

    /// Unit and type of the field with its value, from the catalog; empty for a computed parameter.
    fn unit_and_kind(self) -> (&'static str, &'static str) {
        let field = self.field().and_then(|(service, name)| {
            let mut fields = service.fields().iter();
            fields.find(|field| field.name == name)
        });
        field.map_or(("", ""), |field| (field.unit, field.kind))
    }

    /// The service of the parameter, and the field with its value; none for a computed parameter.
    #[must_use]
    pub const fn field(self) -> Option<(Service, &'static str)> {
        self.entry().field
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parameter_goes_by_its_name_with_a_slash_or_its_node_before_it() {
        for one in Parameter::ALL {
            let name = one.name();
            for spelled in [
                name.to_owned(),
                format!("/{name}"),
                format!("arm_sim:{name}"),
                one.full_name(),
            ] {
                assert_eq!(Parameter::from_name(&spelled), Some(one), "{spelled}");
            }
        }
        let described = Parameter::from_name("/robot_state_publisher:robot_description");
        assert_eq!(described, Some(Parameter::RobotDescription));
        for other in [
            "",
            "/",
            "ik:gravity",
            "gravity:",
            "robot_state_publisher:gravity",
        ] {
            assert_eq!(Parameter::from_name(other), None, "{other}");
        }
    }

    #[test]
    fn every_field_of_a_parameter_is_one_that_its_service_takes_and_answers() {
        for parameter in Parameter::ALL {
            let Some((service, field)) = parameter.field() else {
                assert_eq!(parameter, Parameter::RobotDescription);
                continue;
            };
            assert!(service.fields().iter().any(|one| one.name == field));
            assert!(
                service
                    .response_fields()
                    .iter()
                    .any(|one| one.name == field)
            );
        }
    }
}
