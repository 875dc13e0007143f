//! Calls: the question of each service, and its answer.
//!
//! **Invariant:** the runtime's own functions read a question and write its answer.

use pendularm::live::ArmRequest;
use pendularm::protocol::catalog::Service;
use pendularm::protocol::messages;
use pendularm::protocol::op::fields::Fields;
use pendularm::protocol::op::{Arguments, CallService};
use pendularm::protocol::wire::json::Payload;
use pendularm::services::arm::{
    Disturb, Enable, Pause, Reset, SetFriction, SetGains, SetIntegrator, SetLimits, SetParams,
    SetPeriod, SetSensors, SetState, Step,
};
use pendularm::services::goals::{CancelRequest, GoalRequest, Solve};
use pendularm::services::study::{
    Computed, FindHeldLimit, PredictStability, Present, RunOffline, SuggestGains, Work,
};
use pendularm::services::trial::TrialRequest;
use pendularm::services::{Address, Ask, NoService};

use super::Kernel;
use super::computing::Answering;
use super::repeated::Repeated;

/// Why a method of one's own is refused.
const OWN_METHOD: &str =
    "tableau: a method of your own needs a server, and the page in one file has none";

/// Whether a request has a method of one's own, which the kernel does not have.
fn has_tableau(service: Service, args: &Arguments) -> bool {
    Fields::read(args, service).is_ok_and(|mut fields| fields.raw("tableau").is_some())
}

impl<const N: usize> Kernel<N> {
    /// Takes a call.
    pub(super) fn call(&mut self, call: CallService, id: Option<Payload>) {
        let CallService { service, args, .. } = call;
        let Some(own) = Service::from_name(&service) else {
            let why = NoService::NoProvider(service.clone()).to_string();
            return self.send(messages::failure(
                &service,
                id.as_ref(),
                &why,
                self.error_form,
            ));
        };
        if !own.is_computation() {
            self.take_due_steps();
        }
        let to = Address::new(own, service.into_boxed_str(), id).with_errors(self.error_form);
        match own {
            Service::SetIntegrator => self.of_arm::<SetIntegrator>(own, &args, &to),
            Service::SetParams => self.of_arm::<SetParams<N>>(own, &args, &to),
            Service::SetFriction => self.of_arm::<SetFriction<N>>(own, &args, &to),
            Service::Pause => self.of_arm::<Pause>(own, &args, &to),
            Service::Reset => self.of_arm::<Reset<N>>(own, &args, &to),
            Service::SetState => self.of_arm::<SetState<N>>(own, &args, &to),
            Service::Disturb => self.of_arm::<Disturb<N>>(own, &args, &to),
            Service::SetGains => self.of_arm::<SetGains<N>>(own, &args, &to),
            Service::SetLimits => self.of_arm::<SetLimits<N>>(own, &args, &to),
            Service::SetSensors => self.of_arm::<SetSensors<N>>(own, &args, &to),
            Service::SetPeriod => self.of_arm::<SetPeriod>(own, &args, &to),
            Service::Enable => self.of_arm::<Enable>(own, &args, &to),
            Service::Step => self.answer::<Step<N>>(own, &args, &to, Self::step),
            Service::Solve => self.of_arm::<Solve<N>>(own, &args, &to),
            Service::SendGoal => match GoalRequest::<N>::read(own, &args) {
                Ok(goal) => self.take_goal(goal, &to),
                Err(rejected) => self.send(to.failure(&rejected.status())),
            },
            Service::CancelGoal => match CancelRequest::read(own, &args) {
                Ok(CancelRequest { goal_id }) => {
                    let outcome = self.cancel(goal_id.as_deref());
                    self.send(CancelRequest::write(outcome, &to));
                }
                Err(rejected) => self.send(to.failure(&rejected.status())),
            },
            Service::TrialStart | Service::TrialSkip | Service::TrialStop => {
                self.answer::<TrialRequest>(own, &args, &to, |kernel, ask| {
                    kernel.change_trial(ask, &to)
                });
            }
            Service::Stability => {
                self.begin::<PredictStability<N>, _>(own, &args, to, Computed::work);
            }
            Service::HeldLimit => {
                self.begin::<FindHeldLimit, _>(own, &args, to, Computed::work);
            }
            Service::SuggestGains => {
                self.begin::<SuggestGains<N>, _>(own, &args, to, Computed::work);
            }
            Service::Method => self.send(to.failure(OWN_METHOD)),
            Service::Rollout if has_tableau(own, &args) => self.send(to.failure(OWN_METHOD)),
            Service::Rollout => self.begin::<RunOffline<N>, _>(own, &args, to, Repeated::new),
            _ => self.send(to.failure(&NoService::NotServed(to.name().to_owned()).to_string())),
        }
    }

    /// Reads a question, answers it, and writes the answer after all reports of goals.
    fn answer<A: Ask>(
        &mut self,
        service: Service,
        args: &Arguments,
        to: &Address,
        answer: impl FnOnce(&mut Self, A) -> A::Answer,
    ) {
        match A::read(service, args) {
            Ok(ask) => {
                let answer = answer(self, ask);
                self.settle();
                self.send(A::write(answer, to));
            }
            Err(rejected) => self.send(to.failure(&rejected.status())),
        }
    }

    fn of_arm<A: ArmRequest<N>>(&mut self, service: Service, args: &Arguments, to: &Address) {
        self.answer::<A>(service, args, to, |kernel, ask| {
            ask.perform(&mut kernel.arm)
        });
    }

    /// Takes all steps, with the reports of the goal in between.
    fn step(&mut self, ask: Step<N>) -> <Step<N> as Ask>::Answer {
        let mut asked = self.arm.begin_steps(ask)?;
        loop {
            let (stepped, progress) = self.arm.take_row(&mut asked);
            self.settle();
            if let Some(progress) = progress {
                self.judge(progress);
            }
            if let Some(stepped) = stepped {
                return Ok(stepped);
            }
        }
    }

    fn begin<A: Ask, W: Work<A::Answer> + 'static>(
        &mut self,
        service: Service,
        args: &Arguments,
        to: Address,
        work: impl FnOnce(A, Present<N>) -> W,
    ) {
        match A::read(service, args) {
            Ok(ask) => {
                let work = work(ask, self.arm.present());
                self.computations
                    .push_back(Box::new(Answering::<A, W>::new(work, to)));
            }
            Err(rejected) => self.send(to.failure(&rejected.status())),
        }
    }
}
