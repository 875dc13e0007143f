"""Firefox, through Marionette, and WebKitGTK, through its WebDriver: pages with the interface of `chromium`, as far as both have it.

Invariant: the programs that were started are those that are stopped.
"""

import base64
import glob
import json
import os
import pathlib
import shutil
import signal
import socket
import subprocess
import tempfile
import time
import urllib.error
import urllib.request

from chromium import ANSWER_SECONDS, CONSOLE, BrowserError
from chromium import Page as ChromiumPage

KEYS = {"Enter": "\ue007", "Tab": "\ue004", "Escape": "\ue00c", "Delete": "\ue017", "Shift": "\ue008", "ArrowUp": "\ue013", "ArrowDown": "\ue015",
        "ArrowLeft": "\ue012", "ArrowRight": "\ue014"}
# The value of an expression, or the text of its error.
RUN = CONSOLE + "const done = arguments[0]; (async () => (%s\n))().then((value) => done([value]), (error) => done([null, `${error}`]));"
# Errors in the console of Firefox, asked in its own window around the page.
SAID = """return Services.console.getMessageArray().filter((one) => one instanceof Ci.nsIScriptError && !(one.flags & one.warningFlag)
  && /^(file|blob|https?):/.test(one.sourceName)).map(String)"""


class Firefox:
    def __init__(self):
        self.profile = tempfile.mkdtemp(prefix="pendularm-browser-")
        pathlib.Path(self.profile, "user.js").write_text('user_pref("marionette.port", 0);\n')
        command = [shutil.which("firefox-esr") or "firefox", "--headless", "--marionette", "--remote-allow-system-access", "--no-remote"]
        self.started = [subprocess.Popen([*command, "--profile", self.profile, "about:blank"], start_new_session=True, stdout=subprocess.DEVNULL,
                                         stderr=subprocess.DEVNULL)]
        port, end = pathlib.Path(self.profile, "MarionetteActivePort"), time.monotonic() + ANSWER_SECONDS
        while not (port.exists() and port.read_text()) and time.monotonic() < end:
            time.sleep(0.1)
        self.socket = socket.create_connection(("127.0.0.1", int(port.read_text())), ANSWER_SECONDS)
        self.stream = self.socket.makefile("rb")
        self.answer()
        self.send("NewSession", capabilities={})

    def answer(self):
        length = b""
        while (byte := self.stream.read(1)) != b":":
            length += byte
        return json.loads(self.stream.read(int(length)))

    def send(self, name, **params):
        frame = json.dumps([0, 1, name if ":" in name else f"WebDriver:{name}", params]).encode()
        self.socket.sendall(b"%d:%s" % (len(frame), frame))
        _, _, error, result = self.answer()
        if error:
            raise BrowserError(f"{name}: {error['message']}")
        return result.get("value", result) if isinstance(result, dict) else result

    def complaints(self):
        self.send("Marionette:SetContext", value="chrome")
        said = self.send("ExecuteScript", script=SAID, args=[])
        self.send("Marionette:SetContext", value="content")
        return said

    def page(self, url, width=1440, height=900):
        return Page(self, url, width, height)

    def __exit__(self, *_):
        for one in self.started:
            os.killpg(one.pid, signal.SIGKILL)  # its own process group: only the program and its children
            one.wait()
        shutil.rmtree(self.profile, ignore_errors=True)


class WebKit(Firefox):
    paths = {"NewWindow": "window/new", "SwitchToWindow": "window", "CloseWindow": "window", "SetWindowRect": "window/rect", "Navigate": "url",
             "ExecuteAsyncScript": "execute/async", "PerformActions": "actions", "TakeScreenshot": "screenshot"}

    def __init__(self):
        self.profile = tempfile.mkdtemp(prefix="pendularm-browser-")
        screen = subprocess.Popen(["Xvfb", "-displayfd", "1", "-screen", "0", "2000x1400x24", "-nolisten", "tcp"], start_new_session=True,
                                  stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        with socket.create_server(("127.0.0.1", 0)) as free:
            port = free.getsockname()[1]
        home = {"DISPLAY": f":{screen.stdout.readline().strip()}", "HOME": self.profile}
        driver = subprocess.Popen(["WebKitWebDriver", f"--port={port}"], env={**os.environ, **home}, start_new_session=True, stderr=subprocess.DEVNULL)
        self.started = [driver, screen]
        self.url = f"http://127.0.0.1:{port}/session"
        browser = {"binary": glob.glob("/usr/lib/*/webkit2gtk-4*/MiniBrowser")[0], "args": ["--automation"]}
        end = time.monotonic() + ANSWER_SECONDS
        while self.url.endswith("session") and time.monotonic() < end:
            try:
                self.url += "/" + self.ask("POST", self.url, {"capabilities": {"alwaysMatch": {"webkitgtk:browserOptions": browser}}})["sessionId"]
            except urllib.error.URLError:
                time.sleep(0.1)

    def ask(self, method, url, body):
        request = urllib.request.Request(url, json.dumps(body).encode() if method == "POST" else None, {"content-type": "application/json"}, method=method)
        try:
            with urllib.request.urlopen(request, timeout=ANSWER_SECONDS) as answer:
                return json.load(answer)["value"]
        except urllib.error.HTTPError as error:
            raise BrowserError(json.load(error)["value"]["message"]) from None

    def send(self, name, **params):
        return self.ask({"CloseWindow": "DELETE", "TakeScreenshot": "GET"}.get(name, "POST"), f"{self.url}/{self.paths[name]}", params)

    def complaints(self):
        return []  # its driver has no console


class Page(ChromiumPage):
    """A window of its own, so that it is visible."""

    def __init__(self, browser, url, width, height):
        self.browser, self.width = browser, width
        self.handle = browser.send("NewWindow", type="window")["handle"]
        self.send("SetWindowRect", width=width, height=height + 90)  # the page has about 900 of these pixels
        self.go(url)

    @property
    def complaints(self):
        return self.browser.complaints()

    def send(self, name, **params):
        self.browser.send("SwitchToWindow", handle=self.handle)
        return self.browser.send(name, **params)

    def go(self, url):
        self.send("Navigate", url=url)

    def close(self):
        self.browser.send("SwitchToWindow", handle=self.send("CloseWindow")[0])

    def run(self, expression):
        value, *error = self.send("ExecuteAsyncScript", script=RUN % expression, args=[]) or [None]  # none if the page leaves
        if error:
            raise BrowserError(error[0])
        return value

    def act(self, pointer, keys):
        mouse = {"type": "pointer", "id": "mouse", "parameters": {"pointerType": "mouse"}, "actions": pointer}
        strokes = [{"type": kind, "value": KEYS.get(key, key)} for kind, key in keys]
        self.send("PerformActions", actions=[mouse, {"type": "key", "id": "keys", "actions": strokes}])

    def mouse(self, kind, x, y, shift=False):
        press = {"mousePressed": ("pointerDown", "keyDown"), "mouseReleased": ("pointerUp", "keyUp")}.get(kind, ())
        self.act([{"type": "pointerMove", "x": round(x), "y": round(y)}, *[{"type": one, "button": 0} for one in press[:1]]],
                 [(one, "Shift") for one in press[1:] if shift])

    def key(self, key, shift=False):
        self.act([], [("keyDown", "Shift")] * shift + [("keyDown", key), ("keyUp", key)] + [("keyUp", "Shift")] * shift)

    def insert(self, text):
        for one in text or ["Delete"]:
            self.key(one)

    def screenshot(self, path=None, **_):
        png = base64.b64decode(self.send("TakeScreenshot"))
        if path:
            pathlib.Path(path).write_bytes(png)
        return png
