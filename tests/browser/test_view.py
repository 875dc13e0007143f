"""The page's pictures: the arm where it is, its target, the plots; on dense screens, small ones, in the dark, with three links."""

from chromium import close
from stage import PageTest, needs_chromium

SMALL = {"width": 360, "height": 740, "density": 2, "touch": True}


class View:
    """Checks that hold for any number of links, theme and size."""

    def pose(self):
        return [0.9, -1.3, 0.8][:self.links]

    def test_the_arm_is_drawn_where_the_runtime_says_it_is(self):
        self.settle(self.pose())
        ends = self.runtime.joints()
        density = self.view.get("density", 1)
        left, top = self.on_canvas((0, 0))
        picture = self.image("#arm")
        for i, (start, end) in enumerate(zip(ends, ends[1:])):
            middle = self.on_canvas([(a + b) / 2 for a, b in zip(start, end)])
            # From the canvas's middle, where the base is.
            x = round(picture.width / 2 + density * (middle[0] - left))
            y = round(picture.height / 2 + density * (middle[1] - top))
            self.assertTrue(close(picture[x, y], self.color(f"joint{i + 1}")), f"link {i + 1} at {x}, {y}: {picture[x, y]}")

    def test_every_plot_shows_every_joint(self):
        # A free swing moves all joints, so no line covers another. Drawing begins when the page has connected, which
        # may be late: so two seconds from then on.
        shown = "Number($('#sim-time').textContent)"
        self.page.until(f"{shown} > 0")
        self.page.until(f"{shown} > {self.page.run(shown) + 2}")
        self.runtime.call("/arm_sim/pause", data=True)
        for plot in ("position", "velocity", "phase"):
            picture = self.image(f"#plot-{plot}")
            for joint in range(1, self.links + 1):
                self.assertGreater(picture.count(self.color(f"joint{joint}")), 20, f"joint {joint} in {plot}")
        self.assertGreater(self.image("#plot-energy").count(self.color("ink"), 60), 20)
        self.keep(f"{type(self).__name__}-whole", whole=True)

    def test_nothing_sticks_out_to_the_side(self):
        self.assertLessEqual(self.page.run("document.documentElement.scrollWidth"), self.page.run("innerWidth"))

    def test_canvases_have_a_pixel_for_each_of_the_screen_and_are_opaque(self):
        """So that a frame is copied to the screen as it is, neither resampled nor blended: edges are where a browser rounds them to."""
        look = """$$('canvas').filter((one) => one.clientWidth > 0).map((one) => {
            const { left, top, right, bottom } = one.getBoundingClientRect();
            const pixels = (from, to) => Math.round(to * devicePixelRatio) - Math.round(from * devicePixelRatio);
            return [one.id, one.width - pixels(left, right), one.height - pixels(top, bottom), one.getContext('2d').getContextAttributes().alpha];
        })"""
        # A canvas takes its new size in the frame after the layout's.
        self.page.until(f"{look}.every(([, x, y, alpha]) => x === 0 && y === 0 && !alpha)")
        canvases = self.page.run(look)
        self.assertGreaterEqual(len(canvases), 6)


class Sums:
    """The page's own numbers for its plots, against the runtime's."""

    def test_energy_and_gravity_load_are_those_of_the_runtime(self):
        self.settle(self.pose())
        # The drawn state and the reported state may belong to different steps for a moment.
        self.page.until("""Promise.all([own('history.js'), own('store.js')]).then(([r, { state }]) => state.paused
            && state.diagnostics?.state === 'paused'
            && Math.abs(r.record.data[r.record.last() + r.TIME] - state.diagnostics.sim_time) < 1e-6)""")
        load, energy, told = self.page.run("""Promise.all([own('history.js'), own('store.js')]).then(([r, { state }]) => {
            const row = r.record.last();
            return [[...r.record.data.slice(row + r.LOAD, row + r.LOAD + state.links)], r.record.data[row + r.ENERGY], state.diagnostics.energy];
        })""")
        # The same state and the same formula: all digits but the last few.
        self.assertAlmostEqual(energy, told, delta=1e-9 * max(1, abs(told)))
        # At rest the effort is the gravity load; the arm is within 2 mrad and slower than a crawl.
        for effort, held in zip(self.runtime.next("/joint_states")["effort"], load):
            self.assertAlmostEqual(effort, held, delta=1.0)


class TwoLinks(View, Sums, PageTest):
    def test_a_goal_shows_its_target_and_says_when_it_is_reached(self):
        self.assertLess(self.image("#arm").count(self.color("target")), 5)
        self.runtime.call("/ik_action/send_goal", x=0.4, y=1.1)
        self.page.until("$('#goal-text').textContent.startsWith('On the way')")
        self.assertGreater(self.image("#arm").count(self.color("target")), 20)
        self.assertIn("controller is off", self.page.text("#notice"))
        self.page.click("#notice button")
        self.page.until("$('#goal-text').textContent.startsWith('Reached')")
        self.page.until("$('#announce-polite').textContent === 'Target reached.'")
        self.assertTrue(self.runtime.call("/pid_controller/enable")["values"]["data"])

    def test_the_real_time_factor_is_shown_and_the_arm_is_described_in_a_sentence(self):
        self.page.until("Math.abs(parseFloat($('#out-rtf').textContent) - 1) < 0.1")
        self.settle([0.5, 0.5])
        self.page.until("$('#arm-text').textContent.includes('paused, controller on. Joints at 29, 29 degrees')")

    def test_a_file_is_handed_over(self):
        self.page.until("own('history.js').then(({ record }) => record.length > 30)")
        self.page.run("HTMLAnchorElement.prototype.click = function () { window.saved = [this.download, this.href]; }")
        self.page.click("#plot-save")
        self.page.until("window.saved?.[0] === 'pendularm.csv'")
        self.assertTrue(self.page.run("window.saved[1].startsWith('blob:')"))

    @needs_chromium("the size of the heap")
    def test_an_hour_would_take_no_more_than_ten_megabytes(self):
        def heap():
            self.page.run("gc()")
            return self.page.run("performance.memory.usedJSHeapSize")

        # Memory that is compiled and cached once is no growth. The browser takes it at any time. So at least one of four spans of half
        # a minute must have little growth. At 10 MB an hour, each would grow by 83 kB.
        self.page.run("new Promise((done) => setTimeout(done, 15000))")
        before, growths = heap(), []
        while len(growths) < 4 and (not growths or growths[-1] >= 83_000):
            self.page.run("new Promise((done) => setTimeout(done, 30000))")
            after = heap()
            growths.append(after - before)
            before = after
        self.assertLess(growths[-1], 83_000, growths)


class ThreeLinks(View, Sums, PageTest):
    links = 3


class Dark(View, PageTest):
    view = {"dark": True}

    def test_the_theme_can_be_chosen(self):
        dark = self.color("page")
        self.page.click("#theme")
        self.assertNotEqual(self.color("page"), dark)
        self.assertGreater(sum(self.image("#arm")[4, 200]), 600, "light")


class SmallScreen(View, PageTest):
    view = SMALL


class DenseScreen(View, PageTest):
    view = {"density": 3, "width": 900}
