"""The connection: it comes back by itself, and only the page of the runtime's own address has one."""

import http.server
import json
import threading

from runtime import Runtime
from stage import FOREIGN, PageTest, browser, needs_server

# Tries everything that a page can do to another address; none of it throws, all of it is told.
INTRUDER = """
const told = {};
const target = "127.0.0.1:PORT";
const frame = JSON.stringify({op: "call_service", service: "/arm_sim/set_params", args: {gravity: 0}}) + "\\n";
const socket = (url) => new Promise((done) => {
  const one = new WebSocket(url);
  one.onopen = () => { one.send(frame); setTimeout(() => done("open"), 500); };
  one.onclose = () => done("closed");
});
const post = (type) => fetch(`http://${target}/`, {method: "POST", mode: "no-cors", headers: {"content-type": type}, body: "\\n" + frame}).then(() => "sent", () => "failed");
window.tried = (async () => {
  told.socket = await socket(`ws://${target}/`);
  told.post = await post("text/plain");
  told.put = await fetch(`http://${target}/`, {method: "PUT", body: frame}).then(() => "read", () => "failed");
  told.read = await fetch(`http://${target}/`).then(() => "read", () => "failed");
  return told;
})();
"""


@needs_server("no server, no connection that others could have or lose")
class Reconnecting(PageTest):
    def test_it_comes_back_after_a_restart_of_the_runtime(self):
        self.runtime.call("/arm_sim/set_params", gravity=4)
        self.page.until("document.querySelector('#gravity-field input[type=number]').value === '4'")
        self.page.expect_network_errors = True  # the browser itself reports refused connections
        self.runtime.stop()
        self.page.until("document.querySelector('#connection-text').textContent !== 'connected'")
        self.page.until("document.querySelector('#notice').textContent.startsWith('Connection lost')")
        self.runtime.start()
        self.connected()
        self.page.until("document.querySelector('#gravity-field input[type=number]').value === '9.81'", why="the new runtime's gravity")
        self.page.until("document.querySelector('#notice').hidden")
        self.page.click("#servo")
        self.wait(lambda: self.runtime.call("/pid_controller/enable")["values"]["data"], "servo")

    def test_what_was_refused_for_want_of_a_connection_is_said_no_longer_than_that(self):
        self.tab("compare")
        self.page.expect_network_errors = True
        self.runtime.stop()
        self.page.until("document.querySelector('#connection-text').textContent !== 'connected'")
        self.page.click("#compare-form button[type=submit]")
        self.page.until("document.querySelector('#compare-form .refusal').textContent.includes('not connected')")
        # It tries again and again meanwhile, and fails: the message stays.
        tries = "own('store.js').then(({ watch }) => { window.tries = 0; watch('connection', () => { window.tries += 1; }); })"
        self.page.run(tries)
        self.page.until("window.tries >= 2", why="two more changes")
        self.assertIn("not connected", self.page.text("#compare-form .refusal"))
        self.runtime.start()
        self.connected()
        self.page.until("document.querySelector('#compare-form .refusal').textContent === ''")

    def test_without_a_connection_nothing_is_said_of_the_timestep_and_no_setpoint_is_lost_in_silence(self):
        setpoint = "#setpoint-fields input[type=number]"
        self.page.until("!document.querySelector('#verdict-pill').hidden")
        self.page.expect_network_errors = True
        self.runtime.stop()
        self.page.until("document.querySelector('#run-state').textContent === 'no connection'")
        self.assertTrue(self.page.run("document.querySelector('#verdict-pill').hidden"))
        self.assertEqual(self.page.text("#verdict"), "")
        self.page.until("document.querySelector('#out-rtf').textContent.startsWith('–')")
        for field, typed in ((setpoint, "1"), ("#timestep-field input[type=number]", "2")):
            self.page.fill(field, typed)
        refused = "[...document.querySelectorAll('#setpoint-fields .refusal, #timestep-field .refusal')].map((one) => one.textContent).filter(Boolean)"
        self.page.until(f"{refused}.length === 2")
        self.assertEqual(self.page.run(refused), ["not connected"] * 2)
        self.runtime.start()
        self.connected()
        self.page.until(f"{refused}.length === 0")

    def test_it_takes_another_number_of_links(self):
        self.page.expect_network_errors = True
        self.runtime.restart(links=3)
        self.connected(links=3)
        self.page.until("document.querySelectorAll('#masses-fields .field').length === 3")


