#!/usr/bin/env python3
"""Opens the page in one file from disk, in Chromium, and uses it: file.py pendularm.html.

It is opened by itself, and as a notebook or a learning system shows it: in a frame that may run scripts and nothing else.
"""

import html
import pathlib
import sys
import tempfile
import time

from chromium import Browser

FRAME = '<iframe sandbox="allow-scripts" style="width: 1300px; height: 850px" srcdoc="{}"></iframe>'
PATIENCE = 30


def main(file):
    page_file = pathlib.Path(file).resolve()
    with Browser() as browser:
        page = browser.page(f"{page_file.as_uri()}#step=4")
        page.until("document.body.innerText.includes('A better method?')", why="the step that the link names")
        page.until("!document.querySelector('#course-start').disabled", why="an arm in the page")
        page.click("#course-start")
        page.until("document.querySelector('#course-figure').textContent === '5.5 of 4.3 ms'", why="the limit, by the kernel")
        assert not page.complaints, page.complaints
        page.close()
        with tempfile.TemporaryDirectory() as folder:
            around = pathlib.Path(folder) / "around.html"
            around.write_text(FRAME.format(html.escape(page_file.read_text(encoding="utf-8"))), encoding="utf-8")
            framed = browser.page(around.as_uri())
            before, until = framed.screenshot(), time.monotonic() + PATIENCE
            moved = 0
            # Loading changes the picture a few times; a clock goes on changing it.
            while moved < 10 and time.monotonic() < until:
                time.sleep(0.5)
                after = framed.screenshot()
                moved, before = moved + (after != before), after
            assert moved == 10, "nothing moves in the frame"
            assert not framed.complaints, framed.complaints


if __name__ == "__main__":
    main(sys.argv[1])
