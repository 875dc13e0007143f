"""What is copied at each chart. The tests of the wheel run the programs that are kept here, and compare their rows with the tables."""

import os
import pathlib
import time

from stage import PageTest
from test_course import CourseTest

KEPT = pathlib.Path(__file__).parents[2] / "python/tests/copied"
KEEP_SECONDS = 15  # then a chart is complete


class Copy:
    def copied(self, form, caption):
        """The text that the button of a chart gives as a table or as Python; empty while there is none."""
        self.page.run(f"$('{caption} .copy').click(), $('#copy-{form}').click(), $('#copy .close').click()")
        return self.page.run("$('#copy-area').value")

    def store(self, name, caption="#course figcaption", seconds=KEEP_SECONDS):
        if os.environ.get("KEEP"):
            time.sleep(seconds)
            (KEPT / f"{name}.tsv").write_text(self.copied("table", caption) + "\n")
            (KEPT / f"{name}.txt").write_text(self.copied("python", caption))

    def keeps(self, name, caption="#course figcaption"):
        """Waits until the program of a chart is the one that the wheel's tests run. With `KEEP=1` it is written, with its table."""
        self.store(name, caption)
        self.wait(lambda: self.copied("python", caption) == (KEPT / f"{name}.txt").read_text(), name)


class OfTheCourse(Copy, CourseTest):
    def test_a_recorded_motion_is_a_table_and_python_begins_at_its_first_row(self):
        self.step("energy")
        self.page.until("own('store.js').then(({ state }) => state.time > 0.5)")
        self.page.click("#pause")
        self.store("motion", seconds=1)
        head, first, *_ = [row.split("\t") for row in self.copied("table", "#course figcaption").split("\n")]
        self.assertEqual((head[0], head[-1], len(first)), ("time [s]", "energy [J]", 14))
        self.assertIn(f'"q": [{first[1]}, {first[2]}]', self.copied("python", "#course figcaption"))

    def test_bars_errors_and_a_map(self):
        for step, name in (("look", "bars"), ("timestep", "errors"), ("limit", "map")):
            self.step(step)
            self.keeps(name)

    def test_a_series_of_runs_and_responses_with_an_effort_limit(self):
        self.step("price")
        self.page.click("#course-measure")
        self.keeps("ladder")
        self.done("measured")
        self.assertGreater(self.image("#course-chart").count(self.color("method1")), 40)
        self.step("pid")
        self.page.click("#course-extra [data-motors*=none]")
        self.keeps("responses")


class OfTheWorkbench(Copy, PageTest):
    def test_a_comparison_a_push_and_a_map(self):
        self.tab("compare")
        self.page.run("$$('#compare-form select').forEach((one, i) => { one.value = ['rest', 'on'][i]; })")
        self.page.fill("#compare-form .option:nth-of-type(2) input", "0.5")
        self.keeps("comparison", "#compare")
        self.page.click("#controller")
        self.tab("stability")
        self.keeps("push", "figure:has(#push-bars)")
        self.keeps("limits", "figure:has(#map)")

    def test_there_is_nothing_to_copy_of_a_measurement_that_was_not_made(self):
        self.tab("error")
        self.page.run("$('#error .copy').click()")
        self.assertEqual(self.page.text("#copy-text"), "This chart has no numbers yet.")
        self.assertTrue(self.page.run("$('#copy-table').disabled && $('#copy-python').disabled"))
