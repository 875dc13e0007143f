"""The lesson: figures are those of the loop in force, a blow-up is seen and left in one click, and there is always a way back."""

import json
import math
import time

from runtime import Provider
from stage import PageTest

NUMBER = "input[type=number]"
LESSONS = ["euler", "limit", "held", "stiff", "heavy", "chaos", "sag", "own"]


class Lesson(PageTest):
    def values(self, service, **args):
        return self.runtime.call(service, **args)["values"]

    def setpoint_fields(self, page=None):
        return (page or self.page).run(f"[...document.querySelectorAll('#setpoint-fields {NUMBER}')].map((one) => Number(one.value))")

    def shows_setpoint(self, wanted, page=None, why="setpoint"):
        self.wait(lambda: self.setpoint_fields(page) == wanted, f"{why}: {wanted}")

    def free(self):
        return {key: [0] * self.links for key in ("kp", "ki", "kd")}

    frames = "own('frames.js').then(({ count }) => count.frames)"

    def drawn(self, seconds):
        """Frames that the page draws in that time, or a little more."""
        before = self.page.run(self.frames)
        time.sleep(seconds)
        return self.page.run(self.frames) - before


class Right(Lesson):
    """No figure outlives what it is about."""

    def test_with_the_servo_off_the_limit_is_that_of_the_arm_left_to_itself(self):
        self.runtime.call("/arm_sim/set_integrator", timestep=0.01)

        def limit():
            values = self.values("/study/stability", gains=self.free())
            milliseconds = 1000 * min(values["timestep_limit_held"], values["timestep_limit_motion"])
            return f"{float(format(milliseconds, '.3g')):g} ms"

        self.wait(lambda: self.page.text("#out-limit") == limit(), "the limit of the arm left to itself")
        self.page.until("/hanging|moving/.test(document.querySelector('#verdict').textContent)")
        self.page.until("document.querySelector('#verdict-pill').textContent === 'stable'")
        self.runtime.call("/arm_sim/pause", data=True)
        self.page.click("#servo")
        self.page.until("document.querySelector('#verdict-pill').textContent === 'beyond the limit'")
        self.page.until("document.querySelector('#notice').textContent.includes('at the setpoint (0.00, 0.00) rad')")

    def test_eulers_free_swing_is_stable_at_no_timestep(self):
        self.page.click("input[value=euler]")
        self.page.until("document.querySelector('#out-limit').textContent === 'no timestep'")
        # The arm moves on meanwhile, and with it the loop that the page asks about.
        self.page.until("document.querySelector('#verdict-pill').textContent === 'never stable'"
                        r" && /doubles every [\d.]+ s/.test(document.querySelector('#verdict').textContent)")

    def test_each_integrators_button_says_what_it_bears_in_the_loop_in_force(self):
        def served(method):
            limit = self.values("/study/stability", integrator=method, **self.asked)["timestep_limit_held"]
            return "no timestep" if limit == 0 else f"{float(format(1000 * limit, '.3g')):g} ms"

        def shown():
            return self.page.run("Object.fromEntries([...document.querySelectorAll('#methods .segment')].map((one) =>"
                                 " [one.querySelector('input').value, one.querySelector('.bears').textContent]))")

        methods = ("euler", "midpoint", "verlet", "rk4")
        self.asked = {"gains": self.free()}
        self.wait(lambda: shown() == {method: served(method) for method in methods}, "the arm left to itself")
        self.asked = {}
        self.page.click("#servo")
        self.wait(lambda: shown() == {method: served(method) for method in methods}, "the servo")
        self.page.fill(f"#kd-fields {NUMBER}", "60")
        self.wait(lambda: shown() == {method: served(method) for method in methods}, "other gains")

    def test_the_button_of_the_reason_stays_while_limits_are_computed_anew(self):
        self.page.click("#servo")
        text = self.page.until("document.querySelector('#why').checkVisibility() && document.querySelector('#why-text').textContent")
        self.page.run("""(window.hidings = 0, new MutationObserver(() => window.hidings++)
            .observe(document.querySelector('#why'), { attributeFilter: ['hidden'] }))""")
        self.runtime.call("/pid_controller/set_gains", kp=[30, 30], kd=[3, 3])
        other = f"(document.querySelector('#why-text').textContent || {json.dumps(text)}) !== {json.dumps(text)}"
        self.page.until(other)
        self.assertEqual(self.page.run("window.hidings"), 0)

    def test_one_button_says_why_the_gains_bear_that(self):
        self.page.click("#servo")
        self.page.until("document.querySelector('#why').checkVisibility()")
        self.page.click("#why")
        self.wait(lambda: self.values("/pid_controller/enable")["data"], "the servo")
        limit = 1000 * self.values("/study/stability")["timestep_limit_held"]
        begins = f"Why {float(format(limit, '.3g')):g} ms: "
        shown = "document.querySelector('#why-text')"
        text = self.page.until(f"{shown}.checkVisibility() && {shown}.textContent.startsWith({json.dumps(begins)}) && {shown}.textContent")
        self.assertIn("overshoots", text)
        self.keep("why")

    def test_a_mark_of_a_target_goes_once_the_arm_is_sent_elsewhere(self):
        self.page.click("#servo")
        self.runtime.call("/ik_action/send_goal", x=0.4, y=1.1)
        self.page.until("own('store.js').then(({ state }) => state.goal?.outcome === 'reached')")
        self.page.run("own('runtime.js').then((arm) => arm.sendSetpoint([0.1, 0.2]))")
        self.page.until("own('store.js').then(({ state }) => state.goal === null)")

    def test_a_buttons_figure_is_of_the_present_loop(self):
        self.runtime.call("/arm_sim/set_integrator", timestep=0.01)
        self.page.click("#servo")

        def offered():
            return self.page.run("document.querySelector('#notice').hidden ? '' : document.querySelector('#notice button')?.textContent ?? ''")

        def advised():
            milliseconds = 800 * self.values("/study/stability")["minimum_over_poses_held"]
            return f"Reset with {float(format(milliseconds, '.3g')):g} ms"

        self.wait(lambda: offered() == advised(), "the first")
        first = offered()
        gains = self.values("/pid_controller/set_gains")
        self.runtime.call("/pid_controller/set_gains", kd=[2 * kd for kd in gains["kd"]])
        self.wait(lambda: offered() == advised(), "the second")
        self.assertNotEqual(offered(), first)

    def test_setpoint_fields_show_what_the_arm_has(self):
        self.page.click("#servo")
        self.runtime.call("/ik_action/send_goal", x=0.7, y=1.2)
        self.page.until(f"Number(document.querySelector('#setpoint-fields {NUMBER}').value) !== 0")
        goal = self.setpoint_fields()
        second = self.open()
        self.shows_setpoint(goal, second, "a second tab")
        link = second.run("own('share.js').then((share) => share.address())")
        self.assertIn("setpoint=", link)
        self.page.click("#reset")
        self.shows_setpoint([0, 0], why="after a reset")
        self.shows_setpoint([0, 0], second, "after a reset, in the other tab")
        for page in (self.page, second):
            page.expect_network_errors = True
        self.page.run("own('runtime.js').then((arm) => arm.sendSetpoint([0.5, 0.25]))")
        self.shows_setpoint([0.5, 0.25])
        self.runtime.restart()
        self.page.until("document.querySelector('#connection').className === 'pill open'")
        self.shows_setpoint([0, 0], why="after a restart")

    def test_numbers_are_short_whole_and_not_clipped(self):
        self.page.run("own('runtime.js').then((arm) => arm.sendSetpoint([-3.75616e73, 3.00591098005247]))")
        self.page.until(f"document.querySelector('#setpoint-fields {NUMBER}').value === '-3.756e+73'")
        self.assertEqual(self.setpoint_fields()[1], 3.006)
        clipped = self.page.run("[...document.querySelectorAll('input[type=number]')].filter((one) => one.checkVisibility()"
                                " && one.scrollWidth > one.clientWidth).map((one) => one.value)")
        self.assertEqual(clipped, [])

    def test_energy_that_the_servo_puts_in_is_no_drift(self):
        self.page.until("document.querySelector('#legend-drift-name').textContent === 'drift'")
        self.page.click("#servo")
        self.page.until("document.querySelector('#legend-drift-name').textContent === 'work done'")
        self.page.click("#servo")
        self.page.until("document.querySelector('#legend-drift-name').textContent === 'drift'")

        def pushed():
            # A push is short: a page that was busy meanwhile sees nothing of it.
            self.page.key("a")
            return self.page.text("#legend-drift-name") == "pushed in"

        self.wait(pushed, "energy that was pushed in")

    def test_the_pill_is_never_green_while_the_arm_thrashes(self):
        self.runtime.call("/arm_sim/set_integrator", timestep=0.0055)
        self.page.click("#servo")
        self.page.until("document.querySelector('#verdict-pill').textContent === 'beyond the limit'")
        for _ in range(10):
            self.assertNotIn("stable", self.page.run("document.querySelector('#verdict-pill').className"))
            time.sleep(0.1)

    def test_a_pose_that_bears_less_on_the_way_is_told(self):
        self.runtime.call("/arm_sim/set_integrator", timestep=0.006)
        self.page.run("own('runtime.js').then((arm) => arm.sendSetpoint([0.9, -1.3]))")
        self.runtime.call("/pid_controller/enable", data=True)
        self.page.until("['stable here only', 'beyond the limit'].includes(document.querySelector('#verdict-pill').textContent)")


    def test_the_pose_that_bears_least_is_named_and_whether_that_is_proven(self):
        self.page.click("#servo")
        self.page.until("document.querySelector('#out-certified').textContent === 'proven'")
        served = self.values("/study/stability")
        self.tab("stability")
        shown = "document.querySelector('#worst-text').textContent"
        text = self.page.until(f"{shown}.includes('proven to 1 %') && {shown}")
        self.assertIn(f"joint {served['critical']['joint'] + 1} moves most", text)
        self.assertIn(f"{served['critical']['frequency']:.3g} Hz", text)
        self.page.click("#servo")
        self.page.until("document.querySelector('#worst-text').textContent === ''")


