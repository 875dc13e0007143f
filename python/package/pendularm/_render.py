"""Pictures of the environments' arms, drawn with pygame: arrays of pixels, or a window."""

import math
import os
from types import ModuleType
from typing import Any

import gymnasium
import numpy as np
from gymnasium.error import DependencyNotInstalled
from numpy.typing import NDArray

from ._fields import shown
from ._tasks import STEP, Task

Frame = NDArray[np.uint8]

METADATA: dict[str, Any] = {"render_modes": ["human", "rgb_array"], "render_fps": round(1 / STEP)}

SIZE = 480
"""Width and height of a frame [pixels]."""

MOST_SHOWN = 16
"""Most arms in a window."""

TRAIL = 40
"""Positions of the end effector in a picture: 2 s."""

# A picture is drawn larger and scaled down, so lines are smooth.
SUPERSAMPLING = 2

BACKGROUND = (255, 255, 255)
RIM = (227, 232, 238)
INK = (23, 33, 46)
GOAL = (179, 38, 138)
PATH = (43, 98, 217)
LINKS = [(37, 99, 201), (179, 80, 10), (13, 122, 96)]


def _pygame() -> ModuleType:
    try:
        import pygame
    except ImportError as error:
        raise DependencyNotInstalled('rendering needs pygame: run `pip install "pendularm[render]"`') from error
    return pygame


class Renderer:
    """Draws the arms of a task. It imports pygame only when it draws."""

    def __init__(self, mode: str | None, task: Task) -> None:
        modes = METADATA["render_modes"]
        if mode is not None and not (isinstance(mode, str) and mode in modes):
            kind = ValueError if isinstance(mode, str) else TypeError
            raise kind(f"render_mode must be None, {' or '.join(modes)}, got {shown(mode)}")
        self.mode = mode
        self.task = task
        self.canvas: Any = None
        self.clock: Any = None
        arms = task.batch.n_arms if mode == "rgb_array" else MOST_SHOWN
        self.shown = min(arms, task.batch.n_arms)
        self.trail = np.full((TRAIL if mode else 0, self.shown, 2), np.nan)
        self.updates = 0

    def __getstate__(self) -> dict[str, Any]:
        # A window and its surfaces cannot be copied.
        return {**self.__dict__, "canvas": None, "clock": None}

    def update(self, begun: NDArray[np.bool_]) -> None:
        """Adds the present positions to the trails and updates the window. Arms with a new episode start a new
        trail."""
        if self.mode is None:
            return
        self.trail[:, begun[: self.shown]] = np.nan
        self.trail[self.updates % TRAIL] = self.task.batch.end_effector[: self.shown]
        self.updates += 1
        if self.mode == "human":
            self._show()

    def frames(self) -> tuple[Frame, ...] | None:
        """A frame (height, width, 3) for each arm, in the array mode. A window is already up to date."""
        if self.mode is None:
            gymnasium.logger.warn('render does nothing: make the environment with render_mode="rgb_array" or "human"')
        if self.mode != "rgb_array":
            return None
        pygame = _pygame()
        frames = np.empty((self.shown, SIZE, SIZE, 3), np.uint8)
        for arm, frame in enumerate(frames):
            frame[:] = pygame.surfarray.array3d(self._draw(pygame, arm, SIZE)).swapaxes(0, 1)
        return tuple(frames)

    def close(self) -> None:
        if self.clock is not None:
            _pygame().display.quit()
            self.clock = None

    def _show(self) -> None:
        pygame = _pygame()
        columns = math.ceil(math.sqrt(self.shown))
        side = SIZE if columns == 1 else SIZE // 2
        size = (columns * side, math.ceil(self.shown / columns) * side)
        window = pygame.display.get_surface()
        try:
            if window is None or window.get_size() != size:
                pygame.display.init()
                window = pygame.display.set_mode(size)
                pygame.display.set_caption("pendularm")
                if pygame.display.get_driver() == "offscreen" and "SDL_VIDEODRIVER" not in os.environ:
                    gymnasium.logger.warn('no display found, so that no window appears: see render_mode="rgb_array"')
        except pygame.error as error:
            message = f'render_mode="human" needs a display ({error}): use render_mode="rgb_array"'
            raise gymnasium.error.Error(message) from error
        window.fill(BACKGROUND)
        for arm in range(self.shown):
            row, column = divmod(arm, columns)
            window.blit(self._draw(pygame, arm, side), (column * side, row * side))
        pygame.event.pump()
        self.clock = self.clock or pygame.time.Clock()
        self.clock.tick(METADATA["render_fps"])
        pygame.display.flip()

    def _draw(self, pygame: Any, arm: int, size: int) -> Any:
        """A square surface with this side in pixels and one arm."""
        full = SUPERSAMPLING * size
        if self.canvas is None:
            self.canvas = pygame.Surface((full, full), 0, 32)
        canvas = self.canvas
        unit = full / 100
        centre = np.array([full / 2, full / 2])
        scale = np.array([44 * unit, -44 * unit]) / self.task.reach

        def dot(at: Any, radius: float, colour: tuple[int, ...], width: float = 0.0) -> None:
            pygame.draw.circle(canvas, colour, at, radius * unit, round(width * unit))

        def line(start: Any, end: Any, radius: float, colour: tuple[int, ...]) -> None:
            """A thick line with round ends."""
            length = math.dist(start, end)
            if length > 0:
                across = (end - start)[::-1] * [-1, 1] * (radius * unit / length)
                pygame.draw.polygon(canvas, colour, [start + across, end + across, end - across, start - across])
            dot(start, radius, colour)
            dot(end, radius, colour)

        canvas.fill(BACKGROUND)
        dot(centre, 44, RIM, 0.5)
        trail = np.roll(self.trail[:, arm], -self.updates, axis=0) * scale + centre
        for age, (start, end) in enumerate(zip(trail[:-1], trail[1:], strict=True), 1):
            if not np.isnan(start[0]):
                fade = age / TRAIL
                line(start, end, 0.5, tuple(round(fade * new + (1 - fade) * 255) for new in PATH))
        goal = self.task.goals()[arm] * scale + centre
        dot(goal, 3, GOAL, 0.7)
        dot(goal, 0.9, GOAL)
        angles = np.cumsum(self.task.batch.position[arm])
        reached = np.cumsum(self.task.lengths[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1), axis=0)
        joints = [centre, *(reached * scale + centre)]
        for link, (start, end) in enumerate(zip(joints[:-1], joints[1:], strict=True)):
            line(start, end, 2.2 - 0.4 * link, LINKS[link])
        for joint in joints[:-1]:
            dot(joint, 0.8, BACKGROUND)
        dot(joints[-1], 1.6, INK)
        return pygame.transform.smoothscale(canvas, (size, size))
