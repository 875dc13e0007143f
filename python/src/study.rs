//! The study's predictions and runs, with the fields of the services `/study/*`.
//!
//! The functions of the package's `study.py` have the signatures and the defaults. They pass their arguments in a dict.
//!
//! **Invariant:** a result has the members of the service's answer, with the same names.

use std::ops::Range;
use std::time::{Duration, Instant};

use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods, ToPyArray};
use pendularm::math::arm::{Arm as Rods, State};
use pendularm::math::count::{in_f64, steps_in, whole};
use pendularm::math::pid::{Gains, Setpoint};
use pendularm::study::clocks::{ClockLimits, clock_limits};
use pendularm::study::control_loop::ControlLoop;
use pendularm::study::gains::{GainsRequirements, search_gains};
use pendularm::study::linear::Linear;
use pendularm::study::motion::{FREE_SECONDS, Motion};
use pendularm::study::paused::Paused;
use pendularm::study::planner::{self, Planned, Task};
use pendularm::study::rollout::{Course, MAX_STEPS, Rollout, RolloutRequest, rollout_along};
use pendularm::study::stability::{Limits, search_limits};
use pendularm::study::tableau::Pair;
use pyo3::prelude::{FromPyObject, PyAnyMethods, PyDictMethods, PyResult, Python, pyfunction};
use pyo3::types::PyDict;

use crate::arm::{Given, for_either, or_default};
use crate::arrays::{ArrayArgument, collected, joints, joints_or, room};
use crate::fields::{self, Bound, Flag, Held, Name, Object, Real, Whole, known, or_none, refused};
use crate::floats::Promised;
use crate::gains;
use crate::method::Tableau;
use crate::patience::until_done;
use crate::robot::Robot;

// ---- linearize ------------------------------------------------------------------------------------------------------

/// A square matrix and a matrix, in arrays.
type MatrixPair<'py> = (Held<'py, PyArray2<f64>>, Held<'py, PyArray2<f64>>);

/// The arm near a pose, as a linear system `d(x, v)/dt = A (x, v) + B u`, in a tuple `(A, B)` of shape (2 links, 2 links)
/// and (2 links, links).
///
/// `x` [rad] is the deviation from `q` [rad], (links,), `v` [rad/s] the joint rates, and `u` [N m] the effort beyond
/// `gravity_load(arm, q)`, which holds the arm there. Friction counts, and terms of second order do not.
#[pyfunction]
pub(crate) fn linearize<'py>(
    py: Python<'py>,
    arm: Given<'py>,
    q: Object<'py>,
) -> PyResult<MatrixPair<'py>> {
    let _floats = Promised::begin();
    for_either!(arm.chain()?, arm => {
        let position = joints("q", &q, Bound::Finite)?;
        let links = position.len();
        let plant = Linear::at(&ControlLoop::free(arm), &position, &[false; _]).plant();
        let columns = |range: Range<usize>| {
            let width = range.len();
            let of_row = |row| range.clone().map(move |column| (row, column));
            let entries: Vec<_> = (0..2 * links).flat_map(of_row).map(|at| plant[at]).collect();
            entries.into_pyarray(py).reshape([2 * links, width])
        };
        Ok((columns(0..2 * links)?, columns(2 * links..3 * links)?))
    })
}

// ---- stability ------------------------------------------------------------------------------------------------------

/// The arguments of [`stability`].
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct StabilityArguments<'py> {
    arm: Option<Given<'py>>,
    method: Name,
    gains: Option<Object<'py>>,
    setpoint: Option<Object<'py>>,
    q: Option<Object<'py>>,
    qd: Option<Object<'py>>,
    controller: Flag,
}