@needs_server("no server, no connection that others could have or lose")
class Token(PageTest):
    options = ("--token", "open-sesame-and-some-more")

    def setUp(self):
        self.runtime = Runtime(*self.options)
        self.addCleanup(self.runtime.__exit__)

    def test_a_page_opened_with_the_token_connects_and_shares_links_without_it(self):
        page = self.open(f"?token={self.options[1]}")
        page.click("#share")
        page.until("location.hash !== ''")
        self.assertNotIn("sesame", page.run("own('share.js').then((share) => share.address())"))

    def test_the_token_leaves_the_address_and_the_page_lives_on_without_it(self):
        page = self.open(f"?token={self.options[1]}&theme=x#links=2")
        page.until("!location.href.includes('sesame')", why="an address without the token")
        self.assertEqual(page.run("location.search + location.hash"), "?theme=x#links=2")
        self.assertEqual(page.run("document.cookie"), "")
        self.page = page
        page.run("window.old = 1; location.reload()")
        page.until("window.old === undefined", why="the page anew")
        self.connected()

    def test_a_page_opened_without_it_is_turned_away(self):
        page = browser().page(self.runtime.url)
        self.addCleanup(page.close)
        self.assertEqual(page.run("document.querySelector('#arm')"), None)


@needs_server("no server, no connection that others could have or lose")
class Foreigners(PageTest):
    def serve(self):
        """A page of somebody else's, on a port of its own."""
        script = INTRUDER.replace("PORT", str(self.runtime.port)).encode()

        class Handler(http.server.BaseHTTPRequestHandler):
            def do_GET(self):
                self.send_response(200)
                self.send_header("content-type", "text/html")
                self.end_headers()
                self.wfile.write(b"<link rel=icon href=data:,><script>" + script + b"</script>")

            def log_message(self, *_):
                pass

        server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        threading.Thread(target=server.serve_forever, daemon=True).start()
        self.addCleanup(server.server_close)
        self.addCleanup(server.shutdown)
        return server.server_address[1]

    def tried(self, url):
        page = browser().page(url)
        self.addCleanup(page.close)
        return page.run("window.tried")

    def unmoved(self):
        self.assertEqual(self.runtime.call("/arm_sim/set_params")["values"]["gravity"], 9.81)

    def test_a_foreign_page_can_neither_open_the_websocket_nor_post_a_command(self):
        told = self.tried(f"http://{FOREIGN}:{self.serve()}/")
        self.assertEqual((told["socket"], told["put"], told["read"]), ("closed", "failed", "failed"))
        self.unmoved()

    def test_a_page_without_an_origin_can_neither(self):
        script = INTRUDER.replace("PORT", str(self.runtime.port))
        page = browser().page("about:blank")
        self.addCleanup(page.close)
        page.run("new Promise((done) => { const frame = document.createElement('iframe'); frame.sandbox = 'allow-scripts';"
                 f" frame.srcdoc = {json.dumps('<script>' + script + 'tried.then((t) => parent.postMessage(t, `*`))</' + 'script>')};"
                 " onmessage = ({ data }) => { window.told = data; done(); }; document.body.append(frame); })")
        self.assertEqual(page.run("window.told.socket"), "closed")
        self.unmoved()

    def test_a_name_that_was_bound_to_our_address_is_refused(self):
        page = browser().page(f"http://{FOREIGN}:{self.runtime.port}/")
        self.addCleanup(page.close)
        self.assertIn(FOREIGN, page.run("document.body.innerText"))
        self.assertEqual(page.run("document.querySelector('#arm')"), None)

    def test_these_tests_can_fail_a_page_of_this_machine_is_let_in(self):
        told = self.tried(f"http://127.0.0.1:{self.serve()}/")
        self.assertEqual(told["socket"], "open")
        self.assertEqual(self.runtime.call("/arm_sim/set_params")["values"]["gravity"], 0, "a loopback origin may")
