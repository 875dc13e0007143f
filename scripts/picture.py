#!/usr/bin/env python3
"""Takes the picture of the page that the README shows: docs/page.png, or the file OUT. Needs chromium and the built program (PENDULARM).

The controller holds the arm at its setpoint, and the map of stability is shown. The picture has a palette of 256
colours, which is enough for a screenshot of flat colours and grey text.
"""

import collections
import os
import pathlib
import struct
import sys
import zlib

ROOT = pathlib.Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "tests" / "browser"))
sys.dont_write_bytecode = True

from chromium import Browser  # noqa: E402
from runtime import Runtime  # noqa: E402

PICTURE = ROOT / (os.environ.get("OUT") or "docs/page.png")
LIMIT = 150_000  # bytes, because every reader of the README loads it


def take():
    """The page's picture, once the arm is at rest and the map is drawn."""
    with Runtime() as runtime, Browser() as browser:
        page = browser.page(runtime.url)
        page.until("document.querySelector('#connection')?.className === 'pill open'", why="connected")
        page.click("#view-switch")
        runtime.call("/arm_sim/set_integrator", timestep=0.003)
        runtime.call("/pid_controller/enable", data=True)
        page.run("import('/runtime.js').then((arm) => arm.sendSetpoint([0.9, -1.3]))")
        page.click("#tab-stability")
        page.until("/^stable$/m.test(document.body.innerText)", why="the limit is known")
        page.until("/The dot is the arm\\./.test(document.querySelector('#stability').innerText)", why="the controller is on")
        page.until("document.querySelector('#push-text').textContent.includes('push shrinks')", why="the push")
        # The map is refined over time. It is complete once it has not changed for two seconds.
        page.run("""(() => { let last = '', since = 0; window.rests = () => {
            const now = [...document.querySelectorAll('#stability canvas')].map((one) => one.toDataURL()).join();
            if (now !== last) { last = now; since = performance.now(); }
            return performance.now() - since > 2000; }; return 0; })()""")
        page.until("rests()", why="the map is whole")
        return page.decode(page.screenshot())


def palette(image):
    """The palette of a picture, at most 256 colours, and the index of each of its colours: the most frequent colours
    unchanged, others as the nearest of those."""
    counts = collections.Counter(image.pixels())
    colors = [color for color, _ in counts.most_common(256)]
    known = {color: number for number, color in enumerate(colors)}

    def nearest(color):
        return min(range(len(colors)), key=lambda n: sum((a - b) ** 2 for a, b in zip(colors[n], color)))

    return colors, {color: known.get(color) if color in known else nearest(color) for color in counts}


def write(image):
    """A picture as a PNG with a palette."""
    colors, numbers = palette(image)
    flat = bytes(numbers[pixel] for pixel in image.pixels())
    rows = b"".join(b"\0" + flat[start:start + image.width] for start in range(0, len(flat), image.width))

    def chunk(kind, body):
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    head = struct.pack(">IIBBBBB", image.width, image.height, 8, 3, 0, 0, 0)
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"PLTE", b"".join(map(bytes, colors))) + chunk(b"IDAT", zlib.compress(rows, 9))
            + chunk(b"IEND", b""))


def main():
    picture = write(take())
    if len(picture) > LIMIT:
        sys.exit(f"picture: {len(picture)} bytes are more than {LIMIT}")
    PICTURE.write_bytes(picture)
    print(f"picture: {PICTURE}, {len(picture)} bytes")


main()
