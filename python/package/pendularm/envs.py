"""Environments for Gymnasium, which this module's import registers: ``gymnasium.make("Pendularm-v0")``, and for many
arms ``gymnasium.make_vec("Pendularm-v0", num_envs=1024)``; `PendularmReach-v0`,
`PendularmAcrobot-v0` and `PendularmPendubot-v0` likewise.

The vector environments use a `Batch`. Each of their arms is bit-identical to the single environment, and has its own
random stream. Under the seed `s`, arm `i` is the single environment under `s + i`, for any number of arms. They
truncate episodes themselves. An arm is reset in the call after its end, and its action in that call is ignored
(`AutoresetMode.NEXT_STEP`), unless another `autoreset_mode` is given. All returned arrays are fresh. A copied or
unpickled environment goes on with the same bits. A process that is forked while another thread steps an environment
must not use it.
"""

import pickle
import sys
from collections.abc import Mapping, Sequence
from copy import deepcopy
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from ._fields import Floats, Method, as_array, promised, read_seeds, shown, whole_number
from ._native import is_masked
from ._render import METADATA, Frame, Renderer
from ._tasks import TASKS, TIMESTEP, Acrobot, Action, Observation, Pendubot, Reach, SwingUp, Task

__all__ = [
    "PendularmAcrobotEnv",
    "PendularmAcrobotVectorEnv",
    "PendularmEnv",
    "PendularmPendubotEnv",
    "PendularmPendubotVectorEnv",
    "PendularmReachEnv",
    "PendularmReachVectorEnv",
    "PendularmVectorEnv",
    "sb3",
]

if TYPE_CHECKING:
    from .sb3 import Sb3VecEnv


T = TypeVar("T")


def _checked(name: str, actions: Action, space: spaces.Space[Action]) -> Action:
    """Checks the shape of actions. The caller clips their values."""
    if is_masked(actions):
        raise ValueError(f"{name} must have no masked numbers, got {shown(actions)}")
    array = as_array(name, actions)
    if array.shape != space.shape or array.dtype.kind not in "iuf":
        raise ValueError(f"{name} must have the shape {space.shape}, of numbers, got {array.shape} of {array.dtype}")
    return array


def _named(refusal: Exception, theirs: str, ours: str) -> Exception:
    """Renames the field in a refusal of the batch to the caller's name."""
    return type(refusal)(str(refusal).replace(theirs, ours, 1))


def _need_reset(call: str, has_begun: bool) -> None:
    if not has_begun:
        raise gymnasium.error.ResetNeeded(f"{call} needs a reset before it, and another one after close")


class _States:
    """Copies of an environment, and its state as bytes."""

    def __copy__(self: T) -> T:
        # A shallow copy would share the arms.
        return deepcopy(self)

    def get_state(self) -> bytes:
        """The state as bytes, for `set_state`: arms, episodes and random streams. Wrappers have their own."""
        kept = {name: value for name, value in vars(self).items() if name.startswith("_") and name != "_picture"}
        return pickle.dumps((type(self).__name__, kept))

    def set_state(self, state: bytes) -> None:
        """Continues from the state of an environment of this kind, with as many arms and links.

        The bytes are a pickle, which can run any code: use only those that you trust.
        """
        kind, kept = pickle.loads(state)
        ours, theirs = vars(self)["_task"], kept["_task"]
        if kind != type(self).__name__ or (theirs.batch.n_arms, theirs.links) != (ours.batch.n_arms, ours.links):
            arms = f"{theirs.batch.n_arms} arms of {theirs.links} links"
            raise ValueError(f"state must be of the same kind of environment, got a {kind} of {arms}")
        vars(self).update(kept)
        vars(self)["_picture"].task = theirs


class _Single(_States, gymnasium.Env[Observation, Action]):
    metadata: dict[str, Any] = METADATA  # noqa: RUF012
    task_of: ClassVar[type[Task]]

    @promised
    def __init__(
        self,
        links: int = 2,
        method: Method = "rk4",
        timestep: float = TIMESTEP,
        render_mode: str | None = None,
    ) -> None:
        self._task = self.task_of(1, links, 1, method, timestep)
        self._picture = Renderer(render_mode, self._task)
        self._has_begun = False
        self.render_mode = render_mode
        self.observation_space = self._task.observation_space
        self.action_space = self._task.action_space

    @promised
    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        super().reset(seed=seed, options=options)
        self._task.begin([0], [self.np_random])
        self._has_begun = True
        self._picture.update(np.ones(1, np.bool_))
        return self._task.observe()[0], {}

    @promised
    def step(self, action: Action) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        _need_reset("step", self._has_begun)
        action = _checked("action", action, self.action_space)
        try:
            self._task.go_on(action[None])
        except (TypeError, ValueError) as refusal:
            raise _named(refusal, "effort[0]", "action") from None
        self._picture.update(np.zeros(1, np.bool_))
        info = {name: values[0].item() for name, values in self._task.info().items()}
        return self._task.observe()[0], float(self._task.reward()[0]), bool(self._task.lost()[0]), False, info

    def render(self) -> Frame | None:
        _need_reset("render", self._has_begun)
        frames = self._picture.frames()
        return frames[0] if frames else None

    def close(self) -> None:
        self._has_begun = False
        # Gymnasium 1.1 and 1.2 close also an environment whose arguments were refused.
        if hasattr(self, "_picture"):
            self._picture.close()


