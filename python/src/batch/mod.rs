//! Many arms at once, with NumPy arrays in and out.
//!
//! The arrays of the arms' values are created once and written in place. Users have read-only views of
//! them. A contiguous, writable array of doubles from the user is read without a copy.
//!
//! **Invariant:** every row of every array has its lane's present values whenever no call is
//! running.

mod given;
mod lanes;
mod pool;
mod stepping;
mod windows;

use std::sync::Mutex;
use std::thread::available_parallelism;

use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods};
use pendularm::math::arm::{Arm, State};
use pendularm::math::limits::Limits;
use pendularm::math::pid::{Gains, Setpoint};
use pendularm::math::sensors::Sensors;
use pendularm::math::simulation::{ControlPeriod, Simulation};
use pyo3::prelude::{Py, PyAny, PyDictMethods, PyResult, Python, pyclass, pymethods};
use pyo3::types::{PyBytes, PyDict};

use crate::arm::{Either, for_either};
use crate::arrays::{ArrayArgument, Rows, read_only};
use crate::fields::{self, Bound, Flag, Held, Object, Whole, refused, renamed, required};
use crate::patience::{Turns, hold};
use crate::robot::{self, limited};
use crate::state;
use given::{chosen, of_arm, read, read_delays, read_names, read_steps};
use lanes::Piece;
use pool::pool;
use windows::Windows;

/// Lane-steps between two checks for signals: some tens of milliseconds of one core.
const STEPS_PER_LOOK: u64 = 250_000;

/// Most arms of one batch, about 500 MB. A batch is fastest with far fewer.
const MOST_ARMS: usize = 1_000_000;

/// Most threads that share the work of one batch.
const MOST_THREADS: usize = 1024;

/// Many arms, advanced in whole steps. Each is bit-identical to a `Simulation`, for any number of threads.
///
/// `position`, `velocity`, `effort`, `time` and `diverged` are read-only arrays, created once and overwritten by every
/// call that changes the arms. Copy values that you need later.
///
/// All arms start as in a fresh runtime. An array
/// argument has one row per arm, (`n_arms`, links), or one for all, (links,) or (1, links). Contiguous, writable doubles are read
/// without a copy. `threads` share the work: by default one per core, or fewer if the system refuses some. With 1 the
/// caller's thread does the work. Calls that change one batch from several threads wait for each other. The arrays
/// can be read meanwhile, and show the present state of each arm. A copied or
/// unpickled batch takes the same steps, bit for bit. A process that is forked while another thread steps the batch must not use it.
#[pyclass(frozen, module = "pendularm")]
#[derive(Debug)]
pub(crate) struct Batch {
    /// The number of links never changes. A lock protects the state, because threads may share a batch.
    own: Either<Mutex<Vec<Simulation<2>>>, Mutex<Vec<Simulation<3>>>>,
    arms: usize,
    threads: usize,
    windows: Windows,
    turns: Turns,
}

/// Changes every arm of a batch, with its row, in this thread's turn.
macro_rules! for_each_arm {
    ($batch:ident, $py:ident, ($row:ident, $one:ident) => $change:block) => {{
        let _turn = $batch.turns.take($py)?;
        for_either!(&$batch.own, lanes => {
            for ($row, $one) in hold($py, lanes).iter_mut().enumerate() $change
        });
        Ok(())
    }};
}

/// Changes arms of a batch in this thread's turn, and updates the users' arrays.
macro_rules! change_shown {
    ($batch:ident, $py:ident, $lanes:ident => $change:block) => {{
        let _turn = $batch.turns.take($py)?;
        for_either!(&$batch.own, lanes => {
            let mut lanes = hold($py, lanes);
            let $lanes = lanes.as_mut_slice();
            $batch.windows.write($py, |shown| {
                $change
                shown.show($lanes);
            })
        })
    }};
}

impl Batch {
    /// A row per arm, or one for all, if there is an argument.
    fn rows<'a>(
        &self,
        given: Option<&'a ArrayArgument<'_>>,
        bound: Bound,
    ) -> PyResult<Option<Rows<'a>>> {
        given
            .map(|given| given.rows(Some(self.arms), self.links(), bound))
            .transpose()
    }

    /// A number per arm, or one for all, if there is an argument.
    fn column<'a>(
        &self,
        given: Option<&'a ArrayArgument<'_>>,
        bound: Bound,
    ) -> PyResult<Option<Rows<'a>>> {
        given
            .map(|given| given.column(self.arms, bound))
            .transpose()
    }
}

