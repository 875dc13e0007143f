"""Pages that mean harm, in a real browser: what they can make their visitor's browser send, load, frame or run.

Invariant: each test ends by asking the runtime itself, past the browser, that nothing of it has moved.
"""

import http.server
import json
import pathlib
import tempfile
import threading
import time

from runtime import Runtime
from stage import FOREIGN, PageTest, browser, needs_server

FRAME = '{"op":"call_service","service":"/arm_sim/set_params","args":{"gravity":0}}'

# A form's text is `name=value`: here that is one line, and the line is JSON.
FORM = """
<form method=post enctype=text/plain action="http://TARGET/"><input name='{"op":"call_service","service":"/arm_sim/set_params","x":"'
value='","args":{"gravity":0}}'></form><script>document.forms[0].submit()</script>
"""

# Loads what the runtime serves in every way that needs no leave, and tells what came of it.
LOADER = """
<body><script>
const base = "http://TARGET";
const loaded = (tag, attributes) => new Promise((done) => {
  const element = Object.assign(document.createElement(tag), attributes);
  element.onload = () => done("loaded");
  element.onerror = () => done("failed");
  document.body.append(element);
});
window.tried = (async () => ({
  script: await loaded("script", {src: base + "/main.js"}),
  module: await loaded("script", {src: base + "/main.js", type: "module"}),
  style: await loaded("link", {rel: "stylesheet", href: base + "/style.css"}),
  image: await loaded("img", {src: base + "/icon.svg"}),
  report: await loaded("img", {src: base + "/report/figure.svg"}),
  object: await loaded("object", {data: base + "/report/"}),
  fetched: await fetch(base + "/report/", {mode: "no-cors"}).then(() => "opaque", () => "failed"),
  beacon: navigator.sendBeacon(base + "/", "\\n" + FRAME + "\\n"),
  events: await new Promise((done) => { const one = new EventSource(base + "/"); one.onopen = () => done("open"); one.onerror = () => done("failed"); }),
}))();
</script>
""".replace("FRAME", repr(FRAME))

# Tries everything that a page can do to another address; none of it throws, all of it is told.
INTRUDER = """
<script>
const told = {};
const frame = FRAME + "\\n";
const socket = (url) => new Promise((done) => {
  const one = new WebSocket(url);
  one.onopen = () => { one.send(frame); setTimeout(() => done("open"), 500); };
  one.onclose = () => done("closed");
});
const post = (type) => fetch(`http://TARGET/`, {method: "POST", mode: "no-cors", headers: {"content-type": type}, body: "\\n" + frame}).then(() => "sent", () => "failed");
window.tried = (async () => {
  told.socket = await socket(`ws://TARGET/`);
  told.post = await post("text/plain");
  told.put = await fetch(`http://TARGET/`, {method: "PUT", body: frame}).then(() => "read", () => "failed");
  told.read = await fetch(`http://TARGET/`).then(() => "read", () => "failed");
  return told;
})();
</script>
""".replace("FRAME", repr(FRAME))

# This script is of the runtime's own origin, as far as the browser knows.
REBOUND = """
(async () => {
  const frame = "\\n" + FRAME + "\\n";
  const told = {};
  for (const method of ["GET", "POST", "PUT", "PROPFIND", "patch", "LINK"]) {
    const body = method === "GET" ? undefined : frame;
    told[method] = await fetch("/", {method, body}).then((one) => one.status, () => "failed");
  }
  told.socket = await new Promise((done) => {
    const one = new WebSocket(`ws://${location.host}/`);
    one.onopen = () => { one.send(frame); setTimeout(() => done("open"), 300); };
    one.onclose = () => done("closed");
  });
  return told;
})()
""".replace("FRAME", repr(FRAME))


