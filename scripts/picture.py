#!/usr/bin/env python3
"""Takes the picture of the page that the README shows: docs/page.png, or the file OUT. Needs chromium and the built program (PENDULARM).

A lesson is on, the servo holds the arm at its setpoint, and the map of stability is there. The picture is written with a
palette of 256 colours, which a screenshot of flat colours and grey text loses next to nothing by.
"""

import os
import pathlib
import struct
import sys
import zlib

ROOT = pathlib.Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "tests" / "browser"))
sys.dont_write_bytecode = True

from chromium import Browser  # noqa: E402
from png import Image  # noqa: E402
from runtime import Runtime  # noqa: E402

PICTURE = ROOT / (os.environ.get("OUT") or "docs/page.png")
LESSON = "Held or continuous"
LIMIT = 150_000  # bytes: whoever opens the README loads it


def take():
    """The page as a PNG, once the arm is at rest and the map is drawn."""
    with Runtime() as runtime, Browser() as browser:
        page = browser.page(runtime.url)
        page.until("document.querySelector('#connection')?.className === 'pill open'", why="connected")
        page.click("#view-switch")
        page.run(f"[...document.querySelectorAll('button')].find((one) => one.textContent === '{LESSON}').click(); 0")
        page.click("#tab-stability")
        page.until("/^stable$/m.test(document.body.innerText)", why="the limit is known")
        page.until("/The dot is the arm;/.test(document.querySelector('#stability').innerText)", why="the servo is on")
        page.until("document.querySelector('#push-text').textContent.includes('dies away')", why="the push")
        # The map is refined while one looks; it is whole once it has not changed for two seconds.
        page.run("""(() => { let last = '', since = 0; window.rests = () => {
            const now = [...document.querySelectorAll('#stability canvas')].map((one) => one.toDataURL()).join();
            if (now !== last) { last = now; since = performance.now(); }
            return performance.now() - since > 2000; }; return 0; })()""")
        page.until("rests()", why="the map is whole")
        return page.screenshot()


def palette(image):
    """The colours of a picture, at most 256, and the number of each of its colours among them: the commonest as they are, others as
    the nearest of those."""
    counts = {}
    for row in image.rows:
        pixels = zip(*(row[channel::image.channels] for channel in range(3)))
        for pixel in pixels:
            counts[pixel] = counts.get(pixel, 0) + 1
    colors = sorted(counts, key=counts.get, reverse=True)[:256]
    known = {color: number for number, color in enumerate(colors)}

    def nearest(color):
        return min(range(len(colors)), key=lambda n: sum((a - b) ** 2 for a, b in zip(colors[n], color)))

    return colors, {color: known.get(color) if color in known else nearest(color) for color in counts}


def write(image):
    """A picture as a PNG with a palette."""
    colors, numbers = palette(image)
    rows = b"".join(
        b"\0" + bytes(numbers[pixel] for pixel in zip(*(row[channel::image.channels] for channel in range(3))))
        for row in image.rows)

    def chunk(kind, body):
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    head = struct.pack(">IIBBBBB", image.width, image.height, 8, 3, 0, 0, 0)
    flat = b"".join(bytes(color) for color in colors)
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"PLTE", flat) + chunk(b"IDAT", zlib.compress(rows, 9))
            + chunk(b"IEND", b""))


def main():
    source = pathlib.Path(sys.argv[1]).read_bytes() if sys.argv[1:] else take()
    picture = write(Image(source))
    if len(picture) > LIMIT:
        sys.exit(f"picture: {len(picture)} bytes are more than {LIMIT}")
    PICTURE.write_bytes(picture)
    print(f"picture: {PICTURE}, {len(picture)} bytes")


main()