class _Vector(_States, VectorEnv[Observation, Action, Any]):
    metadata: dict[str, Any] = {**METADATA, "autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012
    task_of: ClassVar[type[Task]]

    @promised
    def __init__(
        self,
        num_envs: int = 1,
        links: int = 2,
        max_episode_steps: int | None = None,
        threads: int | None = None,
        method: Method = "rk4",
        timestep: float = TIMESTEP,
        render_mode: str | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
    ) -> None:
        if max_episode_steps is None:
            max_episode_steps = self.task_of.most_steps
        most_steps = whole_number("max_episode_steps", max_episode_steps)
        if most_steps < 1 and most_steps != -1:
            raise ValueError(f"max_episode_steps must be at least 1, or -1 for no limit, got {shown(most_steps)}")
        try:
            self._task = self.task_of(num_envs, links, threads, method, timestep)
        except (TypeError, ValueError) as refusal:
            raise _named(refusal, "n_arms", "num_envs") from None
        # The largest number means no limit in practice.
        self._most_steps = sys.maxsize if most_steps == -1 else min(most_steps, sys.maxsize)
        try:
            self._mode = AutoresetMode(autoreset_mode)
        except ValueError:
            modes = ", ".join(mode.value for mode in AutoresetMode)
            kind = ValueError if isinstance(autoreset_mode, str) else TypeError
            raise kind(f"autoreset_mode must be one of {modes}, got {shown(autoreset_mode)}") from None
        self.metadata = {**self.metadata, "autoreset_mode": self._mode}
        self._picture = Renderer(render_mode, self._task)
        self.num_envs = num_envs
        self.render_mode = render_mode
        self.single_observation_space = self._task.observation_space
        self.single_action_space = self._task.action_space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._streams: list[tuple[np.random.Generator, int]] = []
        self._has_begun = False
        self._elapsed = np.zeros(num_envs, np.int64)
        self._ended = np.zeros(num_envs, np.bool_)

    @property  # type: ignore[misc]
    def np_random(self) -> tuple[np.random.Generator, ...]:  # type: ignore[override]
        """The arms' random streams."""
        return tuple(stream for stream, _ in self._drawn())

    @property
    def np_random_seed(self) -> tuple[int, ...]:  # type: ignore[override]
        """The seeds of the arms' random streams."""
        return tuple(seed for _, seed in self._drawn())

    def _drawn(self) -> list[tuple[np.random.Generator, int]]:
        """The streams with their seeds, which are random by default."""
        if not self._streams:
            self._streams = [seeding.np_random() for _ in range(self.num_envs)]
        return self._streams

    @promised
    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        mask = np.ones(self.num_envs, np.bool_)
        if not isinstance(options, Mapping | None):
            raise TypeError(f"options must be a dict or None, got {shown(options)}")
        if options and "reset_mask" in options:
            given = options["reset_mask"]
            if is_masked(given):
                raise ValueError(f"reset_mask must have no masked entries, got {shown(given)}")
            mask = as_array("reset_mask", given)
            if mask.dtype != np.bool_ or mask.shape != (self.num_envs,) or not mask.any():
                raise ValueError(f"reset_mask must be ({self.num_envs},) of bool, one of them true, got {mask!r}")
            if not self._has_begun and not mask.all():
                raise ValueError(f"reset_mask must be true of all {self.num_envs} at the first reset, got {mask!r}")
        seeds = read_seeds("seed", seed, self.num_envs)
        if not self._streams:
            self._streams = [seeding.np_random(one) for one in seeds]
        else:
            for arm in np.flatnonzero(mask).tolist():
                if seeds[arm] is not None:
                    self._streams[arm] = seeding.np_random(seeds[arm])
        self._has_begun = True
        self.closed = False
        self._begin(mask)
        self._picture.update(mask)
        return self._task.observe(), {}

    @promised
    def step(
        self, actions: Action
    ) -> tuple[Observation, Floats, NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        _need_reset("step", self._has_begun)
        # Ended arms are stepped with the others without effort, and are then reset.
        again = self._ended
        if self._mode == AutoresetMode.DISABLED and again.any():
            arms = np.flatnonzero(again).tolist()
            raise gymnasium.error.ResetNeeded(f"step needs a reset of the ended arms {arms} before it (reset_mask)")
        actions = np.where(again[:, None], 0, _checked("actions", actions, self.action_space))
        try:
            self._task.go_on(actions)
        except (TypeError, ValueError) as refusal:
            raise _named(refusal, "effort", "actions") from None
        self._elapsed += 1
        rewards, lost, info = self._task.reward(), self._task.lost(), self._infos()
        if again.any():
            self._begin(again)
            rewards[again] = 0.0
            lost[again] = False
        truncated = self._elapsed >= self._most_steps
        self._ended = lost | truncated
        if self._mode != AutoresetMode.SAME_STEP or not self._ended.any():
            self._picture.update(again)
            return self._task.observe(), rewards, lost, truncated, self._infos()
        again, last = self._ended, np.full(self.num_envs, None, object)
        for arm, observation in enumerate(self._task.observe()):
            last[arm] = observation if again[arm] else None
        self._begin(again)
        self._picture.update(again)
        ends = {name: values & again if name.startswith("_") else values for name, values in info.items()}
        infos = {"final_obs": last, "_final_obs": again, "final_info": ends, "_final_info": again.copy(), **self._infos()}
        return self._task.observe(), rewards, lost, truncated, infos

    def _infos(self) -> dict[str, Any]:
        """The infos of all arms, as Gymnasium's vector environments have them: values, and which arms have one."""
        infos: dict[str, Any] = {}
        for name, values in self._task.info().items():
            infos |= {name: values, f"_{name}": np.ones(self.num_envs, np.bool_)}
        return infos

    def render(self) -> tuple[Frame, ...] | None:
        """A frame for each arm."""
        _need_reset("render", self._has_begun)
        return self._picture.frames()

    def close_extras(self, **kwargs: Any) -> None:
        self._has_begun = False
        # Gymnasium 1.1 and 1.2 close also an environment whose arguments were refused.
        if hasattr(self, "_picture"):
            self._picture.close()

    def _begin(self, mask: NDArray[np.bool_]) -> None:
        arms = np.flatnonzero(mask).tolist()
        self._task.begin(arms, [self._streams[arm][0] for arm in arms])
        self._elapsed[mask] = 0
        self._ended = self._ended & ~mask


def sb3(name: str, num_envs: int, **kwargs: Any) -> "Sb3VecEnv":
    """The environment `name` with `num_envs` arms as a `VecEnv` of stable-baselines3, which must be installed.

    `kwargs` are those of the vector environment: `links`, `threads`, `max_episode_steps`, `method`, `timestep` and
    `render_mode`. An arm is reset in the step of its end.
    """
    from .sb3 import Sb3VecEnv

    return Sb3VecEnv(name, num_envs, **kwargs)


def _arguments_and_rendering(target: str) -> str:
    """The end of both tasks' documentation. `target` names the drawn target."""
    return f"""## Arguments
    `links`, 2 or 3. `method`, one of euler, midpoint, verlet and rk4, and its `timestep` in s, 0.05 s divided by a
    whole number: by default rk4 with 0.005 s. `render_mode`, None, human or rgb_array. The vector environment also has
    `threads`, as `Batch` does, `max_episode_steps`, -1 for no limit, and `autoreset_mode`, a
    `gymnasium.vector.AutoresetMode` or its value.

    ## Reset
    `seed` seeds the random stream. The vector environment takes `options={{"reset_mask": mask}}`, (num_envs,) of bool,
    which resets only these arms. There are no other options.

    ## Rendering
    Drawn are the arm, the target (here that is {target}) and the last 2 s of the end effector's path. A frame is
    (480, 480, 3) of uint8; the vector environment returns a tuple with a frame per arm, and a window shows its first
    16 arms. It needs pygame: `pip install "pendularm[render]"`.

    ## Versions
    v0: the first.
    """


_SWING_UP = """The task: a hanging arm swings up and stays there. Each effort is at most half of the effort that
    holds the stretched arm.

    ## Action
    (links,), from -1 to 1: the effort at each joint, for 0.05 s. 1 is half of the effort that holds the stretched arm:
    9.81 and 2.4525 N m for 2 links.

    ## Observation
    | index (2 links) | meaning | bounds | unit |
    | --- | --- | --- | --- |
    | 0, 1 | cosines of the joint angles | -1, 1 | |
    | 2, 3 | sines of the joint angles | -1, 1 | |
    | 4, 5 | joint rates | -25, 25 | rad/s |

    Angles are counter-clockwise, the first from +x, the others from the link before; gravity is along -y.

    ## Reward
    `(1 + y / reach) / 2` with the height y of the end effector: 0 hanging, 1 upright.

    ## Start and end
    Hanging, each angle and rate off by up to 0.1 rad and 0.1 rad/s. Terminated when a joint turns faster than 25
    rad/s; truncated after 200 steps (10 s).

    """ + _arguments_and_rendering("the highest point")

_REACH = """The task: the end effector moves to a target and stays there. Each effort is at most twice the
    effort that holds the stretched arm.

    ## Action
    (links,), from -1 to 1: the effort at each joint, for 0.05 s. 1 is twice the effort that holds the stretched arm:
    39.24 and 9.81 N m for 2 links.

    ## Observation
    | index (2 links) | meaning | bounds | unit |
    | --- | --- | --- | --- |
    | 0, 1 | cosines of the joint angles | -1, 1 | |
    | 2, 3 | sines of the joint angles | -1, 1 | |
    | 4, 5 | joint rates | -25, 25 | rad/s |
    | 6, 7 | target, x and y | -reach, reach | m |
    | 8, 9 | target less end effector, x and y | -2 reach, 2 reach | m |

    Angles are counter-clockwise, the first from +x, the others from the link before; gravity is along -y.

    ## Reward
    `1 - d / (2 reach)` with the distance d of the end effector from the target: 1 there.

    ## Start and end
    At rest in any pose; the target is anywhere within 0.95 of the reach, evenly by area. Terminated when a joint turns
    faster than 25 rad/s; truncated after 100 steps (5 s).

    """ + _arguments_and_rendering("the one observed")


_UNDERACTUATED = """The task: a hanging arm swings up and stays up for 5 s. Only {driven}.

    ## Action
    ({shape},), from -1 to 1: the effort at {joint}, for 0.05 s. 1 is {strength} effort that holds the stretched
    arm: {effort} N m for 2 links. The other motors have an effort limit of 0.

    ## Observation
    | index (2 links) | meaning | bounds | unit |
    | --- | --- | --- | --- |
    | 0, 1 | cosines of the joint angles | -1, 1 | |
    | 2, 3 | sines of the joint angles | -1, 1 | |
    | 4, 5 | joint rates | -25, 25 | rad/s |

    Angles are counter-clockwise, the first from +x, the others from the link before; gravity is along -y.

    ## Reward
    `(1 + y / reach) / 2` with the height y of the end effector: 0 hanging, 1 upright.

    ## Information
    `held` is the time [s] for which the end effector has been above 0.95 of the reach. `is_success` is whether that is at
    least 5 s.

    ## Start and end
    Hanging, each angle and rate off by up to 0.1 rad and 0.1 rad/s. Terminated when a joint turns faster than 25
    rad/s; truncated after 2000 steps (100 s).

    """ + _arguments_and_rendering("the highest point").replace("{", "{{").replace("}", "}}")


class PendularmEnv(_Single):
    __doc__ = _SWING_UP
    task_of = SwingUp


class PendularmVectorEnv(_Vector):
    __doc__ = _SWING_UP
    task_of = SwingUp


class PendularmReachEnv(_Single):
    __doc__ = _REACH
    task_of = Reach


class PendularmReachVectorEnv(_Vector):
    __doc__ = _REACH
    task_of = Reach


_ACROBOT = _UNDERACTUATED.format(
    driven="the elbow, and with 3 links the last joint, is driven", shape="links - 1", joint="each joint but the first",
    strength="four times the", effort="19.62",
)
_PENDUBOT = _UNDERACTUATED.format(
    driven="the shoulder is driven", shape="1", joint="the first joint", strength="the", effort="19.62",
)


class PendularmAcrobotEnv(_Single):
    __doc__ = _ACROBOT
    task_of = Acrobot


class PendularmAcrobotVectorEnv(_Vector):
    __doc__ = _ACROBOT
    task_of = Acrobot


class PendularmPendubotEnv(_Single):
    __doc__ = _PENDUBOT
    task_of = Pendubot


class PendularmPendubotVectorEnv(_Vector):
    __doc__ = _PENDUBOT
    task_of = Pendubot


for _name, _task in TASKS.items():
    gymnasium.register(
        f"{_name}-v0",
        entry_point=f"pendularm.envs:{_name}Env",
        vector_entry_point=f"pendularm.envs:{_name}VectorEnv",
        max_episode_steps=_task.most_steps,
    )
