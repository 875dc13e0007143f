//! Calls of the runtime's own services, valid and invalid, whole and in pieces.

use super::*;

impl Workload<'_> {
    pub(super) fn ask(&mut self) {
        let services = [
            "/arm_sim/set_params",
            "/arm_sim/set_integrator",
            "/pid_controller/enable",
            "/pid_controller/set_gains",
            "/arm_sim/pause",
        ];
        if self.court.chance(0.2) {
            let reach = 0.2 + 0.7 * self.court.fraction();
            let (y, x) = (reach * self.number(0.0, 6.0)).sin_cos();
            let reach = self.plan.links as f64 * reach;
            let (x, y) = (0.9 * reach * x, 0.9 * reach * y);
            let args = format!("{{\"x\":{x},\"y\":{y}}}");
            // With three links an orientation is requested only if one is given.
            self.call("/ik/solve", &args, Expect::Member("positions"), true);
        } else {
            let args = self.court.among(&["{}", "[]", "{\"unknown\":[1,{}]}"]);
            let service = self.court.among(&services);
            self.call(service, args, Expect::Success, true);
        }
    }

    pub(super) fn drive(&mut self) {
        let which = self.court.below(9);
        let (service, args) = match which {
            0 => {
                let method = self.court.among(&Method::ALL);
                (
                    "/arm_sim/set_integrator",
                    format!("{{\"method\":\"{}\"}}", method.name()),
                )
            }
            1 => {
                let step = self
                    .court
                    .among(&["0.001", "5e-4", "0.002", "0.004", "1.5e-3"]);
                (
                    "/arm_sim/set_integrator",
                    format!("{{\"timestep\":{step}}}"),
                )
            }
            2 => (
                "/arm_sim/set_params",
                format!("{{\"gravity\":{}}}", self.number(0.0, 12.0)),
            ),
            3 => (
                "/arm_sim/pause",
                format!("{{\"data\":{}}}", self.court.chance(0.4)),
            ),
            4 => (
                "/arm_sim/step",
                format!("{{\"steps\":{}}}", 1 + self.court.below(300)),
            ),
            5 => {
                let (effort, duration) = (self.joints(-20.0, 20.0), self.number(0.01, 0.5));
                (
                    "/arm_sim/disturb",
                    format!("{{\"effort\":{effort},\"duration\":{duration}}}"),
                )
            }
            6 => (
                "/pid_controller/enable",
                format!("[{}]", self.court.chance(0.7)),
            ),
            7 => {
                let (kp, kd) = (self.joints(50.0, 300.0), self.joints(5.0, 20.0));
                (
                    "/pid_controller/set_gains",
                    format!("{{\"kp\":{kp},\"kd\":{kd}}}"),
                )
            }
            _ => ("/arm_sim/reset", "{}".to_owned()),
        };
        // Steps and pushes are refused while the arm runs or has diverged.
        let expect = match which {
            4 | 5 => Expect::Anything,
            _ => Expect::Success,
        };
        self.call(service, &args, expect, true);
    }

    pub(super) fn setpoint(&mut self) {
        let positions = self.joints(-2.0, 2.0);
        let frame = format!(
            "{{\"op\":\"publish\",\"topic\":\"/joint_trajectory\",\"msg\":{{\"points\":[{{\"positions\":{positions}}}]}}}}"
        );
        self.send(&frame);
    }

    pub(super) fn rosapi(&mut self) {
        let (service, args, member) = self.court.among(&[
            ("/rosapi/get_time", "{}", "time"),
            ("/rosapi/topics", "{}", "topics"),
            ("/rosapi/services", "{}", "services"),
            ("/rosapi/nodes", "{}", "nodes"),
            ("/rosapi/topic_type", "{\"topic\":\"/clock\"}", "type"),
            ("/rosapi/get_param", "{\"name\":\"gravity\"}", "value"),
            (
                "/rosapi/set_param",
                "{\"name\":\"gravity\",\"value\":\"9.5\"}",
                "successful",
            ),
            ("/rosapi/get_param_names", "{}", "names"),
            ("/rosapi/publishers", "{\"topic\":\"/t0\"}", "publishers"),
        ]);
        self.call(service, args, Expect::Member(member), true);
    }

    pub(super) fn mistake(&mut self) {
        let call = match self.court.below(5) {
            0 => Some(("/nobody/serves", "{}", Expect::Refusal)),
            1 => Some(("/arm_sim/set_params", "{\"gravity\":-1}", Expect::Refusal)),
            2 => Some(("/ik/solve", "{\"x\":1e9,\"y\":0}", Expect::Refusal)),
            3 => Some((
                "/arm_sim/integration_step",
                "{\"function\":\"sin(\"}",
                Expect::Refusal,
            )),
            _ => None,
        };
        if let Some((service, args, expect)) = call {
            let is_light = service != "/arm_sim/integration_step";
            return self.call(service, args, expect, is_light);
        }
        let frame = self.court.among(&[
            "{\"op\":\"no_such_op\"}",
            "{\"op\":\"publish\",\"topic\":7,\"msg\":{}}",
            "{\"op\":\"publish\",\"topic\":\"/clock\",\"msg\":{}}",
            "{\"op\":\"subscribe\"}",
            "{\"op\":[1,2}",
        ]);
        self.me().mistakes += 1;
        self.court.note("sends", frame.as_bytes());
        self.me().send(frame, 0);
    }

    pub(super) fn in_fragments(&mut self) {
        let id = self.id();
        let frame = format!(
            "{{\"op\":\"call_service\",\"id\":{id},\"service\":\"/pid_controller/enable\",\"args\":{{}}}}"
        );
        let (size, style) = (8 + self.court.below(60), self.style());
        self.court.note("sends in pieces", frame.as_bytes());
        self.me().send_pieces(&frame, size, style);
        let court = self.court;
        let expect = Expect::Success;
        self.me()
            .note_call(&id, "/pid_controller/enable {}", expect, true, court);
    }
}