#[pymethods]
impl Batch {
    #[new]
    #[pyo3(
        signature = (n_arms, links=Whole::Is(2), *, threads=None),
        text_signature = "(n_arms, links=2, *, threads=None)"
    )]
    fn new(py: Python<'_>, n_arms: Whole, links: Whole, threads: Option<Whole>) -> PyResult<Self> {
        let n_arms = n_arms.up_to(MOST_ARMS, "n_arms")?;
        let threads = threads
            .map(|threads| threads.up_to(MOST_THREADS, "threads"))
            .transpose()?;
        let links = fields::links(links)?;
        let own = match links {
            2 => Either::Two(Mutex::new(lanes::fresh(n_arms)?)),
            _ => Either::Three(Mutex::new(lanes::fresh(n_arms)?)),
        };
        Ok(Self {
            own,
            arms: n_arms,
            threads: threads.unwrap_or_else(|| available_parallelism().map_or(1, usize::from)),
            windows: Windows::of(py, n_arms, links)?,
            turns: Turns::default(),
        })
    }

    /// Takes `steps` steps (1 by default) with every arm, or a whole number per arm, (`n_arms`,). A diverged arm
    /// takes no more. With an `effort` [N m], that effort is applied in these steps, within the limits of the motors, and
    /// the controllers do not run, as in `Simulation.step`. The interpreter's lock is released meanwhile. Ctrl-C ends the
    /// call between two steps, and the effort too.
    #[pyo3(signature = (steps=None, effort=None))]
    fn step(
        &self,
        py: Python<'_>,
        steps: Option<&Object<'_>>,
        effort: Option<&Object<'_>>,
    ) -> PyResult<()> {
        let steps = steps.map_or_else(|| Ok(vec![1]), |steps| read_steps(steps, self.arms))?;
        let effort = read("effort", effort)?;
        let effort = self.rows(effort.as_ref(), Bound::Finite)?;
        let pool = pool(self.threads);
        let arms = u64::try_from(self.arms).unwrap_or(u64::MAX);
        let threads = u64::try_from(self.threads).unwrap_or(1);
        let length = (threads.saturating_mul(STEPS_PER_LOOK) / arms).max(1);
        let first = Piece {
            steps: &steps,
            effort: effort.as_ref(),
            done: 0,
            length,
            is_shared: pool.is_some(),
        };
        let _turn = self.turns.take(py)?;
        for_either!(&self.own, lanes => {
            stepping::take(py, lanes, &self.windows, pool.as_deref(), first)
        })
    }

    /// Adds `effort` [N m] to the controllers' in every step that begins within `duration` [s] from now, a number or
    /// (`n_arms`,), as `Simulation.disturb`.
    fn disturb(&self, py: Python<'_>, effort: &Object<'_>, duration: &Object<'_>) -> PyResult<()> {
        let effort = ArrayArgument::read("effort", effort)?;
        let effort = effort.rows(Some(self.arms), self.links(), Bound::Finite)?;
        let duration = ArrayArgument::read("duration", duration)?;
        let duration = duration.column(self.arms, Bound::Positive)?;
        for_each_arm!(self, py, (row, one) => {
            one.disturb(effort.row(row), duration.number(row));
        })
    }

    /// Returns to the starting pose at rest, at time 0, as `Simulation.reset`: all arms, those of a mask
    /// (`n_arms`,), or those with the given indices.
    #[pyo3(signature = (arms=None))]
    fn reset(&self, py: Python<'_>, arms: Option<&Object<'_>>) -> PyResult<()> {
        let chosen = chosen(arms, self.arms)?;
        change_shown!(self, py, lanes => {
            for &lane in &chosen {
                if let Some(one) = lanes.get_mut(lane) {
                    one.reset();
                }
            }
        })
    }

    /// Sets the states of arms: positions `q` [rad] and rates `qd` [rad/s] (zeros by default), one row per arm or one
    /// for all. `arms` selects them as in `reset`. Clocks and controllers do not change. With the bytes of `get_state`
    /// in place of `q`, everything of all arms is set.
    #[pyo3(
        signature = (q=None, qd=None, arms=None, *, position=None, velocity=None),
        text_signature = "($self, q, qd=None, arms=None)"
    )]
    fn set_state(
        &self,
        py: Python<'_>,
        q: Option<&Object<'_>>,
        qd: Option<&Object<'_>>,
        arms: Option<&Object<'_>>,
        position: Option<&Object<'_>>,
        velocity: Option<&Object<'_>>,
    ) -> PyResult<()> {
        let q = required("q", q, "position", position)?;
        let qd = renamed("qd", qd, "velocity", velocity)?;
        if let Ok(state) = q.cast::<PyBytes>() {
            let further = qd.as_ref().or(arms);
            let _turn = self.turns.take(py)?;
            return for_either!(&self.own, lanes => {
                let read = state::read(state, self.arms, further)?;
                let mut lanes = hold(py, lanes);
                let lanes = &mut *lanes;
                self.windows.write(py, |shown| {
                    *lanes = read;
                    shown.show(lanes);
                })
            });
        }
        let chosen = chosen(arms, self.arms)?;
        let q = ArrayArgument::read("q", &q)?;
        let q = q.rows(Some(chosen.len()), self.links(), Bound::Finite)?;
        let qd = read("qd", qd.as_ref())?;
        let qd = qd
            .as_ref()
            .map(|given| given.rows(Some(chosen.len()), self.links(), Bound::Finite))
            .transpose()?;
        change_shown!(self, py, lanes => {
            for (row, &lane) in chosen.iter().enumerate() {
                if let Some(one) = lanes.get_mut(lane) {
                    one.set_state(State {
                        position: q.row(row),
                        velocity: qd.as_ref().map_or([0.0; _], |qd| qd.row(row)),
                    });
                }
            }
        })
    }

    /// The whole state of all arms as bytes, for `set_state` of a batch with as many arms and links.
    fn get_state<'py>(&self, py: Python<'py>) -> PyResult<Held<'py, PyBytes>> {
        for_either!(&self.own, lanes => state::written(py, &hold(py, lanes)))
    }

    fn __getnewargs_ex__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<((usize, usize), Held<'py, PyDict>)> {
        let given = PyDict::new(py);
        given.set_item("threads", self.threads)?;
        Ok(((self.arms, self.links()), given))
    }

    fn __getstate__<'py>(&self, py: Python<'py>) -> PyResult<Held<'py, PyBytes>> {
        self.get_state(py)
    }

    fn __setstate__(&self, py: Python<'_>, state: &Object<'_>) -> PyResult<()> {
        self.set_state(py, Some(state), None, None, None, None)
    }

    /// Sets the setpoints: positions `q` [rad] and rates `qd` [rad/s] (zeros by default).
    #[pyo3(
        signature = (q=None, qd=None, *, positions=None, velocities=None),
        text_signature = "($self, q, qd=None)"
    )]
    fn set_setpoint(
        &self,
        py: Python<'_>,
        q: Option<&Object<'_>>,
        qd: Option<&Object<'_>>,
        positions: Option<&Object<'_>>,
        velocities: Option<&Object<'_>>,
    ) -> PyResult<()> {
        let q = required("q", q, "positions", positions)?;
        let qd = renamed("qd", qd, "velocities", velocities)?;
        let q = ArrayArgument::read("q", &q)?;
        let q = q.rows(Some(self.arms), self.links(), Bound::Finite)?;
        let qd = read("qd", qd.as_ref())?;
        let qd = self.rows(qd.as_ref(), Bound::Finite)?;
        for_each_arm!(self, py, (row, one) => {
            one.set_setpoint(Setpoint {
                position: q.row(row),
                velocity: qd.as_ref().map_or([0.0; _], |qd| qd.row(row)),
            });
        })
    }

    /// Changes the given gains: `kp` [N m/rad], `ki` [N m/(rad s)], `kd` [N m s/rad]. The integrals do not change.
    #[pyo3(signature = (kp=None, ki=None, kd=None))]
    fn set_gains(
        &self,
        py: Python<'_>,
        kp: Option<&Object<'_>>,
        ki: Option<&Object<'_>>,
        kd: Option<&Object<'_>>,
    ) -> PyResult<()> {
        let (kp, ki, kd) = (read("kp", kp)?, read("ki", ki)?, read("kd", kd)?);
        let kp = self.rows(kp.as_ref(), Bound::NotNegative)?;
        let ki = self.rows(ki.as_ref(), Bound::NotNegative)?;
        let kd = self.rows(kd.as_ref(), Bound::NotNegative)?;
        for_each_arm!(self, py, (row, one) => {
            let present = *one.pid().gains();
            one.set_gains(Gains {
                kp: kp.as_ref().map_or(present.kp, |given| given.row(row)),
                ki: ki.as_ref().map_or(present.ki, |given| given.row(row)),
                kd: kd.as_ref().map_or(present.kd, |given| given.row(row)),
            });
        })
    }

    /// Changes the given parameters: `gravity` [m/s²], a number or (`n_arms`,), `masses` [kg], `lengths` [m], and the
    /// friction `viscous` [N m s/rad].
    #[pyo3(signature = (gravity=None, masses=None, lengths=None, viscous=None))]
    fn set_params(
        &self,
        py: Python<'_>,
        gravity: Option<&Object<'_>>,
        masses: Option<&Object<'_>>,
        lengths: Option<&Object<'_>>,
        viscous: Option<&Object<'_>>,
    ) -> PyResult<()> {
        let (gravity, masses) = (read("gravity", gravity)?, read("masses", masses)?);
        let (lengths, viscous) = (read("lengths", lengths)?, read("viscous", viscous)?);
        let gravity = self.column(gravity.as_ref(), Bound::NotNegative)?;
        let masses = self.rows(masses.as_ref(), Bound::Positive)?;
        let lengths = self.rows(lengths.as_ref(), Bound::Positive)?;
        let viscous = self.rows(viscous.as_ref(), Bound::NotNegative)?;
        for_each_arm!(self, py, (row, one) => {
            let present = one.arm();
            let arm = Arm::new(
                lengths.as_ref().map_or(*present.lengths(), |given| given.row(row)),
                masses.as_ref().map_or(*present.masses(), |given| given.row(row)),
                gravity.as_ref().map_or(present.gravity(), |given| given.number(row)),
            );
            let friction = viscous.as_ref().map_or(*present.viscous(), |given| given.row(row));
            let arm = arm.and_then(|arm| arm.with_friction(friction));
            one.set_arm(arm.map_err(refused)?);
        })
    }

    /// Changes the given values: `method`, a name or one per arm, and `timestep` [s], a number or (`n_arms`,).
    #[pyo3(signature = (method=None, timestep=None))]
    fn set_integrator(
        &self,
        py: Python<'_>,
        method: Option<&Object<'_>>,
        timestep: Option<&Object<'_>>,
    ) -> PyResult<()> {
        let methods = read_names("method", method, self.arms, |name| name.method("method"))?;
        let timestep = read("timestep", timestep)?;
        let timestep = self.column(timestep.as_ref(), Bound::Positive)?;
        for_each_arm!(self, py, (row, one) => {
            let method = methods.as_deref().and_then(|methods| of_arm(methods, row));
            one.set_method(method.unwrap_or(one.method()));
            if let Some(timestep) = &timestep {
                one.set_timestep(timestep.number(row));
            }
        })
    }

    /// Changes the given values: `control_period` [s], a number or (`n_arms`,), 0 for every step, and `control_delay`
    /// [control periods], one whole number or one per arm. As `Simulation.control_period` and `Simulation.control_delay`.
    #[pyo3(signature = (control_period=None, control_delay=None))]
    fn set_control_period(
        &self,
        py: Python<'_>,
        control_period: Option<&Object<'_>>,
        control_delay: Option<&Object<'_>>,
    ) -> PyResult<()> {
        let delays = control_delay
            .map(|delay| read_delays(delay, self.arms))
            .transpose()?;
        let periods = read("control_period", control_period)?;
        let periods = self.column(periods.as_ref(), Bound::NotNegative)?;
        for_each_arm!(self, py, (row, one) => {
            let present = one.control_period();
            let delay = delays.as_deref().and_then(|delays| of_arm(delays, row));
            one.set_control_period(ControlPeriod {
                period: periods.as_ref().map_or(present.period, |periods| periods.number(row)),
                delay: delay.unwrap_or(present.delay),
            });
        })
    }

    /// Changes the given values: `effort_limit` [N m], `inf` for no limit and 0 for no motor; `anti_windup`, a name or one
    /// per arm, and `tracking_time` [s], a number or (`n_arms`,). As in `Simulation`.
    #[pyo3(signature = (effort_limit=None, anti_windup=None, tracking_time=None))]
    fn set_limits(
        &self,
        py: Python<'_>,
        effort_limit: Option<&Object<'_>>,
        anti_windup: Option<&Object<'_>>,
        tracking_time: Option<&Object<'_>>,
    ) -> PyResult<()> {
        let (efforts, times) = (
            read("effort_limit", effort_limit)?,
            read("tracking_time", tracking_time)?,
        );
        let efforts = self.rows(efforts.as_ref(), Bound::Limit)?;
        let times = self.column(times.as_ref(), Bound::Positive)?;
        let forms = read_names("anti_windup", anti_windup, self.arms, robot::anti_windup)?;
        for_each_arm!(self, py, (row, one) => {
            let present = *one.limits();
            let form = forms.as_deref().and_then(|forms| of_arm(forms, row));
            one.set_limits(Limits {
                effort: efforts.as_ref().map_or(present.effort, |given| limited(given.row(row))),
                anti_windup: form.unwrap_or(present.anti_windup),
                tracking_time: times.as_ref().map_or(present.tracking_time, |times| times.number(row)),
            });
        })
    }

    /// Changes the given sensors of the controllers: `encoder_step` [rad], 0 for exact positions, and `velocity_source`,
    /// a name or one per arm. As in `Simulation`.
    #[pyo3(signature = (encoder_step=None, velocity_source=None))]
    fn set_sensors(
        &self,
        py: Python<'_>,
        encoder_step: Option<&Object<'_>>,
        velocity_source: Option<&Object<'_>>,
    ) -> PyResult<()> {
        let steps = read("encoder_step", encoder_step)?;
        let steps = self.rows(steps.as_ref(), Bound::NotNegative)?;
        let choose = robot::velocity_source;
        let sources = read_names("velocity_source", velocity_source, self.arms, choose)?;
        for_each_arm!(self, py, (row, one) => {
            let present = *one.sensors();
            let source = sources.as_deref().and_then(|sources| of_arm(sources, row));
            one.set_sensors(Sensors {
                encoder_step: steps.as_ref().map_or(present.encoder_step, |steps| steps.row(row)),
                velocity: source.unwrap_or(present.velocity),
            });
        })
    }

    /// Turns the controllers on or off. From off to on an integral starts at zero.
    #[pyo3(signature = (data=Flag::Is(true)), text_signature = "($self, data=True)")]
    fn enable(&self, py: Python<'_>, data: Flag) -> PyResult<()> {
        let data = data.read("data")?;
        change_shown!(self, py, lanes => {
            lanes.iter_mut().for_each(|one| one.enable(data));
        })
    }

    /// Number of arms.
    #[getter]
    fn n_arms(&self) -> usize {
        self.arms
    }

    /// Number of links of each arm, 2 or 3.
    #[getter]
    fn links(&self) -> usize {
        self.own.links()
    }

    /// Number of threads that share the work. There are fewer if the system refuses some.
    #[getter]
    fn threads(&self) -> usize {
        self.threads
    }

    /// Overwritten by the next call: copy it to keep it. Joint positions q [rad], (`n_arms`, links), never wrapped.
    #[getter]
    fn position(&self, py: Python<'_>) -> Py<PyAny> {
        self.windows.position.view.clone_ref(py)
    }

    /// Overwritten by the next call: copy it to keep it. Joint rates qd [rad/s], (`n_arms`, links).
    #[getter]
    fn velocity(&self, py: Python<'_>) -> Py<PyAny> {
        self.windows.velocity.view.clone_ref(py)
    }

    /// Overwritten by the next call: copy it to keep it. Efforts of the latest step [N m], (`n_arms`, links).
    #[getter]
    fn effort(&self, py: Python<'_>) -> Py<PyAny> {
        self.windows.effort.view.clone_ref(py)
    }

    /// Overwritten by the next call: copy it to keep it. Simulation times since the reset [s], (`n_arms`,).
    #[getter]
    fn time(&self, py: Python<'_>) -> Py<PyAny> {
        self.windows.time.view.clone_ref(py)
    }

    /// Overwritten by the next call: copy it to keep it. Whether each arm has diverged since its last `reset` or
    /// `set_state`, (`n_arms`,).
    #[getter]
    fn diverged(&self, py: Python<'_>) -> Py<PyAny> {
        self.windows.diverged.view.clone_ref(py)
    }

    /// Kinetic plus potential energy [J], (`n_arms`,), in a fresh array.
    #[getter]
    fn energy<'py>(&self, py: Python<'py>) -> PyResult<Held<'py, PyArray1<f64>>> {
        let energies = for_either!(&self.own, lanes => lanes::energies(&hold(py, lanes))?);
        read_only(energies.into_pyarray(py))
    }

    /// Positions of the end effectors [m], (`n_arms`, 2), in a fresh array.
    #[getter]
    fn end_effector<'py>(&self, py: Python<'py>) -> PyResult<Held<'py, PyArray2<f64>>> {
        let flat = for_either!(&self.own, lanes => lanes::end_effectors(&hold(py, lanes))?);
        read_only(flat.into_pyarray(py))?.reshape([self.arms, 2])
    }

    fn __len__(&self) -> usize {
        self.arms
    }

    fn __repr__(&self) -> String {
        format!(
            "<Batch of {} arms of {} links, {} threads>",
            self.arms,
            self.links(),
            self.threads
        )
    }
}