class BlowUp(Lesson):
    def diverge(self):
        self.runtime.call("/arm_sim/set_integrator", method="euler", timestep=0.02)
        self.page.click("#servo")
        self.page.until("document.querySelector('#run-state').textContent === 'diverged'")

    def test_the_growth_is_a_picture_with_a_scale_that_can_be_read(self):
        self.diverge()
        self.keep("blow-up")
        labels = self.page.run("own('axis.js').then(({ Axis, LOG_END }) => { const axis = new Axis(3, 0.2, 300); axis.begin();"
                               " axis.offer(-1e148); axis.offer(1); axis.end(); return [axis.log, axis.low, axis.labels.length <= 12]; })")
        self.assertEqual(labels, [True, -12, True])
        # The plot shows more than one line along an axis and a spike: the line is at several heights.
        picture = self.image("#plot-velocity")
        color = self.color("joint1")
        heights = {y // 12 for y in range(0, picture.height) for x in range(picture.width // 2, picture.width)
                   if all(abs(a - b) < 24 for a, b in zip(picture[x, y], color))}
        self.assertGreaterEqual(len(heights), 4)

    def test_the_limit_of_an_arm_that_has_diverged_is_that_of_its_pose(self):
        self.diverge()
        limit = 1000 * self.values("/study/stability", integrator="euler")["timestep_limit_held"]
        wanted = f"{float(format(limit, '.3g')):g} ms"
        self.page.until(f"document.querySelector('#out-limit').textContent === '{wanted}'")
        said = f"20 ms is above the limit {wanted}, at the setpoint (0.00, 0.00) rad."
        self.page.until(f"document.querySelector('#notice').textContent.includes('{said}')")
        self.page.until("document.querySelector('#limit-text').textContent.includes('Advised: ')")
        self.assertNotIn(" ns", self.page.text("#limit-text"))

    def test_the_map_stays_where_it_is_when_the_reason_comes(self):
        self.page.click("#lesson-stiff")
        self.page.until("document.querySelector('#why-text').textContent !== ''")
        top = "document.querySelector('#map').getBoundingClientRect().top"
        # The reason is a paragraph more or less with each setting: a click aimed at the map must not land beside it.
        with_reason = self.page.run(top)
        self.assertEqual(self.page.run(f"(document.querySelector('#why-text').textContent = '', {top})"), with_reason)

    def test_a_click_in_the_map_brings_an_arm_that_has_diverged_back(self):
        self.page.click("#lesson-stiff")
        self.wait(lambda: self.values("/pid_controller/enable")["data"], "the lesson's servo")
        self.runtime.call("/arm_sim/set_integrator", timestep=0.02)
        self.page.until("document.querySelector('#run-state').textContent === 'diverged'")
        begin_anew = "[...document.querySelectorAll('#notice button')].some((one) => one.textContent === 'Begin anew')"
        self.page.until(begin_anew)
        box = self.page.run("(() => { const b = document.querySelector('#map').getBoundingClientRect(); return [b.x, b.y, b.width, b.height]; })()")
        # 0.2 ms at the present gains.
        x, y = box[0] + 46 + (box[2] - 56) * math.log10(2) / 3, box[1] + 8 + (box[3] - 40) / 2
        self.page.mouse("mousePressed", x, y)
        self.page.mouse("mouseReleased", x, y)
        self.page.until("document.querySelector('#run-state').textContent === 'running'")
        self.page.until("document.querySelector('#verdict-pill').textContent === 'stable'")

    def test_one_button_recovers(self):
        self.diverge()
        button = self.page.until("[...document.querySelectorAll('#notice button')].find((one) => one.textContent.startsWith('Reset with'))?.textContent")
        self.assertRegex(button, r"^Reset with [\d.]+ ms$")
        self.page.click("#notice button")
        self.page.until("document.querySelector('#run-state').textContent === 'running'")
        self.page.until("document.querySelector('#verdict-pill').textContent === 'stable'")
        end = time.monotonic() + 1.5
        while time.monotonic() < end:
            self.assertEqual(self.page.text("#run-state"), "running")
            time.sleep(0.1)

    def test_the_pages_own_limits_are_those_of_the_study(self):
        for links_pose in ([0.0, 0.0], [0.9, -1.3], [-1.2, 2.0]):
            for method in ("euler", "midpoint", "verlet", "rk4"):
                served = self.values("/study/stability", integrator=method, setpoint=links_pose)
                held, continuous = self.page.run(f"""Promise.all([own('loop.js'), own('store.js')]).then(([loop, {{ state }}]) => {{
                    const at = loop.loopAt(state.params, state.gains, {links_pose});
                    return [loop.limitOf(at, '{method}', true), loop.limitOf(at, '{method}', false)];
                }})""")
                self.assertAlmostEqual(held, served["timestep_limit_held"], delta=1e-5 * held)
                self.assertAlmostEqual(continuous, served["timestep_limit_continuous"], delta=1e-5 * continuous)

    def test_a_click_in_the_map_goes_there(self):
        self.tab("stability")
        self.page.until("document.querySelector('#map-text').textContent.includes('bear')")
        self.keep("stability")
        box = self.page.run("(() => { const b = document.querySelector('#map').getBoundingClientRect(); return [b.x, b.y, b.width, b.height]; })()")
        # 10 ms is two thirds of the way from 0.1 ms to 100 ms; four times the gains is three quarters of the way up.
        x = box[0] + 46 + (box[2] - 56) * 2 / 3
        y = box[1] + box[3] - 32 - (box[3] - 40) * 3 / 4
        self.page.mouse("mousePressed", x, y)
        self.page.mouse("mouseReleased", x, y)
        self.wait(lambda: abs(math.log(self.values("/arm_sim/set_integrator")["timestep"] / 0.01)) < 0.05, "timestep")
        self.wait(lambda: abs(math.log(self.values("/pid_controller/set_gains")["kp"][0] / 4000)) < 0.05, "gains")

    def test_the_modes_move_with_the_timestep(self):
        self.page.click("#servo")
        self.tab("stability")
        inside = self.page.until("document.querySelector('#circle-text').textContent.includes('within the circle') && document.querySelector('#circle-text').textContent")
        self.assertIn("1 ms", inside)
        before = self.image("#circle").count(self.color("bad"))
        self.page.fill(f"#timestep-field {NUMBER}", "0.006")
        self.page.until("document.querySelector('#circle-text').textContent.includes('grows, flipping its sign at every step')")
        self.assertGreater(self.image("#circle").count(self.color("bad")), before + 20)
        self.keep("modes")

    def test_error_against_run_time_is_measured_live(self):
        self.tab("error")
        self.page.fill(f"#ladder-form {NUMBER}", "1")
        self.page.until("document.querySelectorAll('#ladder-table tbody tr').length === 8")
        cells = self.page.run("[...document.querySelectorAll('#ladder-table tbody tr')].map((row) => [...row.cells].map((one) => one.textContent))")
        number = lambda text: float(text.replace("\u2212", "-"))
        # From 4 ms to 2 ms: by 2, 4, 4 and 16, within a factor, for a free swing of a second.
        for column, factor in ((1, 2), (2, 4), (3, 4), (4, 16)):
            ratio = number(cells[3][column]) / number(cells[4][column])
            self.assertTrue(factor / 2 < ratio < 2 * factor, f"{ratio} for {factor}")
        for method in range(1, 5):
            self.assertGreater(self.image("#ladder").count(self.color(f"run{method}")), 40)
        self.assertIn("costs least", self.page.text("#ladder-text"))
        self.keep("error")


