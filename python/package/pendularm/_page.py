"""The page in one file, with the arm in it: in a notebook, or in a browser."""

from __future__ import annotations

import html
import json
import tempfile
import webbrowser
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from ._fields import numbers, shown, whole_number

Setting = ArrayLike | None

#: The names of the settings in a link of the page.
SETTINGS = (
    "method", "timestep", "gravity", "masses", "lengths", "kp", "ki", "kd", "period", "delay", "controller", "viscous",
    "effort_limit", "anti_windup", "tracking_time", "encoder_step", "velocity_sensor", "control_delay", "setpoint",
    "position", "velocity",
)  # fmt: skip


def _text(name: str, value: Setting) -> str:
    if isinstance(value, bool):
        return "on" if value else "off"
    if value is None and name == "effort_limit":
        return "none"
    if isinstance(value, str):
        return value
    try:
        return ",".join(repr(float(one)) for one in np.atleast_1d(numbers(value)))
    except (TypeError, ValueError, OverflowError) as why:
        kind = TypeError if isinstance(why, TypeError) else ValueError
        raise kind(f"{name} must be a number, a text, or a sequence of numbers, got {shown(value)}") from None


@dataclass(frozen=True)
class Page:
    """The page with its settings. As the last value of a notebook's cell it is shown there."""

    fragment: str  #: What follows ``#`` in the page's address.
    height: int  #: The height in a notebook [pixel].

    @property
    def text(self) -> str:
        """The whole page as HTML."""
        file = Path(__file__).with_name("pendularm.html")
        if not file.is_file():
            raise FileNotFoundError("this wheel was built without the page: `make wheel` includes it where `make page` works")
        # A frame made of text has no address of its own, so the page gets the settings from its first script.
        address = json.dumps("#" + self.fragment).replace("<", "\\u003c")
        before, script, after = file.read_text(encoding="utf-8").partition("<script")
        return f"{before}<script>location.hash = {address};</script>\n{script}{after}"

    def _repr_html_(self) -> str:
        allow = 'sandbox="allow-scripts allow-downloads allow-modals" allow="clipboard-write *; fullscreen *"'
        return f'<iframe {allow} width="100%" height="{self.height}" srcdoc="{html.escape(self.text)}"></iframe>'

    def open(self) -> Path:
        """Opens the page in a browser, from a file in the temporary folder, and returns that file."""
        with tempfile.NamedTemporaryFile("w", prefix="pendularm-", suffix=".html", delete=False, encoding="utf-8") as file:
            file.write(self.text)
        webbrowser.open(Path(file.name).as_uri())
        return Path(file.name)


def page(step: int | str | None = None, *, links: int = 2, height: int = 620, **settings: Setting) -> Page:
    """The page of the runtime with an arm of its own. It needs no server and no network.

    ``step`` opens that step of the course; without it, a setting opens the Workbench. The settings are those of a link that *Share* copies, with
    the same names: ``page(method="euler", timestep=0.01, kp=[900, 200], controller=True)``. `True` and `False` are *on* and *off*, and
    `None` is no limit of the effort. The page offers them, applies them after a click on *Apply*, and says what is wrong with them.

    Raises `TypeError` for an unknown setting or a wrong type, and `ValueError` if ``links`` is not 2 or 3.
    """
    links, height = whole_number("links", links), whole_number("height", height)
    if links not in (2, 3):
        raise ValueError(f"links must be 2 or 3, got {shown(links)}")
    if not isinstance(step, str | None):
        step = whole_number("step", step)
    for name in settings:
        if name not in SETTINGS:
            raise TypeError(f"page() has no setting {name!r}; it has {', '.join(SETTINGS)}")
    parts = ([f"step={step}"] if step is not None else []) + [f"links={links}"]
    parts += [f"{name}={_text(name, value)}" for name, value in settings.items()]
    return Page("&".join(parts), height)
