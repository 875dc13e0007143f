"""The layout: the workbench fits a desktop's screen, a telephone has the arm first, and nobody is left out."""

import pathlib
import time

from stage import PageTest, needs_chromium

AXE = pathlib.Path(__file__).parents[2] / "node_modules/axe-core/axe.min.js"
PANELS = ("plots", "stability", "error", "compare", "tasks")
# Parts in sight whose content is wider than they are, and captions and figures that are not whole.
CLIPPED = """$$('figcaption, figure, main, section, details, .segment, input[type=number]').filter((one) => one.checkVisibility()
    && (one.scrollWidth > one.clientWidth || (one.matches('figcaption, figure') && one.scrollHeight > one.clientHeight)))
    .map((one) => one.id || one.textContent)"""
# Pairs of readouts whose texts overlap.
OVERLAPS = """(() => {
  const boxes = $$('.readouts > div').map((one) => {
    const range = document.createRange();
    range.selectNodeContents(one);
    return [one.textContent, range.getBoundingClientRect()];
  });
  return boxes.flatMap(([text, a], i) => boxes.slice(i + 1)
    .filter(([, b]) => a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom).map(([other]) => [text, other]));
})()"""
RULES = "{ runOnly: ['wcag2a', 'wcag2aa', 'wcag21a', 'wcag21aa', 'wcag22aa', 'best-practice'] }"
PHONE = {"width": 390, "height": 844, "density": 2, "touch": True}


def audit(page):
    """What axe finds, with the elements that it is about."""
    page.run(AXE.read_text().strip().removesuffix(";"))
    return page.run(f"axe.run(document, {RULES}).then(({{ violations }}) => violations.map(({{ id, nodes }}) =>"
                    " [id, ...nodes.slice(0, 3).map((one) => one.html.slice(0, 120) + ' ' + one.failureSummary)]))")


def forget_the_inspectors(page):
    """Complaints of the inspector itself, which may come late."""
    page.run("new Promise(requestAnimationFrame)")
    page.complaints.clear()


class Access:
    def test_axe_finds_nothing_in_any_panel(self):
        for panel in PANELS:
            self.tab(panel)
            if panel == "stability":
                self.page.run("$('.robot').open = true")
            self.assertEqual(audit(self.page), [], panel)
        self.keep(f"layout-{type(self).__name__}", whole=True)
        forget_the_inspectors(self.page)


class Free:
    """Where the view is small nothing is in its corners."""

    def test_nothing_lies_over_the_arm(self):
        self.shake()
        over = self.page.run("""(() => { const arm = $('#arm').getBoundingClientRect();
            return $$('.clock, .view-tools, #notice').filter((one) => {
                const b = one.getBoundingClientRect();
                return b.bottom > arm.top + 1 && b.top < arm.bottom - 1;
            }).map((one) => one.id || one.className); })()""")
        self.assertEqual(over, [])


class Steady:
    """A button does not go from under the pointer because a figure has come."""

    def test_controls_stay_where_they_are_when_the_limit_comes(self):
        top = "$('#reset').getBoundingClientRect().top + scrollY"
        self.page.until("$('#out-every').textContent === '–'", why="no loop, no limit")
        before = self.page.run(top)
        self.runtime.call("/pid_controller/enable", data=True)
        self.page.until("$('#out-certified').textContent === 'estimate'")
        self.assertEqual(self.page.run(top), before, "estimate")
        self.assertEqual(self.page.run(OVERLAPS), [])
        self.runtime.call("/pid_controller/set_gains", kp=[60, 30], ki=[300, 0], kd=[25, 8])
        self.page.until("$('#out-certified').textContent === 'found'")
        self.assertEqual(self.page.run(top), before, "found")
        self.assertEqual(self.page.run(OVERLAPS), [])


