"""The page in one file: a sandbox around it, no worker, and the bits of its kernel, which `cargo run --example runs` in wasm/ writes natively."""

import json
import os
import pathlib
import unittest

from alone import FILE
from stage import IS_FILE, PageTest, needs_chromium
from test_layout import audit, forget_the_inspectors

SUBMISSIONS = pathlib.Path(__file__).parents[1] / "data/submissions.jsonl"

# Sends the texts of the page to the page around it.
REPORT = """<script>setInterval(() => parent.postMessage([document.querySelector("#connection").className,
  Number(document.querySelector("#sim-time").textContent), document.querySelector("#share-text").textContent,
  document.querySelector("#announce-polite").textContent], "*"), 100);</script>"""
SHOWN = "$('#connection')?.className === 'pill open' && Number($('#sim-time').textContent) > 0.2"


@unittest.skipUnless(IS_FILE, "the page of a server has no kernel")
class AloneTest(PageTest):
    def test_it_runs_in_a_sandboxed_frame_and_its_course_goes_on_there(self):
        page = self.visit("about:blank")
        step = """<script>setTimeout(() => document.querySelector("#course-next").click(), 500);
          addEventListener("message", ({ data }) => document.getElementById(data)?.click());</script>"""
        page.run("addEventListener('message', ({ data }) => { window.received = data; })")
        page.run("""((text) => { const frame = document.createElement("iframe"); frame.sandbox = "allow-scripts"; frame.width = 1200;
          frame.height = 800; frame.srcdoc = text; document.body.append(frame); })(%s)""" % json.dumps(FILE.read_text() + step + REPORT))
        page.until("window.received && window.received[0] === 'pill open' && window.received[1] > 0.3", why="the arm runs in the frame")
        for button, part, said in (("share", 2, "Copying is not allowed here"), ("full-screen", 3, "Full screen is not allowed here.")):
            # The step announces itself too, maybe later.
            page.until(f"$('iframe').contentWindow.postMessage('{button}', '*'), window.received[{part}] === '{said}'")
        self.assertEqual(page.complaints, [])

    def test_in_a_frame_of_text_a_first_script_gives_it_a_step_and_settings(self):
        page = self.visit("about:blank")
        text = FILE.read_text().replace("<script", "<script>location.hash = '#step=2&links=3&timestep=0.002';</script><script", 1)
        page.run("""((text) => { const frame = document.createElement("iframe"); frame.width = 1200; frame.height = 800;
          frame.srcdoc = text; document.body.append(frame); })(%s)""" % json.dumps(text))
        inside = "$('iframe').contentDocument"
        page.until(f"{inside}.querySelector('#offer')?.textContent.includes('timestep 0.002')", why="the settings are offered")
        page.until(f"{inside}.querySelector('#course-number').textContent.startsWith('Step 2')")
        page.until(f"{inside}.querySelector('#links').value === '3'")
        self.assertEqual(page.complaints, [])

    @needs_chromium("a script before those of the page")
    def test_without_a_worker_the_page_itself_runs_the_arm(self):
        page = self.visit("about:blank")
        page.before("window.Worker = class { constructor() { throw new Error('forbidden'); } };")
        page.go(self.runtime.url)
        page.until(SHOWN, why="the arm runs")
        self.runtime.page = page
        self.assertTrue(self.runtime.call("/study/gains")["result"])
        self.assertEqual(page.complaints, [])

    def test_the_kernel_has_the_bits_of_the_native_program(self):
        ours = self.page.run("""pendularm["packed.js"].unpack($("#kernel-module").textContent)
            .then((bytes) => WebAssembly.instantiate(bytes, { env: { milliseconds: () => performance.now() } }))
            .then(({ instance: { exports } }) => { const length = exports.compare(); return new TextDecoder().decode(new Uint8Array(exports.memory.buffer,
                exports.output(), length)); })""")
        native = pathlib.Path(os.environ["RUNS"]).read_text()
        self.assertEqual(len(native.splitlines()), 30)
        self.assertEqual(ours, native, "16 runs and 14 answers")

    def test_a_submission_is_opened_or_dropped_judged_and_played(self):
        text = SUBMISSIONS.read_text().splitlines()[1]
        wrong = text.replace('"trail": ["', '"trail": ["0', 1)
        for given, how, said in ((text, "drop", ": confirmed"), (wrong, "open", ": refused, departs at step 0"), (text, "open", ": confirmed")):
            self.page.run("""((text, how) => {
                const data = new DataTransfer(), input = $('#submission-file');
                data.items.add(new File([text], 'mine.json'));
                if (how === 'open') { input.files = data.files; input.dispatchEvent(new Event('change')); }
                else document.dispatchEvent(new DragEvent('drop', { dataTransfer: data, cancelable: true }));
            })(%s, %s)""" % (json.dumps(given), json.dumps(how)))
            self.page.until(f"$('#submission-text').textContent.endsWith({json.dumps(said)})")
            self.assertEqual(self.page.run("$('#submission-motion').checkVisibility()"), given == text)
        self.assertEqual(json.loads(text)["task"], "PendularmReach-v0")
        for color in ("accent", "target"):
            self.wait(lambda: self.image("#submission-motion").count(self.color(color)) > 20, f"the {color}")
        self.assertEqual(audit(self.page), [])
        forget_the_inspectors(self.page)

    def test_the_time_of_a_short_run_is_finer_than_the_clock_of_the_browser(self):
        """The browser's clock goes in steps of 0.1 ms: an answer between its steps is a mean of many runs."""
        ask = {"duration": 1, "timestep": 0.032, "integrator": "euler", "samples": 2, "setpoint": [0, 0]}
        times = [self.values("/study/rollout", **ask)["wall_time"] for _ in range(5)]
        self.assertGreater(min(times), 0, times)
        self.assertTrue(any(abs(one / 1e-4 - round(one / 1e-4)) > 1e-3 for one in times), times)

    def test_an_address_and_a_list_choose_the_number_of_links(self):
        page = self.visit(f"{FILE.as_uri()}#step=2&links=3")
        page.until(SHOWN, why="the arm runs")
        self.runtime.page = page
        self.assertEqual(len(self.runtime.next("/joint_states")["position"]), 3)
        page.until("$('#links').checkVisibility() && $('#links').value === '3'")
        page.reloads("$('#links').value = '2', $('#links').dispatchEvent(new Event('change'))", f"{SHOWN} && $('#links').value === '2'")
        self.assertEqual(len(self.runtime.next("/joint_states")["position"]), 2)
        self.assertEqual(page.run("location.hash"), "#step=slow&links=2")
        self.assertEqual(page.complaints, [])

    def test_the_address_keeps_the_number_of_links_and_another_one_brings_that_arm(self):
        page = self.page
        for address, after in (("#links=3", "#links=3"), ("#step=4&links=2", "#step=4&links=2")):
            page.reloads(f"location.hash = '{address}'", f"{SHOWN} && $('#links').value === '{after[-1]}'")
            self.assertEqual(page.run("location.hash"), after)
        page.until("$('#course-start').textContent === 'Restart step'", why="a step that starts at once")
        page.click("#course-next")
        self.assertEqual(page.run("location.hash"), "#step=timestep&links=2")
        page.click("#view-switch")
        self.assertEqual(page.run("location.hash"), "#links=2")
