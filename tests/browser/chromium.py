"""Headless Chromium, driven over the DevTools protocol through a pair of pipes; Python's standard library only.

`--remote-debugging-pipe` needs neither a port nor ChromeDriver nor a WebSocket: frames are JSON objects that end with NUL, on
the browser's file descriptors 3 (commands) and 4 (answers and events).

Invariant: the browser that was started is the one that is stopped, and its profile is deleted with it.
"""

import base64
import collections
import json
import os
import queue
import shutil
import signal
import subprocess
import tempfile
import threading
import time

FLAGS = [
    "--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--hide-scrollbars", "--force-color-profile=srgb",
    "--enable-precise-memory-info", "--js-flags=--expose-gc", "--remote-debugging-pipe",
]
ANSWER_SECONDS = 60
# Elements by a selector, as in a browser's console.
CONSOLE = "globalThis.$ = (selector) => document.querySelector(selector), globalThis.$$ = (selector) => [...document.querySelectorAll(selector)];"
# Width, height and RGBA of a PNG in base64, the latter in base64 too.
DECODE = """(async () => {
  const bytes = Uint8Array.from(atob("%s"), (one) => one.charCodeAt(0));
  const picture = await createImageBitmap(new Blob([bytes], { type: "image/png" }));
  const { width, height } = picture;
  const context = new OffscreenCanvas(width, height).getContext("2d");
  context.drawImage(picture, 0, 0);
  const { data } = context.getImageData(0, 0, width, height);
  let text = "";
  for (let i = 0; i < data.length; i += 1 << 15) text += String.fromCharCode(...data.subarray(i, i + (1 << 15)));
  return [width, height, btoa(text)];
})()"""


class BrowserError(Exception):
    """The browser answered with an error, or not at all."""


def close(one, other, tolerance=24):
    """Whether two colors are alike."""
    return all(abs(a - b) <= tolerance for a, b in zip(one, other))


class Image:
    """A picture that the browser has decoded; `image[x, y]` is (red, green, blue)."""

    def __init__(self, width, height, data):
        self.width, self.height, self.data = width, height, base64.b64decode(data)

    def __getitem__(self, place):
        at = 4 * (place[1] * self.width + place[0])
        return tuple(self.data[at:at + 3])

    def pixels(self):
        """All colors, row by row."""
        return zip(*(self.data[channel::4] for channel in range(3)))

    def count(self, color, tolerance=24):
        """How many pixels are `color`, each channel within `tolerance`."""
        return sum(number for one, number in collections.Counter(self.pixels()).items() if close(one, color, tolerance))


class Browser:
    """One Chromium with an empty profile; use it with `with`."""

    def __init__(self, binary="chromium", extra=()):
        self.profile = tempfile.mkdtemp(prefix="pendularm-browser-")
        commands, to_browser = os.pipe()
        from_browser, answers = os.pipe()
        ends = f'exec "$@" 3<&{commands} 4>&{answers}'
        self.process = subprocess.Popen(
            ["bash", "-c", ends, "bash", binary, *FLAGS, *extra, f"--user-data-dir={self.profile}", "about:blank"],
            pass_fds=(commands, answers), start_new_session=True,
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )
        os.close(commands)
        os.close(answers)
        self._to = os.fdopen(to_browser, "wb", buffering=0)
        self._from = os.fdopen(from_browser, "rb")
        self._next = 1
        self._answers = {}
        self._arrived = threading.Condition()
        self._pages = {}
        threading.Thread(target=self._read, daemon=True).start()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        try:
            self.send("Browser.close")
        except (BrowserError, OSError):
            pass
        try:
            self.process.wait(10)
        except subprocess.TimeoutExpired:
            os.killpg(self.process.pid, signal.SIGKILL)  # its own process group: only the browser and its children
            self.process.wait()
        shutil.rmtree(self.profile, ignore_errors=True)

    def _read(self):
        rest = b""
        while chunk := self._from.read1(1 << 20):
            *frames, rest = (rest + chunk).split(b"\0")
            for frame in frames:
                message = json.loads(frame)
                with self._arrived:
                    if "id" in message:
                        self._answers[message["id"]] = message
                    elif page := self._pages.get(message.get("sessionId")):
                        page.event(message["method"], message["params"])
                    self._arrived.notify_all()

    def send(self, method, params=None, session=None):
        """Sends a command and waits for its result."""
        with self._arrived:
            number, self._next = self._next, self._next + 1
        frame = {"id": number, "method": method, "params": params or {}}
        if session:
            frame["sessionId"] = session
        self._to.write(json.dumps(frame).encode() + b"\0")
        with self._arrived:
            if not self._arrived.wait_for(lambda: number in self._answers, ANSWER_SECONDS):
                raise BrowserError(f"{method}: no answer within {ANSWER_SECONDS} s")
            answer = self._answers.pop(number)
        if "error" in answer:
            raise BrowserError(f"{method}: {answer['error']}")
        return answer["result"]

    def page(self, url, width=1440, height=900, density=1, dark=False, touch=False):
        """A new page, already loaded."""
        return Page(self, url, width, height, density, dark, touch)


