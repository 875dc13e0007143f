//! The study's predictions and runs, with the fields of the services `/study/*`.
//!
//! The functions of the package's `study.py` have the signatures and the defaults. They pass their arguments in a dict.
//!
//! **Invariant:** a result has the members of the service's answer, with the same names.

use std::time::{Duration, Instant};

use numpy::{IntoPyArray, PyArray1, PyArrayMethods, ToPyArray};
use pendularm::math::arm::{Arm as Rods, State};
use pendularm::math::pid::{Gains, Setpoint};
use pendularm::study::clocks::{ClockLimits, clock_limits};
use pendularm::study::control_loop::{ControlLoop, no_control};
use pendularm::study::gains::{GainsRequirements, search_gains};
use pendularm::study::motion::{FREE_SECONDS, Motion};
use pendularm::study::paused::Paused;
use pendularm::study::planner::{self, Planned, Task};
use pendularm::study::rollout::{Rollout, RolloutRequest, rollout_by};
use pendularm::study::stability::{Limits, search_limits};
use pendularm::study::tableau::Pair;
use pyo3::prelude::{FromPyObject, PyDictMethods, PyResult, Python, pyfunction};
use pyo3::types::PyDict;

use crate::arm::{Given, for_either, or_default};
use crate::arrays::{joints_or, room};
use crate::fields::{self, Bound, Flag, Held, Name, Object, Real, Whole, read_period, refused};
use crate::floats::Promised;
use crate::gains;
use crate::method::Tableau;
use crate::patience::until_done;

// ---- stability ------------------------------------------------------------------------------------------------------

/// The arguments of [`stability`].
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct StabilityArguments<'py> {
    arm: Option<Given<'py>>,
    integrator: Name,
    gains: Option<Object<'py>>,
    setpoint: Option<Object<'py>>,
    q: Option<Object<'py>>,
    qd: Option<Object<'py>>,
    control_period: Real,
}

#[pyfunction]
#[pyo3(signature = (arguments, /))]
pub(crate) fn stability<'py>(
    py: Python<'py>,
    arguments: StabilityArguments<'py>,
) -> PyResult<Held<'py, PyDict>> {
    let _floats = Promised::begin();
    let method = arguments.integrator.method("integrator")?;
    let period = read_period(arguments.control_period)?;
    for_either!(or_default(arguments.arm)?, arm => {
        let gains = gains::read(arguments.gains.as_ref(), Gains::default())?;
        let setpoint = joints_or("setpoint", arguments.setpoint.as_ref(), Bound::Finite, [0.0; _])?;
        let control = ControlLoop::new(arm, gains, Setpoint::at(setpoint)).with_method(method).with_period(period);
        let start = read_state(("q", arguments.q.as_ref()), ("qd", arguments.qd.as_ref()))?;
        let motion = Motion::ahead(&control, &start);
        let mut search = Paused::new(search_limits(control));
        let limits = until_done(py, || search.advance())?;
        listed_limits(py, &limits, clock_limits(&control), motion, control.is_free())
    })
}

fn listed_limits<'py, const N: usize>(
    py: Python<'py>,
    limits: &Limits<N>,
    clocks: ClockLimits,
    motion: Motion,
    is_free: bool,
) -> PyResult<Held<'py, PyDict>> {
    let motion_limit = Some(motion.timestep).filter(|timestep| timestep.is_finite());
    let critical = limits.critical.map(|critical| {
        let found = PyDict::new(py);
        found.set_item("growth_per_step", critical.growth_per_step)?;
        found.set_item("frequency", critical.frequency)?;
        found.set_item("joint", critical.joint)?;
        PyResult::Ok(found)
    });
    let found = PyDict::new(py);
    found.set_item("control_period_limit", clocks.period)?;
    found.set_item("timestep_limit", clocks.timestep)?;
    found.set_item("timestep_limit_held", limits.held)?;
    found.set_item("timestep_limit_continuous", limits.continuous)?;
    found.set_item("equilibrium", limits.equilibrium.to_pyarray(py))?;
    found.set_item("equilibrium_kind", limits.rest.name())?;
    found.set_item("minimum_over_poses_held", limits.minimum_held)?;
    found.set_item("minimum_over_poses_continuous", limits.minimum_continuous)?;
    found.set_item("minimum_over_poses_bound", limits.bound)?;
    found.set_item("bound_is_proven", limits.bound_is_proven)?;
    found.set_item("certified", limits.certified)?;
    found.set_item(
        "worst_pose",
        limits.worst_pose.map(|pose| pose.to_pyarray(py)),
    )?;
    found.set_item("critical", critical.transpose()?)?;
    found.set_item("timestep_limit_motion", motion_limit)?;
    found.set_item("motion_speed", motion.speed)?;
    found.set_item("advised_timestep", limits.advised_for(&motion))?;
    found.set_item("advised_duration", is_free.then_some(FREE_SECONDS))?;
    Ok(found)
}

