"""A record in the arm's place: the page shows the arm as it was, says that it is a replay, and moves through it."""

import math
import pathlib
import subprocess
import tempfile

from runtime import BINARY, PATIENCE, Runtime
from stage import PageTest


class Player(Runtime):
    """A process that plays a record; use it with `with`."""

    def start(self):
        command = [BINARY, "replay", *self.options, "--serve", "--bind", f"127.0.0.1:{self.port}"]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        line = self.process.stdout.readline()
        if not line.startswith("listening on "):
            raise RuntimeError(f"{command}: said {line!r}, status {self.process.wait(PATIENCE)}")
        self.port = int(line.rsplit(":", 1)[1])


class Replaying(PageTest):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        record = str(pathlib.Path(folder.name, "run.mcap"))
        with Runtime("--record", record) as live:
            live.call("/arm_sim/set_params", gravity=4)
            live.call("/pid_controller/enable", data=True)
            live.call("/ik_action/send_goal", x=0.5, y=1.2)
            self.wait(lambda: self.is_done(live), "four seconds on record, and the arm at rest at its goal")
        self.runtime = Player(record)
        self.addCleanup(self.runtime.__exit__)
        self.page = self.open(**self.view)

    def is_done(self, live):
        state = live.next("/joint_states")
        is_at_rest = max(map(abs, state["velocity"])) < 1e-2
        return state["header"]["stamp"]["sec"] >= 4 and is_at_rest and math.dist(live.end_effector(), (0.5, 1.2)) < 0.02

    def seek(self, part):
        self.page.run(
            f"(() => {{ const e = document.querySelector('#player-scrub'); e.value = {part} * 1000;"
            " for (const one of ['input', 'change']) e.dispatchEvent(new Event(one)); })()")

    def test_the_page_shows_a_record_and_moves_through_it(self):
        self.page.until("!document.querySelector('#player').hidden", why="it says that it is a replay")
        self.page.until("document.querySelector('#gravity-field input[type=number]').value === '4'", why="gravity as it was")
        self.page.click("#pause")
        self.page.until("document.querySelector('#run-state').textContent === 'paused'")
        self.seek(1)
        self.page.until("document.querySelector('#player-time').textContent.match(/^(\\d+\\.\\d) of \\1 s$/)", why="its end")
        self.page.until("own('store.js').then(({ state }) => Math.hypot(Math.cos(state.position[0]) + Math.cos(state.position[0] + state.position[1]) - 0.5,"
                        " Math.sin(state.position[0]) + Math.sin(state.position[0] + state.position[1]) - 1.2) < 0.05)", why="at the goal, as it was")
        self.keep("replay")
        self.seek(0)
        self.page.until("own('store.js').then(({ state }) => Math.abs(state.position[0]) < 0.2)", why="at the beginning")
        self.speed(-4)
        self.wait(lambda: self.runtime.call("/rosbag2_player/get_rate")["values"]["rate"] == -4, "the speed that was chosen")

    def speed(self, rate):
        self.page.run(f"(() => {{ const e = document.querySelector('#player-speed'); e.value = '{rate}'; e.dispatchEvent(new Event('change')); }})()")

    def test_what_a_record_lacks_is_said_in_few_words(self):
        self.page.until("!document.querySelector('#player').hidden", why="it says that it is a replay")
        self.page.until("document.querySelector('#out-every').textContent === '–'", why="no study, no limit of every pose")
        self.page.click("#lesson-euler")
        self.page.until("/^A record is replayed/.test(document.querySelector('#lesson-text').textContent)")
        self.assertIsNone(self.page.run("own('store.js').then(({ state }) => state.lesson)"))

    def test_what_was_before_stays_in_the_plots_while_a_record_goes_back(self):
        self.page.until("!document.querySelector('#player').hidden", why="it says that it is a replay")
        self.page.click("#pause")
        self.page.until("document.querySelector('#run-state').textContent === 'paused'")
        for part, reached in [(0, "< 0.5"), (0.3, "> 1"), (0.6, "> 2"), (1, "> 3.5")]:
            self.seek(part)
            self.page.until(f"own('store.js').then(({{ state }}) => state.time {reached})", why="it is there")
        self.speed(-1)
        self.page.click("#pause")
        self.page.until("own('store.js').then(({ state }) => state.time < 3)", why="it goes back")
        self.page.until("own('history.js').then(({ record }) => record.length >= 3)", why="the rows from before are there")


class Live(PageTest):
    def test_a_live_arm_has_no_bar_of_a_record(self):
        self.page.until("own('store.js').then(({ state }) => state.offersGains)")
        self.assertTrue(self.page.run("document.querySelector('#player').hidden"))
