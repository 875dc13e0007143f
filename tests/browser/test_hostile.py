"""Pages that mean harm, in a real browser: what they can make their visitor's browser send, load, frame or run.

Invariant: each test ends by asking the runtime itself, past the browser, that nothing of it has moved.
"""

import http.server
import pathlib
import tempfile
import threading
import time

from runtime import Runtime
from stage import FOREIGN, PageTest, needs_server

FRAME = '{"op":"call_service","service":"/arm_sim/set_params","args":{"gravity":0}}'

# All ways in which a page can contact another address. None may throw, and each result is reported.
TRIES = """
(async (host) => {
  const frame = "\\n" + FRAME + "\\n";
  const base = `http://${host}`;
  const loaded = (tag, attributes) => new Promise((done) => {
    const element = Object.assign(document.createElement(tag), attributes);
    element.onload = () => done("loaded");
    element.onerror = () => done("failed");
    document.body.append(element);
  });
  const fetched = (method, options) => fetch(`${base}/`, { method, ...options }).then((one) => one.status, () => "failed");
  const told = { loads: {}, methods: {} };
  for (const [tag, attributes] of [
    ["script", { src: `${base}/main.js` }], ["script", { src: `${base}/main.js`, type: "module" }], ["link", { rel: "stylesheet", href: `${base}/style.css` }],
    ["img", { src: `${base}/icon.svg` }], ["img", { src: `${base}/report/figure.svg` }], ["object", { data: `${base}/report/` }],
  ]) told.loads[`${tag} ${Object.values(attributes)}`] = await loaded(tag, attributes);
  told.loads.opaque = await fetch(`${base}/report/`, { mode: "no-cors" }).then(() => "loaded", () => "failed");
  told.loads.events = await new Promise((done) => { 
    const one = new EventSource(`${base}/`); one.onopen = () => done("open"); one.onerror = () => { one.close(); done("failed"); }; });
  for (const method of ["POST", "PUT", "PROPFIND", "patch", "LINK"]) told.methods[method] = await fetched(method, { body: frame });
  told.read = await fetched("GET");
  await fetch(`${base}/`, { method: "POST", mode: "no-cors", headers: { "content-type": "text/plain" }, body: frame }).catch(() => {});
  navigator.sendBeacon(`${base}/`, frame);
  told.socket = await new Promise((done) => {
    const one = new WebSocket(`ws://${host}/`);
    one.onopen = () => { one.send(frame); setTimeout(() => done("open"), 500); };
    one.onclose = () => done("closed");
  });
  return told;
})""".replace("FRAME", repr(FRAME))


def serve(html, port=0):
    """Serves a foreign page until the second returned value is called. The first one is its port."""

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

    def foreign(self, html="", host=FOREIGN):
        port, stop = serve(html.replace("TARGET", f"127.0.0.1:{self.runtime.port}"))
        self.addCleanup(stop)
        return self.visit(f"http://{host}:{port}/")

    def tried(self, page, host=None):
        return page.run(f"{TRIES}('{host or f'127.0.0.1:{self.runtime.port}'}')")

    def unmoved(self):
        self.assertEqual(self.runtime.call("/arm_sim/set_params")["values"]["gravity"], 9.81)

    def write(self, name, text):
        (pathlib.Path(self.report.name) / name).write_text(text)

    def test_a_foreign_page_can_neither_open_a_websocket_nor_send_a_command_nor_load_anything(self):
        self.write("figure.svg", '<svg xmlns="http://www.w3.org/2000/svg"/>')
        self.write("index.html", "report")
        told = self.tried(self.foreign())
        self.assertEqual((told["socket"], told["read"], set(told["methods"].values()), set(told["loads"].values())),
            ("closed", "failed", {"failed"}, {"failed"}), told)
        self.unmoved()

    def test_these_tests_can_fail_because_a_local_page_is_accepted(self):
        self.assertEqual(self.tried(self.foreign(host="127.0.0.1"))["socket"], "open")
        self.assertEqual(self.values("/arm_sim/set_params")["gravity"], 0, "a loopback origin may")

    def test_a_foreign_page_cannot_frame_the_page_to_have_it_clicked(self):
        for host in (FOREIGN, "127.0.0.1"):
            page = self.foreign('<iframe src="http://TARGET/"></iframe><iframe src="http://TARGET/report/"></iframe>', host)
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
        page = self.visit(f"{site}/")
        subscribers = lambda: self.runtime.call("/rosapi/subscribers", topic="/joint_states")["values"]["subscribers"]
        self.wait(subscribers, f"the framed page subscribes to the arm, got {page.complaints}")

    def test_a_page_whose_name_was_pointed_here_can_ask_for_nothing_by_any_method(self):
        """The page is of the runtime's own origin, as far as the browser knows."""
        port, stop = serve("x")
        page = self.visit(f"http://{FOREIGN}:{port}/")
        stop()
        self.runtime.stop()
        self.runtime.port = port
        self.runtime.start()
        told = self.tried(page, f"{FOREIGN}:{port}")
        self.assertEqual((told["socket"], told["read"], set(told["methods"].values())), ("closed", 403, {"failed"}), told)
        self.unmoved()

    def test_a_report_runs_no_script_and_asks_for_nothing(self):
        script = "document.title = 'run'; new WebSocket('ws://' + location.host).onopen = function () { this.send('%s') }" % FRAME.replace('"', '\\"')
        page_text = (f"<title>still</title><script>{script}</script><img src=x onerror=\"document.title='run'\">"
                     "<script src=/main.js></script><iframe src=/></iframe><form action=/ method=post><input name=x></form>"
                     "<base href='http://evil.example/'><meta http-equiv=refresh content='0;url=javascript:document.title=1'>")
        self.write("index.html", page_text)
        self.write("figure.svg", f"<svg xmlns='http://www.w3.org/2000/svg'><title>still</title><script>{script}</script></svg>")
        for name in ("index.html", "figure.svg"):
            page = self.visit(f"{self.runtime.url}report/{name}")
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
            self.assertEqual(page.run("$$('img[onerror]').length"), 0)
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
        other = self.visit(self.foreign)
        self.assertEqual(self.socket(other), "closed", "the browser has the cookie, and the origin is allowed")
        self.assertEqual(self.socket(other, f"?token={self.token}"), "open", "so it was the cookie that was missing")