class Ways(Lesson):
    def test_a_stranger_is_told_what_this_is_and_what_to_try(self):
        text = self.page.text("#lesson-text")
        self.assertIn("robot arm", text)
        self.assertIn("Try", text)
        self.keep("first-visit")

    def test_what_a_stranger_is_to_try_is_one_click(self):
        self.page.click("#lesson-text button")
        self.page.until("document.querySelector('#lesson-limit').ariaPressed === 'true'")
        self.wait(lambda: self.values("/pid_controller/enable")["data"], "the lesson's servo")

    def test_a_reset_restores_what_the_lesson_set(self):
        self.page.click("#lesson-sag")
        self.shows_setpoint([0.6, -0.4])
        self.page.fill(f"#ki-fields {NUMBER}", "300")
        self.wait(lambda: self.values("/pid_controller/set_gains")["ki"] == [300, 0], "integral gain")
        self.page.click("#reset")
        self.wait(lambda: self.values("/pid_controller/set_gains")["ki"] == [0, 0], "as the lesson set it")
        self.shows_setpoint([0.6, -0.4])
        self.wait(lambda: self.values("/pid_controller/enable")["data"], "servo")

    def test_changes_can_be_undone_and_defaults_brought_back(self):
        before = self.values("/pid_controller/set_gains")
        self.page.fill(f"#kp-fields {NUMBER}", "777")
        self.wait(lambda: self.values("/pid_controller/set_gains")["kp"][0] == 777, "changed")
        time.sleep(1.1)
        self.page.fill(f"#gravity-field {NUMBER}", "3")
        self.wait(lambda: self.values("/arm_sim/set_params")["gravity"] == 3, "changed too")
        self.page.click("#undo")
        self.wait(lambda: self.values("/arm_sim/set_params")["gravity"] == 9.81, "gravity undone")
        self.assertEqual(self.values("/pid_controller/set_gains")["kp"][0], 777)
        self.page.click("#undo")
        self.wait(lambda: self.values("/pid_controller/set_gains") == before, "gain undone")
        self.page.click("#lesson-heavy")
        self.wait(lambda: self.values("/arm_sim/set_params")["masses"] == [1, 5], "the lesson")
        self.page.click("#defaults")
        self.wait(lambda: self.values("/arm_sim/set_params") == {"gravity": 9.81, "masses": [1, 1], "lengths": [1, 1]}, "defaults")

    def test_the_recording_is_looked_at_while_the_arm_goes_on(self):
        self.page.until("own('history.js').then(({ record }) => record.length > 90)")
        self.page.click("#history-back")
        self.page.until("document.querySelector('#run-state').textContent === 'recording'")
        shown = float(self.page.text("#sim-time"))
        live = "own('store.js').then(({ state }) => state.time)"
        self.page.until(f"{live}.then((time) => time > {max(shown, self.page.run(live)) + 0.3})", why="the arm goes on")
        self.assertEqual(float(self.page.text("#sim-time")), shown)
        self.page.run("document.querySelector('#history-speed').value = '0.1'; document.querySelector('#history-speed').dispatchEvent(new Event('change'))")
        self.page.click("#history-play")
        # By the page's clock, which goes on while a machine that is busy elsewhere holds the arm up.
        look = f"{live}.then((time) => [time, performance.now() / 1000, Number(document.querySelector('#sim-time').textContent)])"
        live_began, began, shown = self.page.run(look)
        self.page.until(f"{live}.then((time) => time > {live_began + 1})", why="the arm goes on for a second")
        _, now, shows = self.page.run(look)
        self.assertLess(shows - shown, 0.4 * (now - began), "slow motion")
        self.keep("recording")
        self.page.click("#history-live")
        self.page.until("document.querySelector('#run-state').textContent === 'running'")

    def test_one_cursor_is_on_all_plots(self):
        self.page.until("own('history.js').then(({ record }) => record.length > 120)")
        self.runtime.call("/arm_sim/pause", data=True)
        self.page.until("document.querySelector('#run-state').textContent === 'paused'")
        self.wait(lambda: self.drawn(0.5) == 0, "the figures are those of the last state")
        now = self.page.text("#legend-velocity")
        x, y = self.page.place("#plot-position")
        self.page.mouse("mouseMoved", x + 150, y)
        self.page.until(f"document.querySelector('#legend-velocity').textContent !== {json.dumps(now)}")
        self.keep("cursor")
        self.page.mouse("mouseMoved", 5, 5)
        self.page.until(f"document.querySelector('#legend-velocity').textContent === {json.dumps(now)}")

    def test_plots_can_be_zoomed_and_their_scales_fixed(self):
        self.page.key("+")
        self.page.until("document.querySelector('#plot-span').value === '5'")
        self.page.key("-")
        self.page.until("document.querySelector('#plot-span').value === '10'")
        self.page.click("#plot-fix")
        self.page.until("document.querySelector('#plot-fix').getAttribute('aria-pressed') === 'true'")

    def test_a_stopwatch_counts_simulation_time(self):
        self.page.click("#watch")
        time.sleep(0.5)
        self.page.click("#watch")
        self.assertRegex(self.page.text("#watch-hud"), r"^⏱ [\d.]+ s$")