class Page:
    """A tab, and everything that its console said."""

    def __init__(self, browser, url, width, height, density, dark, touch):
        self.browser = browser
        self.width = width  # of the window [CSS pixels]; the page's own `innerWidth` grows on a phone with what is too wide
        self.complaints = []  # errors of the console, exceptions, violations of the policy
        self.expect_network_errors = False
        self.told = 0  # messages that came over its WebSocket
        self._loaded = queue.Queue()
        target = browser.send("Target.createTarget", {"url": "about:blank"})["targetId"]
        self.target = target
        self.session = browser.send("Target.attachToTarget", {"targetId": target, "flatten": True})["sessionId"]
        browser._pages[self.session] = self
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.send(f"{domain}.enable")
        self.before(CONSOLE)
        self.send("Emulation.setDeviceMetricsOverride", {"width": width, "height": height, "deviceScaleFactor": density, "mobile": touch})
        self.send("Emulation.setEmulatedMedia", {"features": [{"name": "prefers-color-scheme", "value": "dark" if dark else "light"}]})
        if touch:
            self.send("Emulation.setTouchEmulationEnabled", {"enabled": True})
        self.go(url)

    def send(self, method, params=None):
        return self.browser.send(method, params, self.session)

    def before(self, script):
        """Runs a script in every later document of the page, before its own."""
        self.send("Page.addScriptToEvaluateOnNewDocument", {"source": script})

    def event(self, method, params):
        if method == "Runtime.exceptionThrown":
            details = params["exceptionDetails"]
            self.complaints.append(details.get("exception", {}).get("description") or details["text"])
        elif method == "Runtime.consoleAPICalled" and params["type"] in ("error", "warning", "assert"):
            self.complaints.append(" ".join(str(one.get("value", one.get("description"))) for one in params["args"]))
        elif method == "Log.entryAdded" and params["entry"]["level"] in ("error", "warning"):
            entry = params["entry"]
            if not (self.expect_network_errors and "net::ERR_" in entry["text"]):
                self.complaints.append(f"{entry['source']}: {entry['text']} {entry.get('url', '')}")
        elif method == "Network.webSocketFrameReceived":
            self.told += 1
        elif method == "Page.loadEventFired":
            self._loaded.put(True)

    def go(self, url):
        while not self._loaded.empty():
            self._loaded.get()
        result = self.send("Page.navigate", {"url": url})
        if "errorText" in result:
            raise BrowserError(f"{url}: {result['errorText']}")
        if "loaderId" in result:
            self._loaded.get(timeout=ANSWER_SECONDS)

    def close(self):
        self.browser.send("Target.closeTarget", {"targetId": self.target})

    def run(self, expression):
        """The value of an expression in the page; a promise is waited for."""
        answer = self.send("Runtime.evaluate", {"expression": expression, "awaitPromise": True, "returnByValue": True, "userGesture": True})
        if "exceptionDetails" in answer:
            details = answer["exceptionDetails"]
            raise BrowserError(details.get("exception", {}).get("description") or details["text"])
        return answer["result"].get("value")

    def until(self, expression, seconds=60, why=""):
        """Waits until the expression is true, and gives its value."""
        end = time.monotonic() + seconds
        while not (value := self.run_unless_it_leaves(expression)):
            if time.monotonic() > end:
                raise AssertionError(f"after {seconds} s still not: {why or expression}")
            time.sleep(0.05)
        return value

    def run_unless_it_leaves(self, expression):
        """The expression's value; none if the page goes elsewhere before it has answered."""
        try:
            return self.run(expression)
        except BrowserError as error:
            if any(one in str(error) for one in ("navigated", "context was destroyed", "unload", "browsing context")):
                return None
            raise

    def text(self, selector):
        return self.run(f"$({json.dumps(selector)}).textContent")

    def choose(self, selector, value):
        """Chooses an entry of a list."""
        self.run(f"(() => {{ const one = $('{selector}'); one.value = '{value}'; one.dispatchEvent(new Event('change')); }})()")

    def press(self, place, text):
        """Presses the button with this text."""
        self.run(f"$$('{place} button').find((one) => one.textContent === {json.dumps(text)}).click()")

    def reloads(self, act, shown="true"):
        """Waits until the page is loaded anew because of an action, and something is true in it."""
        self.run(f"window.old = 1, {act}")
        self.until(f"window.old === undefined && {shown}", why=f"the page anew, {shown}")

    def click(self, selector):
        """A click by the mouse, at the middle of the element, wherever it had to be scrolled to."""
        x, y = self.place(selector)
        self.mouse("mousePressed", x, y)
        self.mouse("mouseReleased", x, y)

    def box(self, selector):
        """Left, top, width and height of the element in the window [CSS pixels], in its middle and once it has come to rest."""
        before = None
        for _ in range(50):
            box = self.run(f"(() => {{ const e = $({json.dumps(selector)}); e.scrollIntoView({{block: 'center'}});"
                           " const b = e.getBoundingClientRect(); return [b.x, b.y, b.width, b.height]; })()")
            if box == before:
                return box
            before = box
            time.sleep(0.05)
        raise AssertionError(f"{selector} does not come to rest")

    def place(self, selector):
        """The middle of the element."""
        left, top, width, height = self.box(selector)
        return left + width / 2, top + height / 2

    def mouse(self, kind, x, y, shift=False):
        held = kind != "mouseReleased"
        self.send("Input.dispatchMouseEvent", {
            "type": kind, "x": x, "y": y, "button": "left", "buttons": 1 if held else 0, "clickCount": 1, "modifiers": 8 if shift else 0,
        })

    def drag(self, start, end, steps=12, shift=False):
        """Presses at `start`, moves to `end` in `steps`, and lets go; both in CSS pixels."""
        self.mouse("mousePressed", *start, shift)
        for k in range(1, steps + 1):
            part = k / steps
            self.mouse("mouseMoved", start[0] + part * (end[0] - start[0]), start[1] + part * (end[1] - start[1]), shift)
            time.sleep(0.03)
        self.mouse("mouseReleased", *end, shift)

    def key(self, key, shift=False):
        """One key, as typed."""
        text = {"Enter": "\r", " ": " "}.get(key, key if len(key) == 1 else None)
        down = {"type": "keyDown" if text else "rawKeyDown", "key": key, "modifiers": 8 if shift else 0}
        if text:
            down["text"] = text
        if code := {"Enter": 13, "Tab": 9, "Escape": 27, "ArrowUp": 38, "ArrowDown": 40, "ArrowLeft": 37, "ArrowRight": 39, " ": 32}.get(key):
            down["windowsVirtualKeyCode"] = code
        self.send("Input.dispatchKeyEvent", down)
        self.send("Input.dispatchKeyEvent", {**down, "type": "keyUp"})

    def fill(self, selector, text):
        """Types into a field in place of what it holds, and presses Enter."""
        self.run(f"(() => {{ const e = $({json.dumps(selector)}); e.scrollIntoView({{block: 'center'}}); e.focus(); e.select(); }})()")
        self.insert(text)
        self.key("Enter")

    def insert(self, text):
        self.send("Input.insertText", {"text": text})

    def decode(self, png):
        return Image(*self.run(DECODE % base64.b64encode(png).decode()))

    def screenshot(self, path=None, whole=False):
        """A PNG of the window or the whole page."""
        params = {"format": "png", "captureBeyondViewport": whole}
        if whole:
            size = self.send("Page.getLayoutMetrics")["cssContentSize"]
            params["clip"] = {"x": 0, "y": 0, "width": size["width"], "height": size["height"], "scale": 1}
        png = base64.b64decode(self.send("Page.captureScreenshot", params)["data"])
        if path:
            with open(path, "wb") as file:
                file.write(png)
        return png
