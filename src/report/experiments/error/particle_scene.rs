//! The 1-DOF service against its closed form: `ẍ = cos 2t`, so `x = x₀ + v₀ t + sin² t / 2`.
//!
//! **Invariant:** what is run is the computation behind `/arm_sim/integration_step`, expression and all; the closed
//! form is evaluated with 106 bits.

use super::scene::{MOST_LOOKS, RunOutcome, Scene, Worst};
use crate::math::count::in_f64;
use crate::math::expression::Expression;
use crate::math::integrator::Method;
use crate::math::particle::{MAX_STEPS, Particle};
use crate::report::experiments::reference::DoubleDouble;

const FUNCTION: &str = "cos(2*t)";
const X0: f64 = 0.5;
const V0: f64 = -0.25;
const DURATION: f64 = 8.0;

/// The scene; it has no parameters.
#[derive(Debug, Clone, Copy, Default)]
pub struct ParticleScene;

impl ParticleScene {
    fn particle(method: Method, steps: u64) -> Option<Particle> {
        let function = Expression::parse(FUNCTION).ok()?;
        Particle::new(function, X0, V0, DURATION / in_f64(steps), steps, method).ok()
    }
}

fn exact(t: f64) -> DoubleDouble {
    let real = DoubleDouble::from;
    let (sin, _) = real(t).sin_cos();
    real(X0) + real(V0) * real(t) + real(0.5) * sin * sin
}

impl Scene for ParticleScene {
    fn name(&self) -> &'static str {
        "particle"
    }

    fn title(&self) -> &'static str {
        "1-DOF service, closed form"
    }

    fn about(&self) -> String {
        format!("ẍ = {FUNCTION} from x = {X0} m, ẋ = {V0} m/s; {DURATION} s")
    }

    fn links(&self) -> usize {
        0
    }

    fn control(&self) -> &'static str {
        "none"
    }

    fn duration(&self) -> f64 {
        DURATION
    }

    fn uncertainty(&self) -> f64 {
        // Rounding of a closed form of a few operations at 106 bits.
        1e-30
    }

    fn run_within(&self, method: Method, steps: u64, most: f64) -> RunOutcome {
        let mut worst = Worst::within(most);
        let mut evaluations = 0;
        if let Some(mut particle) = Self::particle(method, steps) {
            let every = usize::try_from(steps.div_ceil(MOST_LOOKS))
                .unwrap_or(1)
                .max(1);
            while particle.advance(every) > 0 {
                let t = particle.time(particle.done());
                let x = particle.positions().last().copied().unwrap_or(f64::NAN);
                let error = exact(t).minus(x).abs();
                if !worst.take(t, error, error) {
                    break;
                }
            }
            evaluations = particle.evaluations();
        }
        RunOutcome {
            steps,
            timestep: DURATION / in_f64(steps),
            evaluations,
            error: worst.error,
            end_error: worst.end_error,
            end_effector_error: worst.end_effector_error,
            energy_drift: None,
            diverged: worst.diverged,
        }
    }

    fn replay(&self, method: Method, steps: u64) -> f64 {
        let Some(mut particle) = Self::particle(method, steps) else {
            return f64::NAN;
        };
        particle.advance(usize::MAX);
        particle.positions().last().copied().unwrap_or(f64::NAN)
    }

    fn judged_end(&self, method: Method, steps: u64) -> f64 {
        let mut end = f64::NAN;
        if let Some(mut particle) = Self::particle(method, steps) {
            while particle.advance(7) > 0 {
                end = particle.positions().last().copied().unwrap_or(f64::NAN);
            }
        }
        end
    }

    fn predicted_limit(&self, _: Method) -> Option<f64> {
        None
    }

    fn most_steps(&self) -> u64 {
        MAX_STEPS
    }
}
