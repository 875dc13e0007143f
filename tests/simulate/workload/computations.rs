//! Requests that take some time: computations, goals, trials.

use super::*;

const LONG: &str = "long computations";

impl Workload<'_> {
    pub(super) fn compute(&mut self) {
        let method = self.court.below(Method::ALL.len());
        let name = Method::ALL[method].name();
        match self.court.below(40) {
            0 => self.compute_long(),
            1..16 => {
                let q = self.joints(-1.0, 1.0);
                let (duration, timestep) = (self.number(0.1, 1.0), 0.005);
                let samples = 2 + self.court.below(40);
                let arm = Arm::<3>::default();
                let [masses, lengths] =
                    [arm.masses(), arm.lengths()].map(|all| &all[..self.plan.links]);
                let gravity = arm.gravity();
                let params =
                    serde_json::json!({"gravity": gravity, "masses": masses, "lengths": lengths});
                let args = format!(
                    "{{\"q0\":{q},\"duration\":{duration},\"timestep\":{timestep},\"integrator\":\"{name}\",\"params\":{params},\"samples\":{samples}}}"
                );
                // At most one sample per step, and the start.
                let steps = (duration / timestep).round() as usize;
                let expect = Expect::Computed {
                    entries: samples.min(steps + 1),
                    is_short: false,
                };
                self.call("/study/rollout", &args, expect, false);
            }
            _ => {
                let function = self.court.among(&FUNCTIONS);
                let (x0, dt) = (self.number(-1.0, 1.0), self.number(0.001, 0.1));
                let most = if self.plan.room < 1000 { 20 } else { 1500 };
                let steps = 1 + self.court.below(most);
                let args = format!(
                    "{{\"function\":\"{function}\",\"x0\":{x0},\"dt\":{dt},\"steps\":{steps},\"integrator\":\"{name}\"}}"
                );
                let expect = Expect::Computed {
                    entries: steps + 1,
                    is_short: true,
                };
                self.call("/arm_sim/integration_step", &args, expect, false);
            }
        }
    }

    /// The longest computation of clients, so others take turns with it. With 3 links it would take the time of several
    /// seeds, and a second one would test nothing new.
    pub fn compute_long(&mut self) {
        let few = if self.plan.links == 3 { 1 } else { u64::MAX };
        if self.court.counted(LONG) >= few {
            return;
        }
        self.court.count(LONG);
        let args = "{\"params\":{\"gravity\":9.81}}";
        let expect = Expect::Member("advised_timestep");
        self.call("/study/stability", args, expect, false);
    }

    pub(super) fn target(&self) -> String {
        let reach = self.plan.links as f64 * 0.7;
        let (y, x) = self.number(0.0, 6.0).sin_cos();
        let reach = reach * self.number(0.5, 1.0);
        format!("{{\"x\":{},\"y\":{}}}", reach * x, reach * y)
    }

    pub(super) fn action(&mut self) {
        let goals = goals([&*self.me()]);
        if !goals.is_empty() && self.court.chance(0.4) {
            let id = self.court.among(&goals);
            if let Some(goal) = self.me().calls.get_mut(&id) {
                goal.is_cancelled = true;
            }
            return self.cancel(&id);
        }
        let (id, args, has_feedback) = (self.id(), self.target(), self.court.chance(0.5));
        let more = format!(
            "\"action_type\":\"pendularm_interfaces/action/MoveTo\",\"args\":{args},\"feedback\":{has_feedback},\"id\":{id}"
        );
        self.send(&frame("send_action_goal", "action", "/ik_action", &more));
        let court = self.court;
        let expect = Expect::Goal { has_feedback };
        self.me()
            .note_call(&id, &format!("/ik_action {args}"), expect, false, court);
    }

    pub(super) fn cancel(&mut self, id: &str) {
        // It may have ended meanwhile.
        self.me().mistakes += 1;
        let more = format!("\"id\":{id}");
        self.send(&frame("cancel_action_goal", "action", "/ik_action", &more));
    }

    /// Asks for the end of a goal that another client has sent, which must not end it.
    pub fn cancel_anothers(&mut self) {
        let who = self.me().who;
        let goals = goals(self.all.iter().filter(|one| one.who != who));
        if !goals.is_empty() {
            let id = self.court.among(&goals);
            self.cancel(&id);
        }
    }

    pub(super) fn goal(&mut self) {
        if self.court.chance(0.3) {
            // This ends the active goal of any client.
            self.model.ends_any_goal = true;
            return self.call("/ik_action/cancel_goal", "{}", Expect::Anything, true);
        }
        let args = self.target();
        self.call("/ik_action/send_goal", &args, Expect::Anything, true);
    }

    pub(super) fn trial(&mut self) {
        let (service, args) = self.court.among(&[
            ("/ik_trial/start", "{\"duration\":5}"),
            ("/ik_trial/skip", "{}"),
            ("/ik_trial/stop", "{}"),
        ]);
        self.call(service, args, Expect::Anything, true);
    }

    pub(super) fn watch(&mut self) {
        let topic = self.court.among(&WATCHED);
        if self.me().watched.insert(topic.to_owned()) {
            self.me().await_news(format!("subscribed to {topic}"));
            return self.send(&frame("subscribe", "topic", topic, ""));
        }
        // Messages on their way may still arrive, so they stay on the list of allowed messages.
        self.send(&frame("unsubscribe", "topic", topic, ""));
    }
}

/// The ids of the goals that these clients have sent.
fn goals<'a>(clients: impl IntoIterator<Item = &'a Honest>) -> Vec<String> {
    let calls = clients.into_iter().flat_map(|one| &one.calls);
    let goals = calls.filter(|(_, call)| matches!(call.expect, Expect::Goal { .. }));
    goals.map(|(id, _)| id.clone()).collect()
}
