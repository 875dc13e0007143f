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
                let name = self.court.among(&Method::ALL).name();
                (
                    "/arm_sim/set_integrator",
                    format!("{{\"method\":\"{name}\"}}"),
                )
            }
            1 => {
                let steps = ["0.001", "5e-4", "0.002", "0.004", "1.5e-3"];
                let step = self.court.among(&steps);
                (
                    "/arm_sim/set_integrator",
                    format!("{{\"timestep\":{step}}}"),
                )
            }
            2 => {
                let gravity = self.number(0.0, 12.0);
                ("/arm_sim/set_params", format!("{{\"gravity\":{gravity}}}"))
            }
            3 => {
                let on = self.court.chance(0.4);
                ("/arm_sim/pause", format!("{{\"data\":{on}}}"))
            }
            4 => {
                let steps = 1 + self.court.below(300);
                ("/arm_sim/step", format!("{{\"steps\":{steps}}}"))
            }
            5 => {
                let (effort, duration) = (self.joints(-20.0, 20.0), self.number(0.01, 0.5));
                let args = format!("{{\"effort\":{effort},\"duration\":{duration}}}");
                ("/arm_sim/disturb", args)
            }
            6 => {
                let on = self.court.chance(0.7);
                ("/pid_controller/enable", format!("[{on}]"))
            }
            7 => {
                let (kp, kd) = (self.joints(50.0, 300.0), self.joints(5.0, 20.0));
                let args = format!("{{\"kp\":{kp},\"kd\":{kd}}}");
                ("/pid_controller/set_gains", args)
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
        let msg = format!("\"msg\":{{\"points\":[{{\"positions\":{positions}}}]}}");
        self.send(&frame("publish", "topic", "/joint_trajectory", &msg));
    }

    pub(super) fn rosapi(&mut self) {
        let (service, args, member) = self.court.among(&[
            ("get_time", "{}", "time"),
            ("topics", "{}", "topics"),
            ("services", "{}", "services"),
            ("nodes", "{}", "nodes"),
            ("topic_type", "{\"topic\":\"/clock\"}", "type"),
            ("get_param", "{\"name\":\"gravity\"}", "value"),
            ("set_param", "[\"gravity\",\"9.5\"]", "successful"),
            ("get_param_names", "{}", "names"),
            ("publishers", "{\"topic\":\"/t0\"}", "publishers"),
        ]);
        let service = format!("/rosapi/{service}");
        self.call(&service, args, Expect::Member(member), true);
    }

    pub(super) fn mistake(&mut self) {
        let calls = [
            ("/nobody/serves", "{}"),
            ("/arm_sim/set_params", "{\"gravity\":-1}"),
            ("/ik/solve", "{\"x\":1e9,\"y\":0}"),
            ("/arm_sim/integration_step", "{\"function\":\"sin(\"}"),
        ];
        if let Some((service, args)) = calls.get(self.court.below(5)) {
            let is_light = *service != "/arm_sim/integration_step";
            return self.call(service, args, Expect::Refusal, is_light);
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
        let more = format!("\"id\":{id},\"args\":{{}}");
        let frame = frame("call_service", "service", "/pid_controller/enable", &more);
        let (size, style) = (8 + self.court.below(60), self.style());
        self.court.note("sends in pieces", frame.as_bytes());
        self.me().send_pieces(&frame, size, style);
        let court = self.court;
        let expect = Expect::Success;
        self.me()
            .note_call(&id, "/pid_controller/enable {}", expect, true, court);
    }
}