#[pyfunction]
#[pyo3(signature = (arguments, /))]
pub(crate) fn stability<'py>(
    py: Python<'py>,
    arguments: Object<'py>,
) -> PyResult<Held<'py, PyDict>> {
    let _floats = Promised::begin();
    let robot: Robot<'_> = arguments.extract()?;
    let arguments: StabilityArguments<'_> = arguments.extract()?;
    let method = arguments.method.method("method")?;
    let law = (
        arguments.controller,
        arguments.gains.as_ref(),
        arguments.setpoint.as_ref(),
    );
    for_either!(or_default(arguments.arm)?, arm => {
        let control = robot.of(read_loop(arm, law)?.with_method(method))?;
        let start = read_state(arguments.q.as_ref(), arguments.qd.as_ref())?;
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
    let critical = limits.critical.map(|critical| {
        let found = PyDict::new(py);
        found.set_item("growth_per_step", critical.growth_per_step)?;
        found.set_item("frequency", critical.frequency)?;
        found.set_item("joint", critical.joint)?;
        PyResult::Ok(found)
    });
    let found = PyDict::new(py);
    found.set_item("control_period_limit", or_none(clocks.period))?;
    found.set_item("timestep_limit", or_none(clocks.timestep))?;
    found.set_item("timestep_limit_held", or_none(limits.held))?;
    found.set_item("timestep_limit_continuous", or_none(limits.continuous))?;
    found.set_item("equilibrium", limits.equilibrium.to_pyarray(py))?;
    found.set_item("equilibrium_kind", limits.rest.name())?;
    let [held, continuous] = [limits.minimum_held, limits.minimum_continuous];
    found.set_item("minimum_over_poses_held", or_none(held))?;
    found.set_item("minimum_over_poses_continuous", or_none(continuous))?;
    found.set_item("minimum_over_poses_bound", known(limits.bound))?;
    found.set_item("bound_is_proven", limits.bound_is_proven)?;
    found.set_item("certified", limits.certified)?;
    found.set_item(
        "worst_pose",
        limits.worst_pose.map(|pose| pose.to_pyarray(py)),
    )?;
    found.set_item("critical", critical.transpose()?)?;
    found.set_item("timestep_limit_motion", motion.timestep)?;
    found.set_item("motion_speed", motion.speed)?;
    let is_limited = limits.advised.is_some() || motion.timestep.is_finite();
    let advised = limits.advised_for(&motion);
    found.set_item(
        "advised_timestep",
        if is_limited {
            known(advised)
        } else {
            or_none(advised)
        },
    )?;
    found.set_item("advised_duration", known(is_free.then_some(FREE_SECONDS)))?;
    Ok(found)
}

fn read_state<const N: usize>(
    q: Option<&Object<'_>>,
    qd: Option<&Object<'_>>,
) -> PyResult<State<N>> {
    Ok(State {
        position: joints_or("q", q, Bound::Finite, [0.0; N])?,
        velocity: joints_or("qd", qd, Bound::Finite, [0.0; N])?,
    })
}

// ---- rollout --------------------------------------------------------------------------------------------------------

/// The arguments of [`rollout`].
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct RolloutArguments<'py> {
    arm: Option<Given<'py>>,
    q: Option<Object<'py>>,
    qd: Option<Object<'py>>,
    duration: Real,
    timestep: Real,
    method: Name,
    gains: Option<Object<'py>>,
    setpoint: Option<Object<'py>>,
    samples: Whole,
    reference: Flag,
    controller: Flag,
    t_eval: Option<Object<'py>>,
    effort: Option<Object<'py>>,
    return_reference: Flag,
    tableau: Option<Tableau>,
}