fn read_state<const N: usize>(
    (q, position): (&str, Option<&Object<'_>>),
    (qd, velocity): (&str, Option<&Object<'_>>),
) -> PyResult<State<N>> {
    Ok(State {
        position: joints_or(q, position, Bound::Finite, [0.0; N])?,
        velocity: joints_or(qd, velocity, Bound::Finite, [0.0; N])?,
    })
}

// ---- rollout --------------------------------------------------------------------------------------------------------

/// The arguments of [`rollout`].
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct RolloutArguments<'py> {
    arm: Option<Given<'py>>,
    q0: Option<Object<'py>>,
    qdot0: Option<Object<'py>>,
    duration: Real,
    timestep: Real,
    integrator: Name,
    gains: Option<Object<'py>>,
    setpoint: Option<Object<'py>>,
    samples: Whole,
    reference: Flag,
    control_period: Real,
    tableau: Option<Tableau>,
}

#[pyfunction]
#[pyo3(signature = (arguments, /))]
pub(crate) fn rollout<'py>(
    py: Python<'py>,
    arguments: RolloutArguments<'py>,
) -> PyResult<Held<'py, PyDict>> {
    let _floats = Promised::begin();
    let duration = arguments.duration.read("duration")?;
    let timestep = arguments.timestep.read("timestep")?;
    let samples = arguments.samples.read("samples")?;
    let reference = arguments.reference.read("reference")?;
    let period = read_period(arguments.control_period)?;
    let method = arguments.integrator.method("integrator")?;
    let own = arguments.tableau.map(Tableau::read).transpose()?;
    let own = own.map(|given| given.pair().clone());
    for_either!(or_default(arguments.arm)?, arm => {
        run(py, own, RolloutRequest {
            control: read_loop(arm, arguments.gains.as_ref(), arguments.setpoint.as_ref())?
                .with_method(method)
                .with_timestep(timestep)
                .with_period(period),
            start: read_state(("q0", arguments.q0.as_ref()), ("qdot0", arguments.qdot0.as_ref()))?,
            duration,
            samples,
            reference,
        })
    })
}

/// Makes the run alone, which is timed, and repeats it beside its reference, if one is requested.
fn run<const N: usize>(
    py: Python<'_>,
    own: Option<Pair>,
    request: RolloutRequest<N>,
) -> PyResult<Held<'_, PyDict>> {
    let steps = request.steps().map_err(refused)?;
    // More memory than two runs and the answer need. It is checked first, because the run's vectors
    // abort without memory.
    let samples = usize::try_from(request.samples.min(steps + 1)).unwrap_or(usize::MAX);
    drop(room::<[f64; 80]>(samples)?);
    let mut took = Duration::ZERO;
    let alone = RolloutRequest {
        reference: false,
        ..request
    };
    let mut alone = Paused::new(rollout_by(alone, own.clone()));
    let mut made = until_done(py, || {
        let began = Instant::now();
        let made = alone.advance();
        took += began.elapsed();
        made
    })?;
    if request.reference {
        let mut compared = Paused::new(rollout_by(request, own));
        made = until_done(py, || compared.advance())?;
    }
    listed_run(py, &made.map_err(refused)?, took)
}

fn listed_run<'py, const N: usize>(
    py: Python<'py>,
    run: &Rollout<N>,
    took: Duration,
) -> PyResult<Held<'py, PyDict>> {
    let rows = |rows: &[[f64; N]]| {
        rows.as_flattened()
            .to_vec()
            .into_pyarray(py)
            .reshape([rows.len(), N])
    };
    let (error, uncertainty) = run.known(run.deviation.as_ref());
    let (sampling, sampling_uncertainty) = run.known(run.from_ideal.as_ref());
    let divergence = run.divergence.map(|found| (found.step, found.time));
    let found = PyDict::new(py);
    found.set_item("times", run.times.to_pyarray(py))?;
    found.set_item("positions", rows(&run.positions)?)?;
    found.set_item("velocities", rows(&run.velocities)?)?;
    found.set_item("efforts", rows(&run.efforts)?)?;
    found.set_item("energy", run.energy.to_pyarray(py))?;
    found.set_item("evaluations", run.evaluations)?;
    found.set_item("wall_time", took.as_secs_f64())?;
    found.set_item("error", error)?;
    found.set_item("error_uncertainty", uncertainty)?;
    found.set_item("sampling_error", sampling)?;
    found.set_item("sampling_error_uncertainty", sampling_uncertainty)?;
    found.set_item("divergence", divergence)?;
    Ok(found)
}

// ---- gains ----------------------------------------------------------------------------------------------------------

/// The arguments of [`suggest_gains`].
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct GainsArguments<'py> {
    arm: Option<Given<'py>>,
    settling_time: Real,
    margin: Real,
    timestep: Real,
    integrator: Name,
}

