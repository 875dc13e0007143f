"""The lesson: figures are those of the loop in force."""

import json
import math
import time

from lesson import NUMBER, Lesson
from stage import needs_server


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
            values = self.values("/study/stability", integrator=method, **self.asked)
            held, motion = values["timestep_limit_held"], values["timestep_limit_motion"]
            # Midpoint's free swing gains so little that the motion limits it first.
            held = math.inf if self.asked and method == "midpoint" else held
            limit = min(held, math.inf if motion is None else motion)
            return "no timestep" if limit == 0 else f"{float(format(1000 * limit, '.3g')):g} ms"

        def shown():
            return self.page.run("Object.fromEntries([...document.querySelectorAll('#methods .segment')].map((one) =>"
                                 " [one.querySelector('input').value, one.querySelector('.limit').textContent]))")

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
            return f"Restart at {float(format(milliseconds, '.3g')):g} ms"

        self.wait(lambda: offered() == advised(), "the first")
        first = offered()
        gains = self.values("/pid_controller/set_gains")
        self.runtime.call("/pid_controller/set_gains", kd=[2 * kd for kd in gains["kd"]])
        self.wait(lambda: offered() == advised(), "the second")
        self.assertNotEqual(offered(), first)

    @needs_server("two tabs have an arm each")
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
        self.page.until("document.querySelector('#legend-drift-name').textContent === 'work'")
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
        self.page.until("document.querySelector('#out-certified').textContent === 'bounded'")
        served = self.values("/study/stability")
        self.tab("stability")
        shown = "document.querySelector('#worst-text').textContent"
        text = self.page.until(f"{shown}.includes('bounded by an estimate to 1 %') && {shown}")
        self.assertIn(f"joint {served['critical']['joint'] + 1} moves most", text)
        self.assertIn(f"{served['critical']['frequency']:.3g} Hz", text)
        self.page.click("#servo")
        self.page.until("document.querySelector('#worst-text').textContent === ''")
