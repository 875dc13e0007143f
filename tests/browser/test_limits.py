"""Limits: a blow-up is seen and left in one click; figures and map are those of the loop in force, and errors are measured live."""

import json
import math
import time

from chromium import close
from stage import NUMBER, PageTest, milliseconds, needs_server
from test_layout import CLIPPED
FREE = {key: [0, 0] for key in ("kp", "ki", "kd")}


class BlowUp(PageTest):
    def diverge(self):
        self.runtime.call("/arm_sim/set_integrator", method="euler", timestep=0.02)
        self.page.click("#controller")
        self.page.until("$('#run-state').textContent === 'diverged'")

    def click_map(self, timestep, factor):
        """A click at a timestep between 0.1 ms and 100 ms, and at a multiple of the gains between 1/16 and 16."""
        left, top, width, height = self.page.box("#map")
        place = left + 46 + (width - 56) * math.log10(timestep / 1e-4) / 3, top + height - 32 - (height - 40) * (0.5 + math.log(factor, 256))
        self.page.mouse("mousePressed", *place)
        self.page.mouse("mouseReleased", *place)

    def test_the_growth_is_a_picture_with_a_scale_that_can_be_read(self):
        self.diverge()
        self.page.until(r"/^Diverged at t = [\d.]+ s\. /.test($('#notice').textContent)")
        self.assertGreater(self.image("#arm").count(self.color("bad")), 500)
        # The plot shows more than one line along an axis and a spike: the line is at several heights.
        def heights():
            picture, color = self.image("#plot-velocity"), self.color("joint1")
            return {y // 12 for y in range(picture.height) for x in range(picture.width // 2, picture.width) if close(picture[x, y], color)}

        self.wait(lambda: len(heights()) >= 4, "the growth")
        self.runtime.call("/arm_sim/set_integrator", method="rk4", timestep=0.001)
        self.page.press("#notice", "Restart")
        self.page.until("$('#run-state').textContent === 'running'")
        self.assertEqual(self.values("/arm_sim/set_integrator")["timestep"], 0.001)

    def test_a_click_in_the_map_brings_an_arm_that_has_diverged_back(self):
        self.tab("stability")
        self.diverge()
        begin_anew = "$$('#notice button').some((one) => one.textContent === 'Restart')"
        self.page.until(begin_anew)
        self.click_map(2e-4, 4)
        self.page.until("$('#run-state').textContent === 'running'")
        self.page.until("$('#verdict-pill').textContent === 'stable'")
        self.assertLess(abs(math.log(self.values("/arm_sim/set_integrator")["timestep"] / 2e-4)), 0.05)
        self.assertLess(abs(math.log(self.values("/pid_controller/set_gains")["kp"][0] / 4000)), 0.05)

    def test_an_arrow_key_in_the_map_changes_one_quantity_in_its_direction(self):
        present = lambda: (self.values("/arm_sim/set_integrator")["timestep"], self.values("/pid_controller/set_gains")["kp"][0])
        self.tab("stability")
        for timestep, steps in ((1e-5, (("ArrowLeft", 1e-5, 1000), ("ArrowUp", 1e-5, 1100), ("ArrowRight", 1.1e-5, 1100))),
                                (0.5, (("ArrowRight", 0.5, 1100), ("ArrowDown", 0.5, 1000), ("ArrowLeft", 0.455, 1000)))):
            self.runtime.call("/arm_sim/set_integrator", timestep=timestep)
            self.page.until(f"own('store.js').then(({{ state }}) => state.integrator?.timestep === {timestep})")
            self.page.run("$('#map').focus()")
            for key, *wanted in steps:
                self.page.key(key)
                self.wait(lambda: present() == tuple(wanted), f"{key}: {wanted}")
                self.page.until(f"own('store.js').then(({{ state }}) => state.integrator.timestep === {wanted[0]} && state.gains.kp[0] === {wanted[1]})")

    def test_one_button_recovers(self):
        self.diverge()
        button = self.page.until("$$('#notice button').find((one) => one.textContent.startsWith('Restart at'))?.textContent")
        self.assertRegex(button, r"^Restart at [\d.]+ ms$")
        self.page.run("""(window.said = "", new MutationObserver(() => { said += $('#notice').textContent; })
            .observe($('#notice'), { childList: true, characterData: true, subtree: true }),
            $('#notice button').focus())""")
        self.page.key("Enter")
        self.page.until("$('#run-state').textContent === 'running'")
        self.page.until("$('#verdict-pill').textContent === 'stable'")
        self.assertNotIn("moving", self.page.run("said"), "the limit is not of the motion that diverged")
        self.assertEqual(self.page.run("document.activeElement.id"), "arm", "the focus is not lost")
        end = time.monotonic() + 1.5
        while time.monotonic() < end:
            self.assertEqual(self.page.text("#run-state"), "running")
            time.sleep(0.1)

    def test_a_push_dies_away_below_the_limit_and_flips_and_grows_beyond(self):
        self.tab("stability")
        self.page.until("$('#push-text').textContent.includes('nothing damps the push')")
        self.page.click("#controller")
        self.page.until("$('#push-text').textContent.includes('at 1 ms: the push shrinks')")
        self.page.fill(f"#timestep-field {NUMBER}", "6")
        self.page.until("$('#push-text').textContent.includes('at 6 ms: the push does not shrink')")
        picture = self.image("#push-bars")
        self.assertGreater(picture.count(self.color("bad")), 200)
        self.assertGreater(picture.count(self.color("accent")), 200)
        self.runtime.call("/pid_controller/set_period", period=0.006)
        self.page.fill(f"#timestep-field {NUMBER}", "0.5")
        self.page.until("$('#push-text').textContent.includes('a control period of 6 ms: the push does not shrink')")

    def test_error_against_run_time_is_measured_live(self):
        self.tab("error")
        self.page.fill(f"#ladder-form {NUMBER}", "1")
        self.page.until("$$('#ladder-table tbody tr').length === 8")
        cells = self.page.run("$$('#ladder-table tbody tr').map((row) => [...row.cells].map((one) => one.textContent))")
        number = lambda text: float(text.replace("\u2212", "-"))
        # From 4 ms to 2 ms: by 2, 4, 4 and 16, within a factor, for a free swing of a second.
        for column, factor in ((1, 2), (2, 4), (3, 4), (4, 16)):
            ratio = number(cells[3][column]) / number(cells[4][column])
            self.assertTrue(factor / 2 < ratio < 2 * factor, f"{ratio} for {factor}")
        for method in range(1, 5):
            self.assertGreater(self.image("#ladder").count(self.color(f"method{method}")), 40)
        self.assertIn("costs least", self.page.text("#ladder-text"))

    def test_an_error_that_was_measured_is_not_shown_for_another_run_or_arm(self):
        cell = "$('#ladder-table tbody tr:last-child td:last-child')?.textContent ?? ''"
        self.tab("error")
        self.page.fill(f"#ladder-form {NUMBER}", "1")
        first = self.page.until(cell)
        self.page.fill(f"#ladder-form {NUMBER}", "60")
        self.page.until("$('#ladder-text').textContent.startsWith('No run came within')", 300)
        self.assertNotEqual(self.page.run(cell), first)
        self.page.expect_network_errors = True
        self.runtime.restart(links=3)
        self.connected(links=3)
        self.assertEqual(self.page.run(cell), "")


class Right(PageTest):
    """No figure outlives what it is about."""

    def setpoint_fields(self, page=None):
        return (page or self.page).run(f"$$('#setpoint-fields {NUMBER}').map((one) => Number(one.value))")

    def shows_setpoint(self, wanted, page=None, why="setpoint"):
        self.wait(lambda: self.setpoint_fields(page) == wanted, f"{why}: {wanted}")

    def test_each_integrators_button_has_its_limit_in_the_active_loop(self):
        def served(method):
            values = self.values("/study/stability", integrator=method, **self.asked)
            held, motion = values["timestep_limit_held"], values["timestep_limit_motion"]
            if self.asked and method == "midpoint":
                # The energy of the fastest small swing doubles in ten minutes at this timestep, to the lowest order.
                held = (4 * math.log(2) / 600 / (2 * math.pi * values["critical"]["frequency"]) ** 4) ** (1 / 3)
            limit = min(held, math.inf if motion is None else motion)
            return "no timestep" if limit == 0 else milliseconds(limit)

        def shown():
            return self.page.run("Object.fromEntries($$('#methods .segment').map((one) =>"
                                 " [one.querySelector('input').value, one.querySelector('.limit').textContent]))")

        methods = ("euler", "midpoint", "verlet", "rk4")
        self.asked = {"gains": FREE}
        self.wait(lambda: shown() == {method: served(method) for method in methods}, "the arm left to itself")
        self.asked = {}
        self.page.click("#controller")
        self.wait(lambda: shown() == {method: served(method) for method in methods}, "the controller")
        self.page.fill(f"#kd-fields {NUMBER}", "60")
        self.wait(lambda: shown() == {method: served(method) for method in methods}, "other gains")

    def test_one_button_explains_the_limit_and_stays_while_limits_are_computed_anew(self):
        self.page.click("#controller")
        self.page.until("$('#why').checkVisibility()")
        self.page.click("#why")
        self.wait(lambda: self.values("/pid_controller/enable")["data"], "the controller")
        begins = f"Why {milliseconds(self.values('/study/stability')['timestep_limit_held'])}: "
        shown = "$('#why-text')"
        text = self.page.until(f"{shown}.checkVisibility() && {shown}.textContent.startsWith({json.dumps(begins)}) && {shown}.textContent")
        self.assertIn("overshoots", text)
        self.page.run("""(window.hidings = 0, new MutationObserver(() => window.hidings++)
            .observe($('#why'), { attributeFilter: ['hidden'] }))""")
        self.runtime.call("/pid_controller/set_gains", kp=[30, 30], kd=[3, 3])
        self.page.until(f"({shown}.textContent || {json.dumps(text)}) !== {json.dumps(text)}")
        self.assertEqual(self.page.run("window.hidings"), 0)
        # The reason has a different height for each setting: a click on the map must not miss it.
        top = "$('#map').getBoundingClientRect().top"
        self.assertEqual(*self.page.run(f"[{top}, ({shown}.textContent = '', {top})]"))

    def test_a_mark_of_a_target_goes_once_the_arm_is_sent_elsewhere(self):
        self.page.click("#controller")
        self.runtime.call("/ik_action/send_goal", x=0.4, y=1.1)
        self.page.until("own('store.js').then(({ state }) => state.goal?.outcome === 'reached')")
        self.page.run("own('runtime.js').then((arm) => arm.sendSetpoint([0.1, 0.2]))")
        self.page.until("own('store.js').then(({ state }) => state.goal === null)")

    def test_a_buttons_figure_is_of_the_present_loop(self):
        self.runtime.call("/arm_sim/set_integrator", timestep=0.01)
        self.page.click("#controller")

        def offered():
            return self.page.run("$('#notice').hidden ? '' : $('#notice button')?.textContent ?? ''")

        def advised():
            return f"Restart at {milliseconds(0.8 * self.values('/study/stability')['minimum_over_poses_held'])}"

        self.wait(lambda: offered() == advised(), "the first")
        first = offered()
        gains = self.values("/pid_controller/set_gains")
        self.runtime.call("/pid_controller/set_gains", kd=[2 * kd for kd in gains["kd"]])
        self.wait(lambda: offered() == advised(), "the second")
        self.assertNotEqual(offered(), first)

    @needs_server("two tabs have an arm each")
    def test_setpoint_fields_show_what_the_arm_has(self):
        self.page.click("#controller")
        self.runtime.call("/ik_action/send_goal", x=0.7, y=1.2)
        self.page.until(f"Number($('#setpoint-fields {NUMBER}').value) !== 0")
        goal = self.setpoint_fields()
        second = self.open()
        self.shows_setpoint(goal, second, "a second tab")
        link = second.run("own('views.js').then((share) => share.address())")
        self.assertIn("setpoint=", link)
        self.page.click("#reset")
        self.shows_setpoint([0, 0], why="after a reset")
        self.shows_setpoint([0, 0], second, "after a reset, in the other tab")
        for page in (self.page, second):
            page.expect_network_errors = True
        self.page.run("own('runtime.js').then((arm) => arm.sendSetpoint([0.5, 0.25]))")
        self.shows_setpoint([0.5, 0.25])
        self.runtime.restart()
        self.page.until("$('#connection').className === 'pill open'")
        self.shows_setpoint([0, 0], why="after a restart")

    def test_numbers_are_short_whole_and_not_clipped(self):
        self.page.run("own('runtime.js').then((arm) => arm.sendSetpoint([-3.75616e73, 3.00591098005247]))")
        self.page.until(f"$('#setpoint-fields {NUMBER}').value === '-3.756e+73'")
        self.assertEqual(self.setpoint_fields()[1], 3.006)
        self.assertEqual(self.page.run(CLIPPED), [])


class Robot(PageTest):
    """The limit of any robot: one form, in the Workbench and in the course's last step."""

    answer = "$('{0} .robot-answer').textContent"

    def form(self, place):
        """Opens the form by the keyboard."""
        self.page.until(f"$('{place} .robot summary') !== null")
        self.page.run(f"$('{place} .robot summary').focus()")
        self.page.key("Enter")
        self.page.until(f"$('{place} .robot textarea').value !== ''", why="the present arm")

    def asks(self, place, **values):
        """Writes into fields, by their labels, and presses the button. The answer, or the refusal."""
        for label, value in values.items():
            self.page.run(f"""(() => {{ const field = $$('{place} .robot label')
                .find((one) => one.textContent.startsWith({json.dumps(label.replace("_", " "))})).querySelector('textarea, input, select');
                field.value = {json.dumps(value)}; field.dispatchEvent(new Event('input', {{ bubbles: true }})); }})()""")
        self.assertEqual(self.page.run(self.answer.format(place)), "", "an answer goes with a change")
        self.page.click(f"{place} .robot button[type=submit]")
        return self.page.until(f"{self.answer.format(place)} || $('{place} .robot .refusal').textContent")

    def test_the_form_begins_with_the_arm_and_its_limit_and_takes_any_matrix(self):
        pose = [0.9, -1.3, 0.4][:self.links]
        self.runtime.call("/arm_sim/set_friction", viscous=[0.4] * self.links)
        self.settle(pose)
        for place in ("#stability", "#course"):
            if place == "#course":
                self.page.click("#view-switch")
                self.page.click("#course-steps [data-step=own]")
                self.page.until("!$('#course-dial').inert", why="the scene")
                pose = [0] * self.links
            else:
                self.tab("stability")
            self.page.until(f"own('store.js').then(({{ state }}) => state.limits.answers.rk4?.equilibrium?.every((q, i) => "
                f"Math.abs(q - {pose}[i]) < 1e-3))", why="the limits there")
            self.form(place)
            limit = self.values("/study/stability")["control_period_limit"]
            self.assertIn(f"Longest control period: {milliseconds(limit)}", self.asks(place))
            # A copied matrix of seven joints, as numpy prints it.
            rows = [[7 - max(i, j) + (i == j) * 0.5 for j in range(7)] for i in range(7)]
            told = self.asks(place, mass="[" + "\n ".join(str(row) for row in rows) + "]", kp="40", ki="", kd="3,3,3,3,3,3,2", damping="0", stiffness="",
                motion="semi_implicit", delay="1", steps="2")
            wanted = self.values("/study/held_limit", mass_matrix=sum(rows, []), kp=[40], kd=[3] * 6 + [2], delay=1, between="semi_implicit", steps=2)
            self.assertIn(f"Longest control period: {milliseconds(wanted['period_limit'])}", told)
            self.assertIn("joint 7 ", told)
            for field, value, said in (("mass", "1 2\n3", "M must have n² entries, got 3"), ("mass", "1 2 3 1", "M must be symmetric: M at row 2, column 1"),
                    ("kp", "stiff", "kp must be an array of numbers"), ("kd", "1 2 3", "kd must have"), ("control", "0", "control period must be"),
                    ("delay", "9", "delay must be"), ("steps", "0", "steps must be")):
                self.asks(place, mass="2 0.1\n0.1 1", kp="40", kd="3", control="4", delay="0", steps="1")
                self.assertIn(said, self.asks(place, **{field: value}))
            self.page.run(f"$$('{place} .robot button').at(-1).click()")
            self.assertIn(f"Longest control period: {milliseconds(limit)}", self.asks(place, motion="exact", steps="1"))


class RobotOfThreeLinks(Robot):
    links = 3
