#!/usr/bin/env python3
"""Draws the README's moving picture, docs/swing.svg: two arms with the same controller, at two control periods.

Both runs come from /study/rollout of the built program (PENDULARM, or target/release/pendularm). usage: scripts/swing.py [FILE]
"""

import math
import os
import pathlib
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
os.environ.setdefault("PENDULARM", str(ROOT / "target" / "release" / "pendularm"))
sys.path.insert(0, str(ROOT / "tests" / "browser"))
sys.dont_write_bytecode = True

from runtime import Runtime  # noqa: E402

PERIODS = [0.003, 0.0055]  # s; the stretched default arm is stable up to 4.32 ms
SECONDS, FRAMES = 2.4, 73
START, SETPOINT = [-1.2, 0.6], [0.0, 0.0]
GAINS = {"kp": [1000, 250], "ki": [3000, 750], "kd": [110, 22]}
SIZE, REACH = 320, 66  # paper of one arm, and a link's length on it


def run(runtime, period):
    """The joint positions of a frame each."""
    answer = runtime.call("/study/rollout", q0=START, setpoint=SETPOINT, gains=GAINS, integrator="rk4", timestep=period / 3,
                          control_period=period, duration=SECONDS, samples=FRAMES)
    assert answer["result"], answer
    return answer["values"]["positions"]


def arm(period, positions, left):
    middle = (left + SIZE / 2, SIZE / 2 + 8)
    places = []
    for first, second in positions:
        elbow = (middle[0] + REACH * math.cos(first), middle[1] - REACH * math.sin(first))
        end = (elbow[0] + REACH * math.cos(first + second), elbow[1] - REACH * math.sin(first + second))
        places.append((elbow, end))

    def moving(name, values):
        listed = ";".join(f"{value:.0f}" for value in values)
        return f'<animate attributeName="{name}" values="{listed}" dur="{SECONDS:g}s" repeatCount="indefinite"/>'

    x, y = middle
    ex, ey, tx, ty = ([place[link][axis] for place in places] for link in (0, 1) for axis in (0, 1))
    words = f"corrects every {1000 * period:g} ms"
    return "\n".join([
        f'<text x="{x}" y="24" text-anchor="middle">{words}</text>',
        f'<path class="goal" d="M{x} {y}h{2 * REACH}"/>',
        f'<line class="one" x1="{x}" y1="{y}">{moving("x2", ex)}{moving("y2", ey)}</line>',
        f'<line class="two">{moving("x1", ex)}{moving("y1", ey)}{moving("x2", tx)}{moving("y2", ty)}</line>',
        f'<circle cx="{x}" cy="{y}" r="6"/>',
    ])


def main():
    with Runtime() as runtime:
        arms = [arm(period, run(runtime, period), SIZE * index) for index, period in enumerate(PERIODS)]
    style = ("text{font:15px system-ui,sans-serif;fill:#566375}line{stroke-width:9;stroke-linecap:round}"
             ".one{stroke:#2563c9}.two{stroke:#b3500a}.goal{stroke:#c3ccd8;stroke-width:9;stroke-linecap:round;fill:none}circle{fill:#566375}")
    file = pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs" / "swing.svg"
    file.write_text(f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {2 * SIZE} {SIZE}" width="{2 * SIZE}" height="{SIZE}">'
                    f"<style>{style}</style>\n" + "\n".join(arms) + "\n</svg>\n")
    print(f"swing: {file}, {file.stat().st_size} bytes")


main()
