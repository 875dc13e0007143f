//! Computations made once more, offline, against what came of them.

use pendularm::math::arm::{Arm, State};
use pendularm::math::expression::Expression;
use pendularm::math::integrator::Method;
use pendularm::math::kinematics::forward;
use pendularm::math::particle::Particle;
use pendularm::study::control_loop::ControlLoop;
use pendularm::study::rollout::{Rollout, RolloutRequest};
use serde_json::Value;
use serde_json::value::RawValue;

use super::Model;
use crate::honest::Computed;

impl Model {
    pub(super) fn solution(
        &self,
        values: &RawValue,
        result: bool,
        x: f64,
        y: f64,
    ) -> Option<String> {
        if self.is_reshaped {
            return None;
        }
        let value: Value = serde_json::from_str(values.get()).unwrap_or_default();
        let joints: Vec<f64> =
            serde_json::from_value(value["positions"].clone()).unwrap_or_default();
        let tip = match self.links {
            2 => joints
                .try_into()
                .ok()
                .map(|q| forward(Arm::<2>::default().lengths(), &q).position),
            _ => joints
                .try_into()
                .ok()
                .map(|q| forward(Arm::<3>::default().lengths(), &q).position),
        };
        let is_there = tip.is_some_and(|tip| (tip.x - x).hypot(tip.y - y) < 1e-9);
        (!result || !is_there).then(|| format!("the hand is at {tip:?}"))
    }
}

/// The offline computation, against what came.
pub(super) fn compute(
    computed: &Computed,
    links: usize,
    values: &RawValue,
    result: bool,
) -> Option<String> {
    let value: Value = serde_json::from_str(values.get()).unwrap_or_default();
    let expected = match computed {
        Computed::Particle {
            function,
            x0,
            dt,
            steps,
            method,
        } => {
            let function = Expression::parse(function).ok()?;
            let mut particle =
                Particle::new(function, *x0, 0.0, *dt, *steps, Method::ALL[*method]).ok()?;
            while particle.advance(1000) > 0 {}
            let times: Vec<f64> = particle.times().collect();
            serde_json::json!({"times": times, "positions": particle.positions(), "velocities": particle.velocities()})
        }
        Computed::Rollout { .. } if links == 2 => roll_out::<2>(computed)?,
        Computed::Rollout { .. } => roll_out::<3>(computed)?,
    };
    let same = expected
        .as_object()?
        .iter()
        .all(|(name, column)| value.get(name) == Some(column));
    (!result || !same).then(|| "the offline computation has something else".to_owned())
}

fn roll_out<const N: usize>(computed: &Computed) -> Option<Value> {
    let Computed::Rollout {
        q0,
        duration,
        timestep,
        method,
        samples,
    } = computed
    else {
        return None;
    };
    let request = RolloutRequest::<N> {
        control: ControlLoop::free(Arm::default())
            .with_method(Method::ALL[*method])
            .with_timestep(*timestep),
        start: State::at_rest(q0.clone().try_into().ok()?),
        duration: *duration,
        samples: *samples,
        reference: false,
    };
    let mut run = Rollout::new(request).ok()?;
    while run.advance(10_000) > 0 {}
    let rows = |rows: &[[f64; N]]| rows.iter().map(|row| row.to_vec()).collect::<Vec<_>>();
    Some(serde_json::json!({
        "times": run.times(), "positions": rows(run.positions()), "velocities": rows(run.velocities()),
    }))
}