#[pyfunction]
#[pyo3(signature = (arguments, /))]
pub(crate) fn rollout<'py>(py: Python<'py>, arguments: Object<'py>) -> PyResult<Held<'py, PyDict>> {
    let _floats = Promised::begin();
    let robot: Robot<'_> = arguments.extract()?;
    let arguments: RolloutArguments<'_> = arguments.extract()?;
    let mut duration = arguments.duration.read("duration")?;
    let timestep = arguments.timestep.read("timestep")?;
    let mut samples = arguments.samples.read("samples")?;
    let keeps_reference = arguments.return_reference.read("return_reference")?;
    let reference = arguments.reference.read("reference")? || keeps_reference;
    let mut sampled = vec![];
    if let Some(times) = &arguments.t_eval {
        let times = ArrayArgument::read("t_eval", times)?;
        (sampled, duration) = read_times(times.list(Bound::NotNegative)?, timestep)?;
        samples = u64::try_from(sampled.len()).unwrap_or(u64::MAX).max(2);
    }
    let efforts = arguments.effort.as_ref();
    let efforts = efforts.map(|effort| ArrayArgument::read("effort", effort));
    let efforts = efforts.transpose()?;
    let law = (
        arguments.controller,
        arguments.gains.as_ref(),
        arguments.setpoint.as_ref(),
    );
    let method = arguments.method.method("method")?;
    let own = read_own(arguments.tableau)?;
    for_either!(or_default(arguments.arm)?, arm => {
        let course = Course {
            sampled,
            own: own.clone(),
            efforts: efforts.as_ref().map_or(Ok(vec![]), ArrayArgument::each)?,
            keeps_reference,
        };
        run(py, course, RolloutRequest {
            control: robot.of(read_loop(arm, law)?.with_method(method).with_timestep(timestep))?,
            start: read_state(arguments.q.as_ref(), arguments.qd.as_ref())?,
            duration,
            samples,
            reference,
        })
    })
}

/// Makes the run alone, which is timed, and repeats it beside its reference, if one is requested.
fn run<const N: usize>(
    py: Python<'_>,
    course: Course<N>,
    request: RolloutRequest<N>,
) -> PyResult<Held<'_, PyDict>> {
    let steps = request.steps().map_err(refused)?;
    // More memory than two runs and the answer need. It is checked first, because the run's vectors
    // abort without memory.
    let samples = usize::try_from(request.samples.min(steps + 1)).unwrap_or(usize::MAX);
    let samples = samples.max(course.sampled.len()) + course.efforts.len();
    drop(room::<[f64; 80]>(samples)?);
    let mut took = Duration::ZERO;
    let own = RolloutRequest {
        reference: false,
        ..request
    };
    let mut alone = Paused::new(rollout_along(own, course.clone()));
    let mut made = until_done(py, || {
        let began = Instant::now();
        let made = alone.advance();
        took += began.elapsed();
        made
    })?;
    if request.reference {
        let mut compared = Paused::new(rollout_along(request, course));
        made = until_done(py, || compared.advance())?;
    }
    listed_run(py, &made.map_err(refused)?, took)
}

/// The steps nearest to some times [s], which do not decrease, and the last time.
fn read_times(times: &[f64], timestep: f64) -> PyResult<(Vec<u64>, f64)> {
    let pairs = times.iter().zip(times.iter().skip(1));
    if let Some((before, after)) = pairs.into_iter().find(|(before, after)| after < before) {
        return Err(refused(format_args!(
            "t_eval must not decrease, got {after} after {before}"
        )));
    }
    let last = times.last().copied();
    let last = last.ok_or_else(|| refused("t_eval must have at least one time, got none"))?;
    let most = in_f64(MAX_STEPS);
    // Wrong timesteps, and too many steps, are refused by the run.
    let steps = times
        .iter()
        .map(|&time| steps_in(time, timestep).round().clamp(0.0, most));
    Ok((collected(times.len(), steps.map(whole))?, last))
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
    found.set_item("error", known(error))?;
    found.set_item("error_uncertainty", known(uncertainty))?;
    found.set_item("sampling_error", known(sampling))?;
    found.set_item("sampling_error_uncertainty", known(sampling_uncertainty))?;
    found.set_item("divergence", divergence)?;
    let states = run.reference.iter();
    let (positions, velocities): (Vec<_>, Vec<_>) =
        states.map(|state| (state.position, state.velocity)).unzip();
    let given = (!positions.is_empty()).then_some(());
    let positions = given.map(|()| rows(&positions)).transpose()?;
    let velocities = given.map(|()| rows(&velocities)).transpose()?;
    found.set_item("reference_positions", positions)?;
    found.set_item("reference_velocities", velocities)?;
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
    method: Name,
}