class Defaults(Lesson):
    def test_the_pages_defaults_are_what_the_runtime_starts_with(self):
        present = {
            "integrator": self.values("/arm_sim/set_integrator"), "params": self.values("/arm_sim/set_params"),
            "gains": self.values("/pid_controller/set_gains"), "servo": self.values("/pid_controller/enable")["data"],
        }
        self.assertEqual(self.page.run(f"own('settings.js').then(({{ DEFAULTS }}) => DEFAULTS[{self.links}])"), {**present, "setpoint": [0] * self.links})


class DefaultsThreeLinks(Defaults):
    links = 3


class Suggestion(Lesson):
    """Gains for the arm that one has, wherever somebody finds them."""

    FOUND = {"kp": [900, 200], "ki": [2000, 400], "kd": [100, 20]}

    def test_gains_are_offered_only_where_somebody_finds_them(self):
        if not self.runtime.offers("/study/gains"):
            self.assertTrue(self.page.run("document.querySelector('#suggest').hidden"))
            provider = Provider(self.runtime.port, {"/study/gains": lambda _: {"gains": self.FOUND}})
            self.addCleanup(provider.__exit__)
            self.page.go(self.runtime.url)  # a page asks when it connects
            self.connected()
        before = self.values("/pid_controller/set_gains")
        self.page.until("!document.querySelector('#suggest').hidden")
        # Springs that are far too weak for gravity: where the arm is, no timestep is stable, and the notice has the way out.
        self.runtime.call("/pid_controller/set_gains", kp=[1, 1], ki=[3000, 3000], kd=[0, 0])
        self.runtime.call("/pid_controller/enable", data=True)
        self.page.until("[...document.querySelectorAll('#notice button')].some((one) => one.textContent === 'Suggest gains')")
        weak = self.values("/pid_controller/set_gains")
        self.page.run("[...document.querySelectorAll('#notice button')].find((one) => one.textContent === 'Suggest gains').click()")
        self.wait(lambda: self.values("/pid_controller/set_gains") not in (before, weak), "suggested gains")
        self.page.click("#undo")
        self.wait(lambda: self.values("/pid_controller/set_gains") == weak, "undone")


