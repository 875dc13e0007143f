"""The connection: it comes back by itself, and a token that it needs does not stay in the address."""

import signal

from runtime import Runtime
from stage import PageTest, needs_server


@needs_server("no server, no connection that others could have or lose")
class Reconnecting(PageTest):
    def test_a_lost_connection_is_reported_everywhere_and_comes_back(self):
        self.page.fill("#gravity-field input[type=number]", "4")
        self.page.until("!$('#undo').disabled")
        self.page.until("!$('#verdict-pill').hidden")
        self.tab("compare")
        self.page.expect_network_errors = True  # the browser itself reports refused connections
        self.runtime.stop()
        self.page.until("$('#notice').textContent.startsWith('Connection lost')")
        self.assertIn("Connection lost", self.page.text("#course-status"))
        self.page.click("#defaults")
        # The timestep has no verdict, and what is typed or pressed is refused.
        self.page.until("$('#run-state').textContent === 'no connection'")
        self.assertEqual(self.page.run("[$('#verdict').textContent, $('#verdict-pill').hidden, "
            "$('#undo').disabled, $('#course-start').disabled]"), ["", True, True, True])
        self.assertNotIn("defaults", self.page.text("#announce-polite"), "nothing was set")
        self.page.until("$('#out-rtf').textContent.startsWith('–')")
        for field, typed in (("#setpoint-fields", "1"), ("#timestep-field", "2")):
            self.page.fill(f"{field} input[type=number]", typed)
        self.page.click("#compare-form button[type=submit]")
        refused = ("$$('#setpoint-fields .refusal, #timestep-field .refusal, #compare-form .refusal').map((one) => one.textContent).filter(Boolean)")
        self.page.until(f"{refused}.length === 3 && {refused}.every((one) => one.includes('not connected'))")
        # It retries meanwhile and fails, so the messages stay.
        self.page.run("own('store.js').then(({ watch }) => { window.tries = 0; watch('connection', () => { window.tries += 1; }); })")
        self.page.until("window.tries >= 2", why="two more changes")
        self.assertEqual(self.page.run(f"{refused}.length"), 3)
        self.page.until("$('#notice').textContent.includes(`--allow-origin ${location.origin}`)", why="what may be wrong")
        self.runtime.start()
        self.connected()
        self.page.until("$('#gravity-field input[type=number]').value === '9.81'", why="the new runtime's gravity")
        self.page.until(f"$('#notice').hidden && {refused}.length === 0")
        self.page.click("#controller")
        self.wait(lambda: self.runtime.call("/pid_controller/enable")["values"]["data"], "the controller")

    def test_the_recording_begins_anew_with_the_next_runtime(self):
        self.page.expect_network_errors = True
        self.page.run("window.Real = WebSocket; window.WebSocket = class { static OPEN = 1; constructor() { setTimeout(() => this.onclose(), 100); } }; 0")
        before = self.runtime.next("/clock")["clock"]["sec"]
        self.runtime.stop()
        self.page.until("$('#notice').textContent.startsWith('Connection lost')")
        self.runtime.start()
        self.wait(lambda: self.runtime.next("/clock")["clock"]["sec"] > before + 3, "a clock that is ahead of the recording")
        self.page.run("window.WebSocket = Real; 0")
        self.connected()
        oldest = "own('history.js').then(({ record, TIME }) => record.data[record.at(0) + TIME])"
        self.page.until("own('history.js').then(({ record }) => record.length > 10)")
        self.assertGreater(self.page.run(oldest), before + 2)


@needs_server("no server, no connection that others could have or lose")
class Silent(PageTest):
    course = True

    def test_a_server_that_says_nothing_is_noticed_and_the_step_goes_on_with_it(self):
        self.page.click("#course-start")
        self.page.until("$('#course-start').textContent === 'Restart step' && !$('#course-dial').inert")
        self.runtime.process.send_signal(signal.SIGSTOP)
        try:
            self.page.until("$('#connection-text').textContent === 'no answer' && $('#run-state').textContent === 'no connection'")
            self.assertIn("No answer", self.page.text("#course-status"))
        finally:
            self.runtime.process.send_signal(signal.SIGCONT)
        self.connected()
        self.assertEqual(self.page.text("#course-start"), "Restart step", "the step is not lost")


@needs_server("no server, no connection that others could have or lose")
class Token(PageTest):
    options = ("--token", "open-sesame-and-some-more")

    def setUp(self):
        self.runtime = Runtime(*self.options)
        self.addCleanup(self.runtime.__exit__)

    def test_the_token_leaves_the_address_and_its_links_and_the_page_lives_on_without_it(self):
        page = self.open(f"?token={self.options[1]}&theme=x#links=2")
        page.until("!location.href.includes('sesame')", why="an address without the token")
        self.assertEqual(page.run("location.search + location.hash"), "?theme=x#links=2")
        self.assertEqual(page.run("document.cookie"), "")
        page.click("#share")
        page.until("location.hash.includes('kp=')")
        self.assertNotIn("sesame", page.run("own('views.js').then((share) => location.href + share.address())"))
        self.page = page
        page.reloads("location.reload()")
        self.connected()
