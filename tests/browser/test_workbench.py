"""The workbench: there is always a way back; plots share one cursor; gains are offered, and a page that is still does little."""

import json
import time

from stage import NUMBER, PageTest, needs_server


class Ways(PageTest):
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
        self.page.click("#defaults")
        self.wait(lambda: self.values("/arm_sim/set_params") == {"gravity": 9.81, "masses": [1, 1], "lengths": [1, 1]}, "defaults")

    def test_a_refusal_and_a_pause_cannot_be_undone(self):
        self.page.until("own('store.js').then(({ state }) => state.setpointKnown)")
        self.page.click("#pause")
        self.page.until("$('#run-state').textContent === 'paused'")
        self.page.click("#pause")
        self.page.until("$('#run-state').textContent === 'running'")
        self.page.fill(f"#timestep-field {NUMBER}", "-1")
        self.page.until("$('#timestep-field .refusal').textContent === 'timestep must be greater than 0'")
        self.assertTrue(self.page.run("$('#undo').disabled"))
        self.page.fill(f"#timestep-field {NUMBER}", "2")
        self.page.until("!$('#undo').disabled")
        self.page.run("$('#undo').focus()")
        self.page.key("Enter")
        self.wait(lambda: self.values("/arm_sim/set_integrator")["timestep"] == 0.001, "undone")
        self.page.until("$('#undo').disabled && document.activeElement.id === 'arm'", why="the focus is not lost")

    def test_one_cursor_is_on_all_plots(self):
        self.page.until("own('history.js').then(({ record }) => record.length > 120)")
        self.pause()
        self.wait(lambda: self.drawn(0.5) == 0, "the figures are those of the last state")
        now = self.page.text("#legend-velocity")
        x, y = self.page.place("#plot-position")
        self.page.mouse("mouseMoved", x + 150, y)
        self.page.until(f"$('#legend-velocity').textContent !== {json.dumps(now)}")
        self.page.mouse("mouseMoved", 5, 5)
        self.page.until(f"$('#legend-velocity').textContent === {json.dumps(now)}")

    def test_plots_can_be_zoomed_and_their_scales_fixed(self):
        self.page.key("+")
        self.page.until("$('#plot-span').value === '5'")
        self.page.key("-")
        self.page.until("$('#plot-span').value === '10'")
        self.page.click("#plot-fix")
        self.page.until("$('#plot-fix').getAttribute('aria-pressed') === 'true'")


class Defaults(PageTest):
    def test_the_pages_defaults_are_what_the_runtime_starts_with(self):
        present = {
            "integrator": self.values("/arm_sim/set_integrator"), "params": self.values("/arm_sim/set_params"),
            "gains": self.values("/pid_controller/set_gains"), "controller": self.values("/pid_controller/enable")["data"],
            "friction": self.values("/arm_sim/set_friction"),
            "motors": self.values("/pid_controller/set_limits"), "sensors": self.values("/pid_controller/set_sensors"),
            "period": {key: value for key, value in self.values("/pid_controller/set_period").items() if key != "effective_period"},
        }
        self.assertEqual(self.page.run(f"own('settings.js').then(({{ DEFAULTS }}) => DEFAULTS[{self.links}])"), {**present, "setpoint": [0] * self.links})


class DefaultsThreeLinks(Defaults):
    links = 3


class Suggestion(PageTest):
    def test_gains_are_suggested_where_no_timestep_is_stable(self):
        before = self.values("/pid_controller/set_gains")
        # Springs that are far too weak for gravity: no timestep is stable at this pose, and the notice has a button for
        # it.
        self.runtime.call("/pid_controller/set_gains", kp=[1, 1], ki=[3000, 3000], kd=[0, 0])
        self.runtime.call("/pid_controller/enable", data=True)
        self.page.until("$$('#notice button').some((one) => one.textContent === 'Suggest gains')")
        weak = self.values("/pid_controller/set_gains")
        self.page.press("#notice", "Suggest gains")
        self.wait(lambda: self.values("/pid_controller/set_gains") not in (before, weak), "suggested gains")
        self.page.until("!$('#undo').disabled")
        self.page.click("#undo")
        self.wait(lambda: self.values("/pid_controller/set_gains") == weak, "undone")


class Still(PageTest):
    def test_a_paused_page_draws_no_frame_until_its_arm_is_stepped(self):
        self.wait(lambda: self.drawn(1) > 10, "while it moves it draws")
        self.pause()
        self.wait(lambda: self.drawn(2) == 0, "it comes to rest")
        before = self.page.run(self.frames)
        self.page.click("#step")
        self.page.until(f"{self.frames}.then((now) => now > {before})")

    @needs_server("it counts frames of a WebSocket")
    def test_a_paused_page_receives_few_messages(self):
        def hears():
            """Messages in three seconds, and how long these took."""
            began, before = time.monotonic(), self.page.told
            time.sleep(3)
            return self.page.told - before, time.monotonic() - began

        self.wait(lambda: hears()[0] > 30, "while it moves it hears of every state")
        self.pause()

        def hears_little():
            told, took = hears()
            # Once a second: a joint state, the diagnostics, the answers about nine settings; and one more of each.
            return told <= 11 * (took + 1)

        self.wait(hears_little, "once paused it hears little")

    def test_an_arm_that_the_controller_holds_still_is_not_drawn_in_every_frame(self):
        self.page.click("#controller")
        self.wait(lambda: max(map(abs, self.runtime.next("/joint_states")["velocity"])) < 1e-4, "at rest")
        # At one moment both, and by the page's own clock.
        look = f"{self.frames}.then((frames) => [frames, performance.now() / 1000])"

        def draws_little():
            frames, began = self.page.run(look)
            time.sleep(2)
            frames_then, then = self.page.run(look)
            return frames_then - frames < 15 * (then - began)

        self.wait(draws_little, "the plots move on, ten times a second")
