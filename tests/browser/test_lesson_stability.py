"""The lesson: a blow-up is seen and left in one click; limits, map and modes tell of one beforehand, and errors are measured live."""

import math
import time

from lesson import NUMBER, Lesson


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
        begin_anew = "[...document.querySelectorAll('#notice button')].some((one) => one.textContent === 'Restart')"
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
        button = self.page.until("[...document.querySelectorAll('#notice button')].find((one) => one.textContent.startsWith('Restart at'))?.textContent")
        self.assertRegex(button, r"^Restart at [\d.]+ ms$")
        self.page.click("#notice button")
        self.page.until("document.querySelector('#run-state').textContent === 'running'")
        self.page.until("document.querySelector('#verdict-pill').textContent === 'stable'")
        end = time.monotonic() + 1.5
        while time.monotonic() < end:
            self.assertEqual(self.page.text("#run-state"), "running")
            time.sleep(0.1)

    def test_a_click_in_the_map_goes_there(self):
        self.tab("stability")
        self.page.until("document.querySelector('#map-text').textContent.includes('Higher gains')")
        self.keep("stability")
        box = self.page.run("(() => { const b = document.querySelector('#map').getBoundingClientRect(); return [b.x, b.y, b.width, b.height]; })()")
        # 10 ms is two thirds of the way from 0.1 ms to 100 ms; four times the gains is three quarters of the way up.
        x = box[0] + 46 + (box[2] - 56) * 2 / 3
        y = box[1] + box[3] - 32 - (box[3] - 40) * 3 / 4
        self.page.mouse("mousePressed", x, y)
        self.page.mouse("mouseReleased", x, y)
        self.wait(lambda: abs(math.log(self.values("/arm_sim/set_integrator")["timestep"] / 0.01)) < 0.05, "timestep")
        self.wait(lambda: abs(math.log(self.values("/pid_controller/set_gains")["kp"][0] / 4000)) < 0.05, "gains")

    def test_a_push_dies_away_below_the_limit_and_flips_and_grows_beyond(self):
        self.page.click("#servo")
        self.tab("stability")
        self.page.until("document.querySelector('#push-text').textContent.includes('at 1 ms: the push dies away')")
        self.page.fill(f"#timestep-field {NUMBER}", "6")
        self.page.until("document.querySelector('#push-text').textContent.includes('at 6 ms: the push does not die away')")
        picture = self.image("#push-bars")
        self.assertGreater(picture.count(self.color("bad")), 200)
        self.assertGreater(picture.count(self.color("accent")), 200)
        self.keep("push")

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
            self.assertGreater(self.image("#ladder").count(self.color(f"method{method}")), 40)
        self.assertIn("costs least", self.page.text("#ladder-text"))
        self.keep("error")

    def test_an_error_that_was_measured_is_not_shown_for_another_run_or_arm(self):
        cell = "document.querySelector('#ladder-table tbody tr:last-child td:last-child')?.textContent ?? ''"
        self.tab("error")
        self.page.fill(f"#ladder-form {NUMBER}", "1")
        first = self.page.until(cell)
        self.page.fill(f"#ladder-form {NUMBER}", "60")
        self.page.until("document.querySelector('#ladder-text').textContent.startsWith('No run came within')")
        self.assertNotEqual(self.page.run(cell), first)
        self.page.expect_network_errors = True
        self.runtime.restart(links=3)
        self.connected(links=3)
        self.assertEqual(self.page.run(cell), "")
