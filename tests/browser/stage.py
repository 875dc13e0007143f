"""The stage of every browser test: one browser for all, a runtime and a page for each, and a silent console at the end.

Invariant: a test passes only if its page's console said nothing: no exception, no error, no violation of the policy.
"""

import atexit
import base64
import functools
import os
import pathlib
import re
import time
import unittest

import webdriver
from alone import Alone
from chromium import Browser
from runtime import Runtime

ARTEFACTS = pathlib.Path(os.environ.get("ARTEFACTS", "target/browser"))
ARTEFACTS.mkdir(parents=True, exist_ok=True)
# The tested page: that of a server, or the one in a file.
IS_FILE = os.environ.get("FORM") == "file"
# A host name of this machine in this browser only. A page from it is foreign, because its origin is no loopback
# address.
FOREIGN = "elsewhere.example"

NUMBER = "input[type=number]"

# The other browsers have the tests of the file that need neither a telephone's window nor a protocol of Chromium.
BROWSER = os.environ.get("BROWSER", "chromium")


@functools.cache
def browser():
    others = {"firefox": webdriver.Firefox, "webkit": webdriver.WebKit}
    one = others[BROWSER]() if BROWSER in others else Browser(extra=[f"--host-resolver-rules=MAP {FOREIGN} 127.0.0.1"])
    atexit.register(one.__exit__)
    return one


def needs_server(why):
    """A test that the page in a file has no part in, and the reason."""
    return unittest.skipIf(IS_FILE, why)


def needs_chromium(why):
    """A test that uses what only the protocol of Chromium has."""
    return unittest.skipIf(BROWSER != "chromium", why)


def milliseconds(seconds):
    """A time as the page writes it."""
    return f"{float(format(1000 * seconds, '.3g')):g} ms"


class PageTest(unittest.TestCase):
    """A runtime with `links` links and a page on it, connected."""

    links = 2
    view = {}
    course = False  # whether the test is of the course; else the workbench is opened

    def setUp(self):
        self.begin()
        self.page = self.open(**self.view)

    def begin(self):
        """A new arm."""
        self.runtime = Alone(self.links) if IS_FILE else Runtime(links=self.links)
        self.addCleanup(self.runtime.__exit__)

    def visit(self, url, **view):
        """A page at any address."""
        if BROWSER != "chromium" and (view.get("dark") or view.get("density", 1) > 1 or view.get("touch") or view.get("width", 1440) < 900):
            self.skipTest(f"{BROWSER} has a plain window of a desktop only")
        page = browser().page(url, **view)
        self.addCleanup(page.close)
        return page

    def open(self, fragment="", **view):
        if IS_FILE and not self.course:
            # Its course would begin at once.
            fragment = fragment or "#workbench"
        page = self.visit(self.runtime.url + fragment, **view)
        if IS_FILE:
            self.runtime.page = page
        self.addCleanup(lambda: self.assertEqual(page.complaints, []))
        # All pages from disk share one storage; those of servers have one for each port.
        self.addCleanup(lambda: page.run("(() => { try { localStorage.clear(); } catch {} })()"))
        self.addCleanup(lambda: page.screenshot(ARTEFACTS / f"{self.id()}.png"))
        self.connected(page)
        return page

    def connected(self, page=None, links=None):
        page = page or self.page
        page.until("$('#connection')?.className === 'pill open'", why="connected")
        page.until(f"$$('#kp-fields input[type=number]').length === {links or self.links}")
        self.own(page)
        page.until("own('store.js').then(({ state }) => state.answered)", why="all settings are known")
        if not self.course:
            page.run("document.body.dataset.view === 'course' && $('#view-switch').click()")

    def own(self, page):
        """`own(name)` on the page gives its own module, the one that runs."""
        page.run(f"void (window.own = {'async (name) => pendularm[name]' if IS_FILE else '(name) => import(`/${name}`)'})")

    def values(self, service, **args):
        return self.runtime.call(service, **args)["values"]

    frames = "own('surface.js').then(({ count }) => count.frames)"

    def drawn(self, seconds):
        """Frames that the page draws in that time, or a little more."""
        before = self.page.run(self.frames)
        time.sleep(seconds)
        return self.page.run(self.frames) - before

    def tab(self, name):
        """Opens a panel beside the arm."""
        self.page.click(f"#tab-{name}")
        self.page.until(f"!$('#{name}').hidden")

    def keep(self, name, **how):
        """A screenshot on the way; each test keeps one of its end."""
        return self.page.screenshot(ARTEFACTS / f"{name}.png", **how)

    def image(self, selector):
        """A picture of a canvas after the next frame, because the page says something before it draws it."""
        return self.page.decode(base64.b64decode(self.page.run(f"""new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))
            .then(() => $('{selector}').toDataURL().split(',')[1])""")))

    def color(self, name):
        """A colour of the style sheet, in the theme that is on."""
        text = self.page.run(f"(() => {{ const e = $('#probe'); e.style.color = 'var(--{name})'; return getComputedStyle(e).color; }})()")
        return tuple(int(one) for one in re.findall(r"\d+", text)[:3])

    def pause(self):
        """The arm is paused, and the page says so."""
        self.runtime.call("/arm_sim/pause", data=True)
        self.page.until("$('#run-state').textContent === 'paused'")

    def settle(self, positions):
        """The controller holds the arm at `positions`, and then it is paused: a picture that does not change."""
        self.runtime.call("/pid_controller/enable", data=True)
        self.page.run(f"""own('runtime.js').then((arm) => arm.sendSetpoint({positions}))""")
        self.wait(lambda: all(abs(q - p) < 2e-3 for q, p in zip(self.runtime.next("/joint_states")["position"], positions)), "settled")
        self.pause()

    def shake(self):
        """The controller shakes the arm: its timestep is a quarter beyond the limit."""
        self.runtime.call("/arm_sim/set_integrator", timestep=0.0055)
        self.runtime.call("/pid_controller/enable", data=True)
        self.page.until("$('#verdict-pill').textContent === 'beyond the limit'")

    def wait(self, done, why, seconds=60):
        """Waits for something of the runtime."""
        end = time.monotonic() + seconds
        while not done():
            if time.monotonic() > end:
                self.fail(f"after {seconds} s still not: {why}")
            time.sleep(0.05)

    def on_canvas(self, place):
        """Where a place in metres is on the page, in CSS pixels; the same sums as the page's, written again."""
        lengths = self.runtime.call("/arm_sim/set_params")["values"]["lengths"]
        left, top, width, height = self.page.box("#arm")
        scale = min(width, height) / (2 * 1.14 * sum(lengths))
        return left + width / 2 + scale * place[0], top + height / 2 - scale * place[1]
