"""The course: a step sets its scene on a click only, its task ticks itself, its answer is checked, and a link names it."""

import math
import time

from stage import IS_FILE, PageTest, needs_chromium
from test_layout import CLIPPED, PHONE, audit, forget_the_inspectors

STEPS = ("hold", "slow", "pid", "look", "method", "timestep", "limit", "energy", "price", "extreme", "own")
DIAL = "#course-dial input[type=number]"


class CourseTest(PageTest):
    course = True

    def step(self, name):
        self.page.click(f"#course-steps [data-step={name}]")
        self.page.until(f"$('#course-number').textContent === 'Step {STEPS.index(name) + 1} of {len(STEPS)}'")
        self.page.until("$('#course-start').textContent === 'Restart step'")
        self.page.until("!$('#course-dial').inert", why="the scene is set")

    def done(self, why, seconds=60):
        self.page.until("$('#course-task').className === 'done'", seconds, why)

    def answer(self, text):
        self.page.press("#course-question", text)

    def anew(self, act):
        """Waits until the arm begins anew because of an action."""
        self.page.run("""own('store.js').then(({ state, watch }) => { window.least = Infinity;
            watch('version', () => { window.least = Math.min(window.least, state.time); }); })""")
        act()
        self.page.until("window.least < 0.1", why="the arm begins anew")

    def big(self):
        return self.page.text("#course-figure")