def serve(html, port=0):
    """Serves one page of somebody else's until the value that is returned second is called; gives its port first."""

    class Handler(http.server.BaseHTTPRequestHandler):
        timeout = 0.2  # a browser keeps a connection in reserve, which must not outlive the server

        def do_GET(self):
            self.send_response(200)
            self.send_header("content-type", "text/html")
            self.end_headers()
            self.wfile.write(b"<!doctype html><link rel=icon href=data:,>" + html.encode())

        def log_message(self, *_):
            pass

    server = http.server.ThreadingHTTPServer(("127.0.0.1", port), Handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()

    def stop():
        server.shutdown()
        server.server_close()
        time.sleep(2 * Handler.timeout)

    return server.server_address[1], stop


@needs_server("no server, no connection that others could have or lose")
class Hostile(PageTest):
    def setUp(self):
        self.report = tempfile.TemporaryDirectory()
        self.addCleanup(self.report.cleanup)
        self.runtime = Runtime("--report", self.report.name)
        self.addCleanup(self.runtime.__exit__)

    def visit(self, html, host=FOREIGN):
        port, stop = serve(html.replace("TARGET", f"127.0.0.1:{self.runtime.port}"))
        self.addCleanup(stop)
        page = browser().page(f"http://{host}:{port}/")
        self.addCleanup(page.close)
        return page

    def unmoved(self):
        self.assertEqual(self.runtime.call("/arm_sim/set_params")["values"]["gravity"], 9.81)

    def write(self, name, text):
        (pathlib.Path(self.report.name) / name).write_text(text)

    def test_a_foreign_page_can_neither_open_the_websocket_nor_post_a_command(self):
        told = self.visit(INTRUDER).run("window.tried")
        self.assertEqual((told["socket"], told["put"], told["read"]), ("closed", "failed", "failed"))
        self.unmoved()

    def test_a_page_without_an_origin_can_neither(self):
        script = INTRUDER.replace("TARGET", f"127.0.0.1:{self.runtime.port}") + "<script>tried.then((t) => parent.postMessage(t, `*`))</script>"
        page = browser().page("about:blank")
        self.addCleanup(page.close)
        page.run("new Promise((done) => { const frame = document.createElement('iframe'); frame.sandbox = 'allow-scripts';"
                 f" frame.srcdoc = {json.dumps(script)}; onmessage = ({{ data }}) => {{ window.told = data; done(); }}; document.body.append(frame); }})")
        self.assertEqual(page.run("window.told.socket"), "closed")
        self.unmoved()

    def test_these_tests_can_fail_a_page_of_this_machine_is_let_in(self):
        self.assertEqual(self.visit(INTRUDER, "127.0.0.1").run("window.tried")["socket"], "open")
        self.assertEqual(self.values("/arm_sim/set_params")["gravity"], 0, "a loopback origin may")

    def test_a_form_that_posts_itself_moves_nothing(self):
        for host in (FOREIGN, "127.0.0.1"):
            page = self.visit(FORM, host)
            # Where the form led to, nothing is told in a way that a browser shows.
            page.until("location.protocol === 'chrome-error:' || document.forms.length === 0", why="the form was sent")
            self.unmoved()

    def test_nothing_that_is_served_can_be_loaded_into_a_foreign_page(self):
        self.write("figure.svg", '<svg xmlns="http://www.w3.org/2000/svg"/>')
        self.write("index.html", "report")
        told = self.visit(LOADER).run("window.tried")
        del told["beacon"]  # true means that it was sent
        self.assertEqual(set(told.values()), {"failed"}, told)
        self.unmoved()

    def test_a_foreign_page_cannot_frame_the_page_to_have_it_clicked(self):
        for host in (FOREIGN, "127.0.0.1"):
            page = self.visit('<iframe src="http://TARGET/"></iframe><iframe src="http://TARGET/report/"></iframe>', host)
            refused = lambda: sum("frame-ancestors" in one and "blocked" in one for one in page.complaints)
            self.wait(lambda: refused() == 2, f"two refusals, got {page.complaints}")

    def test_a_page_that_an_option_names_may_frame_the_page(self):
        port, stop = serve("")
        stop()
        self.runtime.stop()
        site = f"http://{FOREIGN}:{port}"
        self.runtime = Runtime("--report", self.report.name, "--allow-frame", site)
        self.addCleanup(self.runtime.__exit__)
        _, stop = serve(f'<iframe src="{self.runtime.url}"></iframe>', port)
        self.addCleanup(stop)
        page = browser().page(f"{site}/")
        self.addCleanup(page.close)
        heard = lambda: self.runtime.call("/rosapi/subscribers", topic="/joint_states")["values"]["subscribers"]
        self.wait(heard, f"the framed page hears the arm, got {page.complaints}")

    def test_a_window_that_a_foreign_page_opens_is_out_of_its_reach(self):
        page = self.visit("")
        page.run(f"window.opened = window.open('{self.runtime.url}'); 0")
        # FramePart off from its opener, it looks closed to it.
        page.until("window.opened.closed")

    def test_a_name_that_was_bound_to_our_address_is_refused(self):
        page = browser().page(f"http://{FOREIGN}:{self.runtime.port}/")
        self.addCleanup(page.close)
        self.assertIn(FOREIGN, page.run("document.body.innerText"))
        self.assertEqual(page.run("document.querySelector('#arm')"), None)

    def test_a_page_whose_name_was_pointed_here_can_ask_for_nothing_by_any_method(self):
        port, stop = serve("x")
        page = browser().page(f"http://{FOREIGN}:{port}/")
        self.addCleanup(page.close)
        stop()
        self.runtime.stop()
        self.runtime.port = port
        self.runtime.start()
        told = page.run(REBOUND)
        self.assertEqual(told.pop("GET"), 403)
        self.assertEqual(told.pop("socket"), "closed")
        self.assertEqual(set(told.values()), {"failed"}, told)
        self.unmoved()

    def test_a_report_runs_no_script_and_asks_for_nothing(self):
        script = "document.title = 'run'; new WebSocket('ws://' + location.host).onopen = function () { this.send('%s') }" % FRAME.replace('"', '\\"')
        page_text = (f"<title>still</title><script>{script}</script><img src=x onerror=\"document.title='run'\">"
                     "<script src=/main.js></script><iframe src=/></iframe><form action=/ method=post><input name=x></form>"
                     "<base href='http://evil.example/'><meta http-equiv=refresh content='0;url=javascript:document.title=1'>")
        self.write("index.html", page_text)
        self.write("figure.svg", f"<svg xmlns='http://www.w3.org/2000/svg'><title>still</title><script>{script}</script></svg>")
        for name in ("index.html", "figure.svg"):
            page = browser().page(f"{self.runtime.url}report/{name}")
            self.addCleanup(page.close)
            self.wait(lambda: page.complaints, "the browser tells what it did not run")
            # A moment is left for what would run later.
            time.sleep(0.3)
            self.assertEqual(page.run("document.title"), "still", name)
        self.unmoved()

    def test_nothing_of_the_address_becomes_markup(self):
        mark = "%22%3E<img src=x onerror=document.title='run'>"
        for tail in (f"?x={mark}", f"#{mark}", f"#kp={mark}&integrator={mark}", "?__proto__[x]=1#__proto__=1"):
            page = self.open(tail)
            self.assertNotEqual(page.run("document.title"), "run")
            self.assertEqual(page.run("document.querySelectorAll('img[onerror]').length"), 0)
            with self.assertRaisesRegex(Exception, "Trusted"):
                page.run("document.body.innerHTML = '<b>x</b>'")
            page.complaints.clear()  # of what was just tried
        self.unmoved()


@needs_server("no server, no connection that others could have or lose")
class Cookie(PageTest):
    """The token's cookie: not for scripts, and not sent along for a page of another site, even one that is let in."""

    token = "open-sesame-and-some-more"

    def setUp(self):
        port, stop = serve("x")
        self.addCleanup(stop)
        self.foreign = f"http://{FOREIGN}:{port}"
        self.runtime = Runtime("--token", self.token, "--allow-origin", self.foreign)
        self.addCleanup(self.runtime.__exit__)

    def socket(self, page, query=""):
        return page.run(f"new Promise((done) => {{ const one = new WebSocket('ws://127.0.0.1:{self.runtime.port}/{query}');"
                        " one.onopen = () => done('open'); one.onclose = () => done('closed'); })")

    def test_it_is_for_the_pages_own_requests_alone(self):
        page = self.open(f"?token={self.token}")
        self.assertEqual(page.run("document.cookie"), "")
        self.assertEqual(self.socket(page), "open")
        other = browser().page(self.foreign)
        self.addCleanup(other.close)
        self.assertEqual(self.socket(other), "closed", "the browser has the cookie, and the origin is allowed")
        self.assertEqual(self.socket(other, f"?token={self.token}"), "open", "so it was the cookie that was missing")