class Presets:
    """Each lesson in a click; its picture is kept, to be looked at."""

    whole = False

    def test_each_lesson_is_one_click(self):
        for lesson in LESSONS:
            self.page.click(f"#lesson-{lesson}")
            settings = self.page.run(f"own('lessons.js').then(({{ LESSONS }}) => LESSONS.find(({{ id }}) => id === '{lesson}').settings({self.links}))")
            self.wait(lambda: self.values("/arm_sim/set_integrator") == settings["integrator"], f"{lesson}: integrator")
            self.wait(lambda: self.values("/arm_sim/set_params") == settings["params"], f"{lesson}: arm")
            self.wait(lambda: self.values("/pid_controller/set_gains") == settings["gains"], f"{lesson}: gains")
            self.wait(lambda: self.values("/pid_controller/enable")["data"] is settings["servo"], f"{lesson}: servo")
            self.shows_setpoint(settings["setpoint"], why=lesson)
            time.sleep(3 if lesson == "chaos" else 1.2)
            self.keep(f"lesson-{lesson}-{type(self).__name__}", whole=self.whole)


class PresetsLight(Presets, Lesson):
    pass


class PresetsDark(Presets, Lesson):
    view = {"dark": True}


class PresetsThreeLinks(Presets, Lesson):
    links = 3


