"""The page's controls: drags, settings, refusals, keys, the trial, the comparison; the runtime is asked what came of it."""

import math
import time

from stage import NUMBER, PageTest

class Controls(PageTest):
    def field(self, name, joint=None):
        return f"#{name} {NUMBER}" if joint is None else f"#{name} .field:nth-of-type({joint}) {NUMBER}"

    # Realism

    def test_switches_limit_the_efforts_and_add_friction_and_a_link_has_both(self):
        self.page.until("$('#realism').checkVisibility() && $('#friction-switch').checkVisibility()")
        self.page.click("#limit-switch")
        self.wait(lambda: self.values("/pid_controller/set_limits")["effort"] == [30, 8], "1.5 times the weight")
        self.page.until(f"$('{self.field('limit-fields', 1)}').value === '30'", why="the page has the answer")
        self.page.fill(self.field("limit-fields", 1), "25")
        self.wait(lambda: self.values("/pid_controller/set_limits")["effort"] == [25, 8], "a limit")
        self.page.choose("#limit-options select", "conditional")
        self.wait(lambda: self.values("/pid_controller/set_limits")["anti_windup"] == "conditional", "a cure")
        self.page.click("#friction-switch")
        self.wait(lambda: self.values("/arm_sim/set_friction")["viscous"] == [1, 1], "friction")
        self.page.until("own('views.js').then((share) => share.address().includes('viscous=1,1&effort_limit=25,8&anti_windup=conditional'))")
        self.page.click("#limit-switch")
        self.page.click("#friction-switch")
        self.wait(lambda: (self.values("/pid_controller/set_limits")["effort"], self.values("/arm_sim/set_friction")["viscous"]) == (None, [0, 0]), "off")

    def test_a_switch_gives_the_controller_real_sensors_and_a_link_has_them(self):
        sensors = lambda: self.values("/pid_controller/set_sensors")
        self.page.until("$('#sensors-switch').checkVisibility()")
        self.page.click("#sensors-switch")
        self.wait(lambda: sensors() == {"encoder_step": [2 * math.pi / 4096] * 2, "velocity": "difference", "delay": 0}, "12 bits and a difference")
        for at, value, wanted in (1, "16", {"encoder_step": [2 * math.pi / 65536] * 2}), (3, "3", {"delay": 3}):
            self.page.choose(f"#sensors-options label:nth-of-type({at}) select", value)
            self.wait(lambda wanted=wanted: {key: sensors()[key] for key in wanted} == wanted, f"{wanted}")
        self.page.until("own('store.js').then(({ state }) => state.period.delay && state.sensors.delay === 3)", why="both settings have the delay")
        link = self.page.run("own('views.js').then((share) => share.address())")
        self.assertIn("&velocity_sensor=difference&control_delay=3", link)
        self.page.click("#controller")
        asked = "own('store.js').then(async ({ state }) => (await own('question.js')).questionOf(state)?.sensors?.delay === 3)"
        self.page.until(asked, why="the study is asked with this delay")
        self.page.click("#sensors-switch")
        self.wait(lambda: sensors() == {"encoder_step": [0, 0], "velocity": "exact", "delay": 0}, "off")

    # The view

    def test_a_shift_drag_places_the_setpoint_without_a_goal(self):
        self.page.click("#controller")
        self.page.drag(self.on_canvas((1.6, 0.2)), self.on_canvas((-0.4, 1.3)), shift=True)
        self.wait(lambda: math.dist(self.runtime.end_effector(), (-0.4, 1.3)) < 0.02, "end effector at the setpoint")
        self.assertFalse(self.runtime.call("/ik_action/cancel_goal")["result"], "no goal is active")

    def choose_drag(self, mode):
        self.page.run(f"$('input[name=drag][value={mode}]').click()")

    def test_the_arm_is_lifted_held_and_released(self):
        self.choose_drag("arm")
        start, end = self.on_canvas((1.6, 0.2)), self.on_canvas((0.7, 1.2))
        self.page.mouse("mousePressed", *start)
        self.page.mouse("mouseMoved", *end)
        self.wait(lambda: math.dist(self.runtime.end_effector(), (0.7, 1.2)) < 0.1, "the arm is where the pointer is")
        began = self.time()
        self.wait(lambda: self.time() > began + 0.5, "half a second passes")
        # A slow page may hold it late, so that it has fallen a little.
        self.wait(lambda: math.dist(self.runtime.end_effector(), (0.7, 1.2)) < 0.1, "a pointer that rests holds the arm", 2)
        self.page.mouse("mouseReleased", *end)
        self.wait(lambda: math.dist(self.runtime.end_effector(), (0.7, 1.2)) > 0.5, "nothing holds it any longer")

    def test_a_paused_arm_is_lifted_and_stays_at_rest(self):
        self.runtime.call("/arm_sim/pause", data=True)
        self.choose_drag("arm")
        self.page.drag(self.on_canvas((1.6, 0.2)), self.on_canvas((-0.4, 1.3)))
        self.wait(lambda: math.dist(self.runtime.end_effector(), (-0.4, 1.3)) < 0.01, "the arm is where the drag ended")
        self.assertEqual(self.runtime.next("/joint_states")["velocity"], [0, 0])
        self.assertTrue(self.values("/arm_sim/pause")["data"])
        # Beyond the reach it points at the pointer.
        self.page.drag(self.on_canvas((0.0, 1.9)), self.on_canvas((0.0, 2.2)))
        self.wait(lambda: math.dist(self.runtime.end_effector(), (0, 2)) < 0.01, "the arm is stretched")
        self.page.run("$('#arm').focus()")
        self.page.key("ArrowDown")
        self.page.key("ArrowDown")
        self.wait(lambda: math.dist(self.runtime.end_effector(), (0, 1.9)) < 0.01, "0.05 m with each key")

    def test_a_target_out_of_reach_is_refused_in_words_until_the_next_goal(self):
        self.page.drag(self.on_canvas((1.5, 0.0)), self.on_canvas((2.2, 0.3)))
        refusal = self.page.until("$('#goal-body .refusal').textContent", why="refusal shown")
        # The runtime's own answer to such a goal.
        said = self.runtime.call("/ik_action/send_goal", x=9, y=0)["status"]
        self.assertEqual(refusal.split(" ")[0], said.split(" ")[0])
        self.page.until("$('#announce-assertive').textContent !== ''")
        # The last place of the drag may be refused after the first of these goals.
        self.wait(lambda: self.runtime.call("/ik_action/send_goal", x=0.7, y=1.2) and self.page.text("#goal-body .refusal") == "", "another goal was accepted")

    # Settings

    def test_settings_reach_the_runtime_and_show_what_it_took(self):
        self.page.click("input[value=euler]")
        self.page.fill(self.field("timestep-field"), "2")
        self.wait(lambda: self.values("/arm_sim/set_integrator") == {"method": "euler", "timestep": 0.002}, "integrator")
        self.page.fill(self.field("masses-fields", 2), "2.5")
        self.page.fill(self.field("lengths-fields", 1), "0.8")
        self.page.fill(self.field("gravity-field"), "9.80665")
        self.wait(lambda: self.values("/arm_sim/set_params") == {"gravity": 9.80665, "masses": [1, 2.5], "lengths": [0.8, 1]}, "parameters")
        self.assertEqual(self.page.run(f"$('{self.field('gravity-field')}').value"), "9.80665", "not rounded")
        before = self.values("/pid_controller/set_gains")
        for gain, joint, value in (("kp", 1, 900), ("ki", 2, 0), ("kd", 1, 77)):
            self.page.fill(self.field(f"{gain}-fields", joint), str(value))
            before[gain][joint - 1] = value
        self.wait(lambda: self.values("/pid_controller/set_gains") == before, "gains")

    def test_the_control_period_is_set_beside_the_timestep_and_can_be_undone(self):
        slider = "$('#period-field input[type=range]')"
        self.page.until(f"{slider}.getAttribute('aria-valuetext') === 'every step'")
        self.page.fill(self.field("period-field"), "20")
        self.wait(lambda: self.values("/pid_controller/set_period")["period"] == 0.02, "control period")
        self.page.until("!$('#undo').disabled")
        self.page.click("#undo")
        self.wait(lambda: self.values("/pid_controller/set_period")["period"] == 0, "undone")
        self.page.click("#controller")
        self.page.until(f"{slider}.getAttribute('aria-valuetext').startsWith('every step, stable up to ')")
        marks = self.page.run("$$('#timestep-field .mark, #period-field .mark').map((one) => one.getBoundingClientRect().x)")
        self.assertEqual(len(marks), 2)
        self.assertAlmostEqual(*marks, delta=1, msg="the same limit is at the same place of both sliders")
        self.page.fill(self.field("period-field"), "20")
        self.wait(lambda: self.values("/pid_controller/set_period")["period"] == 0.02, "control period")
        self.page.until("$('#period-text').textContent === '20 steps, 20 ms'")
        self.page.until("$('#notice').textContent.includes('A control period of 20 ms is above the limit')")
        self.page.press("#notice", "Control at every step")
        self.wait(lambda: self.values("/pid_controller/set_period")["period"] == 0, "every step")

    def test_a_preset_and_a_slider_set_gravity(self):
        self.page.click("#gravity-places button:nth-of-type(2)")
        self.wait(lambda: self.values("/arm_sim/set_params")["gravity"] == 1.62, "the Moon's")
        self.page.until(f"$('#gravity-field {NUMBER}').value === '1.62'")
        self.page.run("$('#gravity-field input[type=range]').focus()")
        self.page.key("ArrowRight")
        self.wait(lambda: 1.62 < self.values("/arm_sim/set_params")["gravity"] < 1.8, "a little more")

    def test_a_refusal_is_shown_beside_its_field_which_goes_back(self):
        for field, wrong, service, shown in (
            ("masses-fields", "-2", "/arm_sim/set_params", "1"), ("timestep-field", "0", "/arm_sim/set_integrator", "1"),
            ("kp-fields", "-1", "/pid_controller/set_gains", "1000"), ("gravity-field", "-9", "/arm_sim/set_params", "9.81"),
        ):
            before = self.values(service)
            self.page.fill(self.field(field), wrong)
            text = self.page.until(f"$('#{field} .refusal').textContent", why=f"refusal of {wrong}")
            self.assertTrue(text.endswith(f"got {wrong}") or text == "timestep must be greater than 0", text)
            self.assertEqual(self.page.run(f"$('#{field} {NUMBER}').value"), shown)
            self.assertEqual(self.page.run(f"$('#{field} {NUMBER}').getAttribute('aria-invalid')"), "true")
            self.assertEqual(self.values(service), before)
        self.page.fill(self.field("masses-fields"), "2")
        self.page.until("$('#masses-fields .refusal').textContent === ''")
        self.page.fill(self.field("timestep-field"), "1")
        self.page.until("$('#timestep-field .refusal').textContent === ''", why="it is in force already")
        self.runtime.call("/arm_sim/set_params", gravity=3)
        self.page.until("$('#gravity-field .refusal').textContent === ''", why="another client has changed it")
        self.page.click("#defaults")
        self.page.until("$$('#controls .refusal').every((one) => one.textContent === '')")

    def test_pause_steps_and_reset(self):
        self.page.click("#pause")
        self.page.until("$('#pause-text').textContent === 'Run'")
        self.page.until("$('#run-state').textContent === 'paused'")
        began = self.time()
        self.page.click("#step")
        self.wait(lambda: abs(self.time() - began - 0.001) < 1e-9, "one step")
        self.page.fill("#step-count", "250")
        self.page.click("#step")
        self.wait(lambda: abs(self.time() - began - 0.251) < 1e-9, "250 more")
        self.page.click("#reset")
        self.wait(lambda: self.time() == 0, "reset")
        self.page.until("$('#sim-time').textContent === '0.00'")

    def time(self):
        stamp = self.runtime.next("/joint_states")["header"]["stamp"]
        return stamp["sec"] + stamp["nanosec"] * 1e-9

    # Trial

    def test_the_trial_runs_counts_skips_and_stops(self):
        self.page.click("#controller")
        self.tab("tasks")
        self.page.fill("#trial-body .option:nth-of-type(1) input", "120")
        self.page.fill("#trial-body .option:nth-of-type(2) input", "0.05")
        self.page.fill("#trial-body .option:nth-of-type(3) input", "0")
        self.page.click("#trial-start")
        self.page.until("/^[1-9]\\d* reached/.test($('#trial-count').textContent)", why="a target reached")
        self.assertRegex(self.page.text("#trial-clock"), r"^\d+\.\d s left$")
        self.page.click("#controller")
        self.page.until("$('#trial-note').textContent === 'The controller is off, so the arm does not move to the targets.'")
        # Now no target is reached, and only a skip gives another one.
        before = self.runtime.next("/ik_trial/status")["target"]
        self.page.click("#trial-skip")
        self.wait(lambda: self.runtime.next("/ik_trial/status")["target"] != before, "another target")
        self.page.click("#trial-stop")
        self.page.until("$('#trial-clock').textContent.startsWith('ended')")
        self.assertFalse(self.runtime.next("/ik_trial/status")["running"])
        self.page.click("#trial-skip")
        self.page.until("$('#trial-body .refusal').textContent", why="refusal of a skip")
        for typed, why in (("-4", "duration must be greater than 0, got -4"), ("1e", "duration must be a number")):
            self.page.fill("#trial-body .option:nth-of-type(1) input", typed)
            self.page.click("#trial-start")
            self.page.until(f"$('#trial-body .refusal').textContent === '{why}'", why=f"refusal of {typed}")

    # Comparison

    def test_all_methods_are_compared_with_a_reference(self):
        self.tab("compare")
        self.page.run("$('#compare-form select').value = 'rest'")
        self.page.fill(f"#compare-form {NUMBER}", "7")  # 5 s have no whole number of such steps
        self.page.until("!$('#compare-result').hidden", 60, "a result")
        self.page.until("$('#compare-play').textContent === 'Play'", 30, "played to its end")
        for picture in ("arm", "chart"):
            image = self.image(f"#compare-{picture}")
            for method in (1, 2, 3, 4):
                self.assertGreater(image.count(self.color(f"method{method}"), 60), 20, f"method {method} in {picture}")
        rows = self.page.run("$$('#compare-table tbody tr').map((row) => [...row.cells].map((one) => one.textContent))")
        self.assertEqual([row[0] for row in rows], ["Euler", "Midpoint", "Verlet", "RK 4"])
        # The same run by itself, with the runtime's own reference.
        error = self.values("/study/rollout", q0=[0, 0], duration=4.998, timestep=0.007, integrator="rk4", reference=True)["error"]
        self.assertAlmostEqual(float(rows[3][3].removesuffix(" rad").replace("\u2212", "-")) / error, 1, delta=0.1)
        self.assertIn("At 7 ms, against Runge–Kutta 4 at 875 µs", self.page.text("#compare-text"))

    def test_a_comparison_without_a_reference_judges_no_run(self):
        self.tab("compare")
        self.page.run("$$('#compare-form select').forEach((one, i) => { one.value = ['rest', 'on'][i]; })")
        self.page.fill(f"#compare-form {NUMBER}", "1000")
        self.page.until("!$('#compare-result').hidden", 60, "a result")
        self.assertIn("The reference diverged after t = 1.25 s, so no error is known.", self.page.text("#compare-text"))
        euler = self.page.run("$$('#compare-table tbody tr:first-child td').map((one) => one.textContent)")
        self.assertEqual([euler[0], euler[2]], ["–", "–"], euler)

    def test_a_wrong_time_of_a_comparison_is_refused_by_its_own_name(self):
        self.tab("compare")
        press = "$('#compare-form button').click(), "  # does nothing while a comparison is computed
        for times, why in (
            ((10, 0), "duration must be greater than 0"), ((10, -1), "duration must be greater than 0"), ((1000, 0.5),
                "duration must be at least the timestep 1"),
            ((-5, 5), "timestep must be greater than 0"), ((0, 5), "timestep must be greater than 0"),
        ):
            self.page.run(f"$$('#compare-form {NUMBER}').forEach((one, i) => {{ one.value = {list(times)}[i]; }})")
            self.page.until(f"{press}$('#compare-form .refusal').textContent === '{why}'", 20, f"{times}: {why}")
        self.assertTrue(self.page.run("$('#compare-result').hidden"))

    # Keys

    def test_keys_do_what_they_did_on_the_classic_page(self):
        for key, method in (("1", "euler"), ("2", "midpoint"), ("3", "verlet"), ("4", "rk4")):
            self.page.key(key)
            self.wait(lambda: self.values("/arm_sim/set_integrator")["method"] == method, method)
        self.page.key("0")
        self.wait(lambda: self.values("/arm_sim/pause")["data"], "0 pauses")
        self.page.until("$('#pause-text').textContent === 'Run'")
        self.page.key("4")
        self.wait(lambda: not self.values("/arm_sim/pause")["data"], "a method goes on")
        self.page.until("$('#pause-text').textContent === 'Pause'")
        for key, text in (("0", "Run"), (" ", "Pause"), (" ", "Run")):
            self.page.key(key)
            self.page.until(f"$('#pause-text').textContent === '{text}'")
        self.page.key("3")
        self.wait(lambda: self.values("/arm_sim/set_integrator")["method"] == "verlet", "Verlet")
        time.sleep(0.3)
        self.assertTrue(self.values("/arm_sim/pause")["data"], "the space bar has paused it")
        self.page.key(" ")
        for key, on in (("c", True), ("c", False), ("x", True), ("s", False), ("s", False), ("x", True)):
            self.page.key(key)
            self.wait(lambda: self.values("/pid_controller/enable")["data"] is on, key)
            self.page.until(f"$('#controller').ariaChecked === '{str(on).lower()}'")

    def test_q_and_e_move_the_setpoint_of_the_chosen_joint(self):
        self.page.click("#controller")
        self.wait(lambda: self.time() > 1, "a second")
        self.page.click("#reset")
        self.page.until("$('#announce-polite').textContent.startsWith('Reset')")
        self.page.key("j")
        for key, value in (("e", "0.05"), ("e", "0.1"), ("e", "0.15"), ("q", "0.1")):
            self.page.key(key)
            self.page.until(f"$('#setpoint-fields .field:nth-of-type(2) input[type=number]').value === '{value}'")
        self.wait(lambda: abs(self.runtime.next("/joint_states")["position"][1] - 0.1) < 5e-3, "joint 2 at 0.1 rad")

    def test_a_and_d_push_the_arm(self):
        self.runtime.call("/arm_sim/set_params", gravity=0)
        self.runtime.call("/arm_sim/reset")
        self.assertEqual(self.runtime.next("/joint_states")["velocity"], [0, 0])
        self.page.key("a")
        self.wait(lambda: self.runtime.next("/joint_states")["velocity"][0] > 0.1, "pushed counter-clockwise")
        self.runtime.call("/arm_sim/reset")
        self.page.key("d")
        self.wait(lambda: self.runtime.next("/joint_states")["velocity"][0] < -0.1, "pushed clockwise")
        # A push is short, so a busy page may miss it.
        self.wait(lambda: self.page.key("a") or self.page.text("#legend-drift-name") == "pushed in", "energy that was pushed in")

    def test_keys_do_not_act_in_text_fields_and_can_be_switched_off(self):
        self.page.run("$('#masses-fields input[type=number]').focus()")
        self.page.key("c")
        self.page.run("document.activeElement.blur()")
        self.page.key("?", shift=True)
        self.page.until("$('#help').open")
        self.page.click("#shortcuts-on")
        self.page.click("#help-close")
        self.page.key("c")
        self.page.run("new Promise((done) => setTimeout(done, 300))")
        self.assertFalse(self.values("/pid_controller/enable")["data"])
        self.page.run("localStorage.clear()")

    def test_everything_is_reached_by_the_tab_key_and_named(self):
        named = self.page.run("""$$('button, input, select, summary, canvas[tabindex]')
            .filter((one) => one.checkVisibility() && !(one.textContent.trim() || one.ariaLabel || one.labels?.length || one.title))
            .map((one) => one.outerHTML)""")
        self.assertEqual(named, [])
        seen = set()
        for _ in range(120):
            self.page.key("Tab")
            seen.add(self.page.run("document.activeElement.id"))
        missing = {"share", "theme", "help-button", "arm", "pause", "step", "reset", "controller", "plot-save", "tab-plots", "defaults"} - seen
        self.assertEqual(missing, set())

    # Links to share

    def test_a_link_changes_nothing_until_it_is_applied(self):
        page = self.open("#method=verlet&timestep=0.002&gravity=1.62&masses=1,2&controller=on")
        page.until("!$('#offer').hidden")
        page.run("new Promise((done) => setTimeout(done, 500))")
        self.assertEqual(self.values("/arm_sim/set_params")["gravity"], 9.81)
        page.run("$('#offer button').focus()")
        page.key("Enter")
        self.wait(lambda: self.values("/arm_sim/set_params") == {"gravity": 1.62, "masses": [1, 2], "lengths": [1, 1]}, "parameters")
        self.wait(lambda: self.values("/arm_sim/set_integrator") == {"method": "verlet", "timestep": 0.002}, "integrator")
        self.wait(lambda: self.values("/pid_controller/enable")["data"], "the controller")
        page.until("$('#offer').hidden")
        self.assertEqual(page.run("document.activeElement.id"), "arm", "the focus is not lost")

    def test_a_refused_setting_of_a_link_is_shown(self):
        for link, why in (
            ("setpoint=1,2,3", "setpoint must have 2 entries, got 3"), ("setpoint=abc,1", "setpoint 1 must be a number"), ("gravity=",
                "gravity must be a number"),
            ("method=foo&gravity=3", 'method must be one of euler, midpoint, verlet, rk4, got "foo"'), ("controller=maybe",
                'controller must be on or off, got "maybe"'),
        ):
            self.page.run(f"location.hash = '{link}'")
            self.page.until(f"$('#offer .offer-text')?.textContent.startsWith('{link.split('=')[0]}')", why=link)
            self.page.click("#offer button")
            self.page.until(f"$('#offer .refusal').textContent === '{why}'", why=f"{link}: {why}")

class ThreeLinks(PageTest):
    links = 3

    def test_a_goal_may_have_an_orientation(self):
        self.page.click("#controller")
        self.tab("tasks")
        for i, value in enumerate(("1.2", "1.1", "0.5"), 1):
            self.page.fill(f"#goal-body .option:nth-of-type({i}) input", value)
        self.page.until("$('#goal-text').textContent.startsWith('Reached')")
        # Joints may have turned right round: an orientation is the same after a whole turn.
        turned = lambda: math.remainder(sum(self.runtime.next("/joint_states")["position"]) - 0.5, 2 * math.pi)
        self.wait(lambda: abs(turned()) < 0.06, "the orientation")