class Desktop(Access, Steady, PageTest):
    def box(self, selector):
        return self.page.run(f"(() => {{ const b = $('{selector}').getBoundingClientRect();"
                             " return [b.left, b.top, b.right, b.bottom]; })()")

    def test_the_first_screen_holds_the_arm_its_settings_and_a_panel(self):
        for selector in ("#arm", "#notice", "#transport", "#plot-phase", "#methods", "#timestep-field", "#kd-fields", "#masses-fields"):
            self.assertLessEqual(self.box(selector)[3], 900, selector)
        for panel, control in (("compare", "#compare-form button[type=submit]"), ("tasks", "#trial-start"), ("error", "#ladder"), ("stability", "#push-bars")):
            self.tab(panel)
            self.assertLessEqual(self.box(control)[3], 900, control)

    def test_no_moving_canvas_is_in_a_round_clip(self):
        """Canvases, which a browser draws apart, and once more through a mask, in every frame."""
        clips = self.page.run("""$$('#arm, #plots canvas').flatMap((one) => {
            const found = [];
            for (let e = one.parentElement; e; e = e.parentElement) {
                const { overflow, borderRadius } = getComputedStyle(e);
                if (overflow !== 'visible' && borderRadius !== '0px') found.push(`${one.id} in ${e.id || e.className}`);
            }
            return found; })""")
        self.assertEqual(clips, [])


class DesktopDark(Access, PageTest):
    view = {"dark": True}


class ThreeLinks(Access, PageTest):
    links = 3

    def test_every_joints_field_is_in_one_line_with_its_slider_or_below_it(self):
        tops = self.page.run("$$('#kp-fields .field').map((one) => Math.round(one.getBoundingClientRect().top))")
        self.assertEqual(len(set(tops)), 1, "side by side")
        self.assertLessEqual(self.page.run("$('#lengths-fields').getBoundingClientRect().bottom"), 900, "without scrolling")
        self.assertEqual(self.page.run("(() => { const e = $('#controls'); return e.scrollHeight - e.clientHeight; })()"), 0)
        # A legend without its first values is a little higher.
        self.page.until("$('#legend-drift').textContent.length > 3")
        self.assertEqual(self.page.run(CLIPPED), [])


class Laptop(Free, Steady, PageTest):
    view = {"width": 1280, "height": 720}

    def test_captions_are_whole_also_while_an_arm_shakes(self):
        self.page.until("$('#legend-drift').textContent.length > 3 && $('#legend-drift + .unit').checkVisibility()")
        self.assertEqual(self.page.run(CLIPPED), [])
        self.shake()
        self.page.until("$('#legend-drift-name').textContent === 'work'")
        for _ in range(40):
            self.assertEqual(self.page.run(CLIPPED), [])
            time.sleep(0.1)


class Narrow(PageTest):
    view = {"width": 320, "height": 700, "density": 2, "touch": True}

    @needs_chromium("a window of any size")
    def test_captions_are_whole_also_where_text_alone_is_enlarged(self):
        for width, height, size in ((320, 700, 100), (1280, 720, 100), (1280, 720, 200), (1024, 768, 200), (390, 844, 200)):
            self.page.send("Emulation.setDeviceMetricsOverride", {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 500})
            self.page.run(f"document.documentElement.style.fontSize = '{size}%'")
            self.assertEqual(self.page.run("getComputedStyle($('#kp-fields label')).fontSize"), f"{12 * size // 100}px")
            for panel, figure in (("plots", "legend-drift"), ("stability", "map-value")):
                self.tab(panel)
                self.page.until(f"$('#{figure}').textContent.length > 3")
                self.assertEqual(self.page.run(CLIPPED), [], f"{width} px, text at {size} %")


class Phone(Free, Steady, Access, PageTest):
    view = PHONE

    def test_arm_integrator_and_controller_come_first(self):
        tops, width = self.page.run("[['#arm', '#transport', '#methods', '#kp-fields', '#panel'].map((one) => "
            "$(one).getBoundingClientRect().top), document.documentElement.scrollWidth]")
        self.assertEqual((tops, width), (sorted(tops), 390))

    def test_settings_that_fold_show_that_they_do(self):
        marks = lambda: self.page.run("$$('#controls summary').map((one) => getComputedStyle(one, '::before').content[1])")
        self.assertEqual(marks(), ["▾", "▾", "▸", "▸"])
        self.page.click("#controls details:last-child summary")
        self.assertEqual(marks(), ["▾", "▾", "▸", "▾"])

    def test_touch_targets_are_44_pixels_high(self):
        self.page.run("$('#tab-stability').click(), $('.robot').open = true")
        small = self.page.run("$$('button, select, textarea, input:not([type=checkbox], [type=radio]), summary, .segment')"
                              ".filter((one) => one.checkVisibility()).map((one) => [one.id || one.outerHTML.slice(0, 80), one.getBoundingClientRect().height])"
                              ".filter(([, height]) => height < 44)")
        self.assertEqual(small, [])


class PhoneDark(Access, PageTest):
    view = {**PHONE, "dark": True}
    links = 3