class Tasks(CourseTest):
    def test_the_course_comes_first_and_a_link_begins_its_step_in_the_file_and_waits_at_a_server(self):
        def settings():
            return self.values("/pid_controller/set_gains"), self.values("/arm_sim/set_integrator"), self.values("/pid_controller/enable")

        self.assertTrue(self.page.run("$('#course').checkVisibility() && !$('#controls').checkVisibility()"))
        before = settings()
        page = self.open("#step=4")
        page.until("$('#course-title').textContent === 'A better method?'")
        if IS_FILE:
            page.until("$('#course-start').textContent === 'Restart step'")
            self.wait(lambda: self.values("/pid_controller/enable")["data"], "the controller")
        else:
            page.until("$('#course-status').textContent.startsWith('Press')")
            time.sleep(0.5)
            self.assertEqual(page.text("#course-start"), "Start")
            self.assertEqual(settings(), before)

    def test_holding_ticks_when_the_tip_arrives(self):
        self.page.run("$('input[name=drag][value=setpoint]').click(), $$('#goal-body input')[4].value = 100")  # as left in the Workbench
        self.page.click("#course-start")
        self.page.until("$('#controller').checkVisibility() && $('#controller').textContent === 'Controller on'", why="keys may change it")
        self.page.drag(self.on_canvas((1.9, 0.1)), self.on_canvas((0.6, 1.2)))
        self.done("the tip has arrived")
        self.wait(lambda: math.dist(self.runtime.end_effector(), (0.6, 1.2)) < 0.02, "where the drag ended")
        for text, verdict in (("It sets them to zero", "Not that one"), ("It holds the torques as they are", "Right.")):
            self.answer(text)
            self.page.until(f"$('#course-question .note').textContent.startsWith('{verdict}')")

    def test_the_mark_comes_after_the_guess_and_the_shaking(self):
        self.step("slow")
        self.assertFalse(self.page.run(f"$('{DIAL}')?.checkVisibility() ?? false"))
        self.answer("about 50 ms")
        self.page.until(f"$('{DIAL}').checkVisibility()")
        self.assertTrue(self.page.run("$('#course-dial .mark').hidden"))
        self.page.fill(DIAL, "5.5")
        self.done("the arm shakes")
        self.page.until("$('#course-figure').textContent === '5.5 of 4.3 ms'")
        self.assertFalse(self.page.run("$('#course-dial .mark').hidden"))
        self.assertIn("You guessed about 50 ms", self.page.text("#course-question"))

    def test_guess_figure_and_answer_are_kept_on_one_sheet(self):
        self.step("slow")
        self.answer("at 3 to 5 ms")
        self.page.fill(DIAL, "5.5")
        self.done("the arm shakes")
        self.answer("It falls")
        self.page.reloads("location.reload()", "$('#connection')?.className === 'pill open'")
        self.page.click("#answers-open")
        row = "$$('#answers-table tbody tr')[1]"
        self.assertEqual(self.page.run(f"[...{row}.cells].map((one) => one.textContent)"), ["2. Slow the controller down", "5.5 of 4.3 ms control period",
            "at 3 to 5 ms ✓", "Just below the limit, what does the arm do?", "It falls ✗"])
        self.assertIn("period=0.0055", self.page.run(f"{row}.querySelector('a').hash"))
        self.assertEqual(audit(self.page), [])
        forget_the_inspectors(self.page)

    def test_bars_flip_and_grow_beyond_the_limit_and_shrink_below(self):
        self.step("look")
        self.wait(lambda: all(self.image("#course-chart").count(self.color(one)) > 500 for one in ("bad", "accent")), "bars that point down and up")
        self.assertNotEqual(self.page.run("$('#course-task').className"), "done")
        self.page.click("#view-switch")
        self.page.until("own('store.js').then(({ state }) => state.paused && new Promise((done) => setTimeout(done, 600, true)))")
        self.page.click("#view-switch")
        begun = self.page.run("own('store.js').then(({ state }) => state.time)")
        self.wait(lambda: 0.005 < self.page.run("own('store.js').then(({ state }) => state.time)") - begun < 0.05, "slow motion, by control periods")
        self.page.fill(DIAL, "3")
        self.done("bars that shrink")

    def test_all_methods_stop_at_one_period(self):
        self.step("method")
        for method in ("euler", "midpoint", "verlet", "rk4"):
            self.page.click(f"#course-extra [data-method={method}]")
            self.wait(lambda: self.values("/arm_sim/set_integrator")["method"] == method and self.big() == "5.5 of 4.3 ms", method)
        self.done("all four methods")

    def test_a_finer_timestep_helps_the_method_only(self):
        self.step("timestep")
        self.page.until("$('#course-figure').textContent === '4 ms'")
        self.wait(lambda: self.image("#course-chart").count(self.color("bad")) > 500, "the first errors")
        self.page.until("$('.outdated') === null")
        self.page.run("""new MutationObserver(() => { window.faint ||= $('.outdated') !== null; })
            .observe($('#course-chart'), { attributes: true })""")
        self.page.fill(DIAL, "0.2")
        self.done("a hundred times smaller")
        self.assertTrue(self.page.run("window.faint && $('.outdated') === null"), "old errors are faint")
        self.assertEqual(self.page.text("#course-caption"), "Two errors of one move: Midpoint, control period 4 ms")
        self.runtime.call("/arm_sim/set_integrator", method="verlet")
        self.page.until("$('#course-caption').textContent.includes('Verlet')")
        self.page.fill(DIAL, "3")
        self.page.until(f"$('#course-dial .refusal').textContent === 'The timestep is 4 ms, because it must divide the "
            f"control period.' && !$('{DIAL}').ariaInvalid")
        self.assertAlmostEqual(self.values("/pid_controller/set_period")["effective_period"], 0.004, delta=1e-9)

    def test_less_damping_makes_the_period_stable(self):
        self.step("limit")
        self.page.until("$('#course-figure').textContent === '5.5 of 4.3 ms'")
        self.wait(lambda: self.image("#course-chart").count(self.color("unstable")) > 500, "the map")
        self.assertEqual(self.page.run("$$('[data-mass][aria-pressed=true]').map((one) => one.dataset.mass)"), ["1"])
        self.page.fill(DIAL, "0.5")
        self.done("stable")
        self.assertRegex(self.big(), r"^5\.5 of (8\.\d|9) ms$")

    def test_the_energy_is_kept_by_another_method(self):
        self.step("energy")
        self.page.until(r"/^\+\d/.test($('#course-figure').textContent) && $('#course-big').classList.contains('bad')", why="Euler gains")
        self.page.fill(DIAL, "40")
        self.page.until("own('store.js').then(({ state }) => state.time > 0.2)")
        self.anew(lambda: self.page.click("#course-extra [data-method=verlet]"))
        self.page.until("Number($('#course-figure').textContent.replace('\u2212', '-').slice(0, -2)) < -1", why="lost energy is no success")
        self.assertEqual(self.page.run("[$('#course-big').className, $('#course-task').className]"), ["course-big bad", ""])
        self.page.click("#course-extra [data-method=rk4]")
        self.page.fill(DIAL, "5")
        self.done("a method that keeps it")
        self.assertRegex(self.big(), r"^[\u2212+]?0\.\d\d J$")
        self.assertGreaterEqual(self.page.run("own('store.js').then(({ state }) => state.time)"), 10)
        self.assertFalse(self.values("/pid_controller/enable")["data"])

    def test_a_diverged_arm_restarts_with_its_settings(self):
        self.step("limit")
        self.page.fill(DIAL, "4")
        self.page.until("$('#course-again').checkVisibility()", why="it diverged")
        self.anew(lambda: self.page.click("#course-again"))
        self.assertEqual(self.values("/pid_controller/set_gains")["kd"], [440, 88], "the gains are kept")
        self.page.until("$('#course-again').checkVisibility()", why="it diverged again")
        self.page.fill(DIAL, "0.5")
        self.page.until("$('#run-state').textContent === 'running'", why="a change restarts it")
        self.done("stable")

    def test_the_slow_motion_begins_again_with_another_period(self):
        self.step("look")
        look = "own('store.js').then(({ state }) => [state.time, state.position[1]])"
        self.wait(lambda: self.page.run(look)[0] > 0.02, "four measurements")
        self.page.fill(DIAL, "3")
        self.wait(lambda: self.page.run(look)[0] < 0.01 and abs(self.page.run(look)[1] - 0.02) < 0.005, "from the offset")
        self.wait(lambda: self.page.run(look)[0] > 0.01, "and on")

    def test_three_gains_show_a_sag_an_overshoot_windup_and_its_cure(self):
        def response(*act):
            """What the next whole response has shown."""
            act[0](*act[1:])
            self.page.until("own('store.js').then(({ state }) => state.time < 3)", why="a change starts the move again")
            self.page.until("$('#course-what').textContent.startsWith('overshoot;')", why="a whole response")
            return self.page.text("#course-status")

        def gain(place, value):
            self.page.fill(f"#course-dial .field:nth-child({place}) input[type=number]", value)

        def motors(anti_windup):
            self.page.click(f"#course-extra [data-motors*={anti_windup}]")

        self.step("pid")
        self.assertIn("Shown: sag", response(gain, 2, "0"))
        self.assertIn("overshoot", response(gain, 2, "900"))
        response(gain, 2, "60")
        self.assertIn("windup", response(motors, "none"))
        self.assertEqual(self.values("/pid_controller/set_limits")["effort"], [30, 10])
        self.assertNotEqual(self.page.run("$('#course-task').className"), "done")
        response(motors, "conditional")
        self.done("a cure")
        self.keep("pid")
        self.assertTrue(self.page.run("$('#course-steps [data-step=pid]').classList.contains('done')"), "a tick at the number")
        self.assertIn("done=pid&", self.page.run("own('views.js').then((share) => share.address())"))
        self.step("method")
        self.assertEqual(self.values("/pid_controller/set_limits")["effort"], None, "the next scene has no limit")
        page = self.open("#step=own&done=hold,nonsense")
        page.until("$$('#course-steps .done').map((one) => one.dataset.step).join() === 'hold,pid'", why="kept, and carried by a link")

    def test_the_browsers_back_leads_to_the_step_before(self):
        self.step("slow")
        self.step("look")
        self.assertEqual(self.page.run("location.hash"), "#step=look")
        for title in ("Slow the controller down", "A controller holds the arm"):
            self.page.run("history.back()")
            self.page.until(f"$('#course-title').textContent === '{title}'")

    @needs_chromium("a window of any size")
    def test_no_chart_is_black_after_a_change_of_size(self):
        self.step("method")
        # A copy is read, because a canvas that is read often complains.
        self.page.run("""window.darkest = 255; new ResizeObserver(() => { for (const one of $$('#arm, #course-chart')) {
            const copy = new OffscreenCanvas(1, 1).getContext('2d');
            copy.drawImage(one, 1, 1, 1, 1, 0, 0, 1, 1);
            window.darkest = Math.min(window.darkest, Math.max(...copy.getImageData(0, 0, 1, 1).data.slice(0, 3)));
        } }).observe($('#course-chart'))""")
        for height in (700, 800, 640):
            self.page.send("Emulation.setDeviceMetricsOverride", {"width": 1440, "height": height, "deviceScaleFactor": 1, "mobile": False})
            time.sleep(0.3)
        self.assertGreater(self.page.run("window.darkest"), 200)

    def test_pictures_run_their_scenes(self):
        self.step("extreme")
        self.assertEqual(self.page.run("$$('.picture').filter((one) => getComputedStyle(one).opacity === '1').length"), 43, "all can be read")
        self.assertEqual(self.page.run("$$('.picture').filter((one) => one.checkVisibility() && !one.disabled).length"), 12, "good ones first")
        self.page.click("#scene-S08")
        self.wait(lambda: self.values("/pid_controller/set_gains")["kp"] == [1e6, 1e6], "stiff gains")
        self.page.until("$('#course-chart').checkVisibility()")
        self.wait(lambda: all(self.image("#course-chart").count(self.color(one)) > 100 for one in ("good", "bad")),
            "the correct motion, and the one that fails")
        self.keep("motions")
        self.page.click("#course-extra summary")
        self.page.click("#scene-S35")
        self.page.until("$('#course-status').textContent.includes('mass 1 must be greater than 0')", why="refused, with the reason")
        self.page.click("#scene-S33")  # its grid has steps of 1e-161 m
        self.page.until("$('#course-status').textContent.endsWith('The live arm diverged.')")
        self.assertNotEqual(self.page.run("$('#course-task').className"), "done", "two scenes, and one that was refused")
        self.page.click("#scene-S27")
        self.done("three scenes")
        self.wait(lambda: self.values("/arm_sim/set_params")["gravity"] == 981, "strong gravity")

    def test_a_picture_for_three_links_opens_that_arm_in_the_file_and_says_how_at_a_server(self):
        self.step("extreme")
        if not IS_FILE:
            self.assertIn("start pendularm with --links 3", self.page.text("#scene-S01:disabled").replace("\u2060", "").replace("\xa0", " "))
            return
        self.page.reloads("$('#scene-S01').click()", "$('#links')?.value === '3'")
        self.page.until("$('#course-number').textContent === 'Step 10 of 11' && !$('#scene-S01').disabled")

    def test_the_sheet_agrees_with_the_study_and_does_not_change_the_arm(self):
        self.step("own")
        self.wait(lambda: self.values("/pid_controller/enable")["data"], "the scene")
        gains = self.values("/pid_controller/set_gains")
        self.page.fill("#own-form .option:nth-child(10) input", "44")
        self.page.click("#own-form button")
        self.done("a sheet")
        limit = 1e3 * self.values("/study/stability", gains={**gains, "kd": [110, 44]}, setpoint=[0, 0], control_period=0)["control_period_limit"]
        self.assertIn(f"stretched out{float(format(limit, '.3g')):g} ms", self.page.text("#sheet"))
        move = {"q0": [0, 0], "qdot0": [0, 0], "setpoint": [0.9, -1.3], "duration": 2, "timestep": 0.001, "samples": 101, "reference": True}
        error = self.values("/study/rollout", gains={**gains, "kd": [110, 44]}, control_period=0, integrator="euler", **move)["error"]
        self.assertIn(f"at 1 ms, Euler{error:.2g}", self.page.text("#sheet"))
        self.assertIn("kd=110,44", self.page.text("#sheet a"))
        self.assertEqual(self.values("/pid_controller/set_gains"), gains)
        self.page.run("$$('#own-form .option:nth-child(n + 5):nth-child(-n + 10) input').forEach((one) => { one.value = 0; })")
        press = "$('#own-form button').click(), "  # does nothing while a sheet is computed
        self.page.until(press + "$('#sheet').textContent.includes('Reason: all gains are 0')")
        self.page.fill("#own-form .option:nth-child(1) input", "")
        self.page.until(press + "$('#own-form .refusal').textContent === 'mass 1 must be a number'")
        self.page.fill("#own-form .option:nth-child(1) input", "1")
        self.page.fill("#own-form .option:nth-child(11) input", "")
        self.page.until(press + "$('#own-form .refusal').textContent === 'gravity must be a number'")

    def test_a_link_that_is_followed_in_the_open_page_is_offered_in_its_view(self):
        self.page.run("location.hash = '#links=3&gravity=4'")
        self.page.until("$('#offer').checkVisibility() && $('#controls').checkVisibility()")
        self.page.click("#offer button")
        self.page.until("$$('#kp-fields input[type=number]').length === 3" if IS_FILE
            else "$('#offer .refusal').textContent.startsWith('Needs 3 links')")
        self.page.run("location.hash = '#step=6'")
        self.page.until("$('#course-title').checkVisibility() && !$('#offer').checkVisibility()")
        self.assertEqual(self.page.text("#course-number"), "Step 7 of 11")

    def press(self, selector):
        self.page.run(f"$('{selector}').focus()")
        self.page.key("Enter")

    def test_a_keyboard_does_a_step_and_keeps_its_place(self):
        span = self.page.run("$('#plot-span').selectedIndex")
        self.page.key("-")
        self.assertEqual(self.page.run("$('#plot-span').selectedIndex"), span, "hidden plots stay")
        self.press("#course-start")
        self.page.until("!$('#course-dial').inert && own('arm_view.js').then(({ endEffector }) => endEffector().x > 1.99)", why="the scene")
        self.page.run("$('#arm').focus()")
        for _ in range(4):
            self.page.key("ArrowLeft")
        self.done("the tip has arrived")
        self.wait(lambda: self.runtime.end_effector()[0] < 1.9, "the arm has followed")
        self.press("#course-question button")
        self.page.until("document.activeElement.matches('#course-question .right')", why="an answer keeps the focus")
        self.press("#course-next")
        self.page.until("document.activeElement.id === 'course-title' && $('#course-question button') && !$('#course-dial').inert")
        self.press("#course-question button")
        self.page.until("document.activeElement.closest('#course-dial') !== null", why="after the guess the dial is next")

    @needs_chromium("prints to a file")
    def test_paper_shows_the_pictures_and_of_a_sheet_the_course_only(self):
        self.page.run("""addEventListener('afterprint', () => { window.paper = $$('#arm, #course-chart')
            .map((one) => Math.max(...one.getContext('2d').getImageData(1, 1, 1, 1).data.slice(0, 3))); })""")
        self.step("look")
        self.page.send("Page.printToPDF")
        self.assertGreater(min(self.page.until("window.paper")), 200, "no black picture")
        self.step("own")
        self.press("#own-form button")
        self.done("a sheet")
        self.page.until("document.activeElement.closest('#own-form') !== null", why="a busy button keeps the focus")
        self.page.send("Emulation.setEmulatedMedia", {"media": "print"})
        self.assertFalse(self.page.run("$('#arm').checkVisibility()"))
        self.assertTrue(self.page.run("$('#view-switch').click(), $('#arm').checkVisibility()"))

    @needs_chromium("colours of the system")
    def test_forced_colors_leave_the_pictures_theirs(self):
        self.page.send("Emulation.setEmulatedMedia", {"features": [{"name": "forced-colors", "value": "active"}]})
        self.assertNotEqual(self.color("joint1"), self.color("joint2"))
        self.wait(lambda: self.image("#arm").count(self.color("joint1")) > 200, "the first link")

    def test_on_its_side_a_phone_shows_the_arm_beside_all_of_the_text(self):
        page = self.open("#step=6", width=844, height=390, touch=True)
        for place in (0, 300):
            top, bottom = page.run(f"(scrollTo(0, {place}), new Promise(requestAnimationFrame)).then(() => "
                f"{{ const b = $('#arm').getBoundingClientRect(); return [b.top, b.bottom]; }})")
            self.assertTrue(0 <= top and bottom <= 390, f"from {top} to {bottom} after {place}")

    def test_both_views_show_the_same_arm_and_a_link_names_the_step(self):
        self.step("limit")
        self.wait(lambda: abs(self.values("/pid_controller/set_period")["period"] - 0.0055) < 1e-12, "the scene")
        self.assertEqual(self.page.run("location.hash"), "#step=limit")
        link = self.page.run("own('views.js').then((share) => share.address())")
        self.assertIn("#step=limit&links=2", link)
        self.page.click("#view-switch")
        self.page.until("$('#period-field input[type=number]').checkVisibility() && $('#period-field input[type=number]').value === '5.5'")
        self.page.click("#view-switch")
        self.page.until("$('#course').checkVisibility()")


class Access(CourseTest):
    view = {"width": 900, "height": 620}  # of the frame in docs/page.md
    def test_axe_finds_nothing_in_any_step(self):
        for number, name in enumerate(STEPS, 1):
            self.step(name)
            time.sleep(0.3)
            if name == "own":
                self.page.click("#own-form button")
                self.done("a sheet", 300)
                self.page.click("#course .robot summary")
            self.assertEqual(audit(self.page), [], f"step {number}")
            self.assertLessEqual(self.page.run("document.documentElement.scrollWidth"), self.page.width, f"step {number}")
            self.assertEqual(self.page.run(CLIPPED), [], f"step {number}")
            self.keep(f"course-{type(self).__name__}-{number}")
        forget_the_inspectors(self.page)


class AccessDark(Access):
    view = {"dark": True, "width": 1920, "height": 1080}


class AccessPhone(Access):
    view = PHONE


class AccessPhoneThreeLinks(AccessPhone):
    links = 3