class PresetsPhone(Presets, Lesson):
    view = {"width": 390, "height": 800, "density": 2, "touch": True}
    whole = True


class Still(Lesson):
    def test_a_paused_page_draws_no_frame(self):
        self.wait(lambda: self.drawn(1) > 10, "while it moves it draws")
        self.runtime.call("/arm_sim/pause", data=True)
        self.page.until("document.querySelector('#run-state').textContent === 'paused'")
        self.wait(lambda: self.drawn(2) == 0, "it comes to rest")

    def test_a_paused_page_is_told_little(self):
        def hears():
            """Messages in three seconds, and how long these took."""
            began, before = time.monotonic(), self.page.told
            time.sleep(3)
            return self.page.told - before, time.monotonic() - began

        self.wait(lambda: hears()[0] > 30, "while it moves it hears of every state")
        self.runtime.call("/arm_sim/pause", data=True)
        self.page.until("document.querySelector('#run-state').textContent === 'paused'")

        def hears_little():
            told, took = hears()
            # Once a second: a joint state, the diagnostics, the answers about five settings; and one more of each.
            return told <= 8 * (took + 1)

        self.wait(hears_little, "once paused it hears little")

    def test_an_arm_that_the_servo_holds_still_is_not_drawn_in_every_frame(self):
        self.page.click("#servo")
        self.wait(lambda: max(map(abs, self.runtime.next("/joint_states")["velocity"])) < 1e-4, "at rest")
        # At one moment both, and by the page's own clock.
        look = f"{self.frames}.then((frames) => [frames, performance.now() / 1000])"

        def draws_little():
            frames, began = self.page.run(look)
            time.sleep(2)
            frames_then, then = self.page.run(look)
            return frames_then - frames < 15 * (then - began)

        self.wait(draws_little, "the plots move on, ten times a second")

    def test_an_arm_at_rest_that_is_stepped_is_drawn(self):
        self.runtime.call("/arm_sim/pause", data=True)
        self.page.until("document.querySelector('#run-state').textContent === 'paused'")
        self.wait(lambda: self.drawn(0.5) == 0, "it comes to rest")
        before = self.page.run(self.frames)
        self.page.click("#step")
        self.page.until(f"{self.frames}.then((now) => now > {before})")