#[pyfunction]
#[pyo3(signature = (arguments, /))]
pub(crate) fn suggest_gains<'py>(
    py: Python<'py>,
    arguments: GainsArguments<'py>,
) -> PyResult<Held<'py, PyDict>> {
    let _floats = Promised::begin();
    let settling_time = arguments.settling_time;
    let requirements = GainsRequirements {
        settling_time: fields::number("settling_time", settling_time, Bound::Positive)?,
        margin: fields::number("margin", arguments.margin, Bound::Positive)?,
    };
    if requirements.margin < 1.0 {
        return Err(refused(format_args!(
            "margin must be at least 1, got {}",
            requirements.margin
        )));
    }
    let method = arguments.integrator.method("integrator")?;
    let timestep = fields::number("timestep", arguments.timestep, Bound::Positive)?;
    for_either!(or_default(arguments.arm)?, arm => {
        let control = ControlLoop::free(arm).with_method(method).with_timestep(timestep);
        let mut search = Paused::new(search_gains(control, requirements));
        let found = until_done(py, || search.advance())?.map_err(refused)?;
        let listed = gains::listed(py, &found.gains)?;
        listed.set_item("timestep_limit", found.limit)?;
        listed.set_item("certified", found.certified)?;
        listed.set_item("margin", found.limit.map(|limit| limit / timestep))?;
        listed.set_item("settled_after", found.settled_after)?;
        Ok(listed)
    })
}

// ---- plan -----------------------------------------------------------------------------------------------------------

/// The arguments of [`plan`].
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct PlanArguments<'py> {
    error: Real,
    arm: Option<Given<'py>>,
    duration: Option<Real>,
    q0: Option<Object<'py>>,
    qdot0: Option<Object<'py>>,
    gains: Option<Object<'py>>,
    setpoint: Option<Object<'py>>,
    control_period: Real,
    tableau: Option<Tableau>,
}

#[pyfunction]
#[pyo3(signature = (arguments, /))]
pub(crate) fn plan<'py>(
    py: Python<'py>,
    arguments: PlanArguments<'py>,
) -> PyResult<Held<'py, PyDict>> {
    let _floats = Promised::begin();
    let error = fields::number("error", arguments.error, Bound::Positive)?;
    let period = read_period(arguments.control_period)?;
    let own = arguments.tableau.map(Tableau::read).transpose()?;
    let own = own.map(|given| given.pair().clone());
    for_either!(or_default(arguments.arm)?, arm => {
        let control = read_loop(arm, arguments.gains.as_ref(), arguments.setpoint.as_ref())?.with_period(period);
        let usual = if control.is_free() { 10.0 } else { 4.0 };
        let task = Task {
            control,
            start: read_state(("q0", arguments.q0.as_ref()), ("qdot0", arguments.qdot0.as_ref()))?,
            duration: fields::number("duration", arguments.duration.unwrap_or(Real::Is(usual)), Bound::Positive)?,
            error,
        };
        let mut planning = Paused::new(planner::plan_beside(task, own));
        let planned = until_done(py, || planning.advance())?.map_err(refused)?;
        listed_plan(py, &planned, (!control.is_free()).then_some(period.period))
    })
}

/// The loop with `gains`. Without them the arm is free, and a setpoint would have no effect.
fn read_loop<const N: usize>(
    arm: Rods<N>,
    gains: Option<&Object<'_>>,
    setpoint: Option<&Object<'_>>,
) -> PyResult<ControlLoop<N>> {
    if let (None, Some(setpoint)) = (gains, setpoint) {
        return Err(refused(format_args!(
            "setpoint needs gains, got {}",
            fields::shown(setpoint)
        )));
    }
    let gains = gains.map_or_else(
        || Ok(no_control()),
        |given| gains::read(Some(given), Gains::default()),
    )?;
    let setpoint = Setpoint::at(joints_or("setpoint", setpoint, Bound::Finite, [0.0; N])?);
    Ok(ControlLoop::new(arm, gains, setpoint))
}

fn listed_plan<'py>(
    py: Python<'py>,
    planned: &Planned,
    period: Option<f64>,
) -> PyResult<Held<'py, PyDict>> {
    let best = &planned.best;
    let all = || planned.candidates.iter().rev();
    let found = PyDict::new(py);
    found.set_item("integrator", best.method.name())?;
    found.set_item("timestep", best.timestep)?;
    let given = |period: f64| if period > 0.0 { period } else { best.timestep };
    found.set_item("control_period", period.map(given))?;
    found.set_item(
        "evaluations_per_second",
        f64::from(best.method.evaluations()) / best.timestep,
    )?;
    found.set_item("error", best.error)?;
    found.set_item("error_uncertainty", planned.uncertainty)?;
    let methods: Vec<_> = all().map(|one| one.method.name()).collect();
    let timesteps = PyArray1::from_iter(py, all().map(|one| one.timestep));
    let evaluations = PyArray1::from_iter(py, all().map(|one| one.evaluations));
    let errors = PyArray1::from_iter(py, all().map(|one| one.error));
    found.set_item("methods", methods)?;
    found.set_item("timesteps", timesteps)?;
    found.set_item("evaluations", evaluations)?;
    found.set_item("errors", errors)?;
    let own = planned
        .own
        .map(|own| (own.timestep, own.evaluations, own.error));
    found.set_item("own", own)?;
    Ok(found)
}