#[pyfunction]
#[pyo3(signature = (arguments, /))]
pub(crate) fn suggest_gains<'py>(
    py: Python<'py>,
    arguments: Object<'py>,
) -> PyResult<Held<'py, PyDict>> {
    let _floats = Promised::begin();
    let robot: Robot<'_> = arguments.extract()?;
    let arguments: GainsArguments<'_> = arguments.extract()?;
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
    let method = arguments.method.method("method")?;
    let timestep = fields::number("timestep", arguments.timestep, Bound::Positive)?;
    for_either!(or_default(arguments.arm)?, arm => {
        let control = robot.of(ControlLoop::free(arm).with_method(method).with_timestep(timestep))?;
        let mut search = Paused::new(search_gains(control, requirements));
        let found = until_done(py, || search.advance())?.map_err(refused)?;
        let listed = gains::listed(py, &found.gains)?;
        listed.set_item("timestep_limit", or_none(found.limit))?;
        listed.set_item("certified", found.certified)?;
        listed.set_item("margin", or_none(found.limit) / timestep)?;
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
    q: Option<Object<'py>>,
    qd: Option<Object<'py>>,
    gains: Option<Object<'py>>,
    setpoint: Option<Object<'py>>,
    controller: Flag,
    tableau: Option<Tableau>,
}

#[pyfunction]
#[pyo3(signature = (arguments, /))]
pub(crate) fn plan<'py>(py: Python<'py>, arguments: Object<'py>) -> PyResult<Held<'py, PyDict>> {
    let _floats = Promised::begin();
    let robot: Robot<'_> = arguments.extract()?;
    let arguments: PlanArguments<'_> = arguments.extract()?;
    let error = fields::number("error", arguments.error, Bound::Positive)?;
    let law = (
        arguments.controller,
        arguments.gains.as_ref(),
        arguments.setpoint.as_ref(),
    );
    let own = read_own(arguments.tableau)?;
    for_either!(or_default(arguments.arm)?, arm => {
        let control = robot.of(read_loop(arm, law)?)?;
        let period = control.period;
        let usual = if control.is_free() { 10.0 } else { 4.0 };
        let task = Task {
            control,
            start: read_state(arguments.q.as_ref(), arguments.qd.as_ref())?,
            duration: fields::number("duration", arguments.duration.unwrap_or(Real::Is(usual)), Bound::Positive)?,
            error,
        };
        let mut planning = Paused::new(planner::plan_beside(task, own));
        let planned = until_done(py, || planning.advance())?.map_err(refused)?;
        listed_plan(py, &planned, (!control.is_free()).then_some(period.period))
    })
}

/// Whether the controller is on, its gains and its setpoint.
type Law<'a, 'py> = (Flag, Option<&'a Object<'py>>, Option<&'a Object<'py>>);

/// A method of one's own, if there is one.
fn read_own(tableau: Option<Tableau>) -> PyResult<Option<Pair>> {
    let own = tableau.map(Tableau::read).transpose()?;
    Ok(own.map(|given| given.pair().clone()))
}

/// The loop with these gains, by default those of a new arm. Without a controller the arm is free, and gains and
/// setpoint would have no effect.
fn read_loop<const N: usize>(
    arm: Rods<N>,
    (controller, gains, setpoint): Law<'_, '_>,
) -> PyResult<ControlLoop<N>> {
    if !controller.read("controller")? {
        for (name, given) in [("gains", gains), ("setpoint", setpoint)] {
            if let Some(given) = given {
                return Err(refused(format_args!(
                    "{name} needs the controller, got {}",
                    fields::shown(given)
                )));
            }
        }
        return Ok(ControlLoop::free(arm));
    }
    let gains = gains::read(gains, Gains::default())?;
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
    found.set_item("method", best.method.name())?;
    found.set_item("timestep", best.timestep)?;
    let given = |period: f64| if period > 0.0 { period } else { best.timestep };
    found.set_item("control_period", known(period.map(given)))?;
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
