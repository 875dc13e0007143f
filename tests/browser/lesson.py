"""The stage of the lesson's tests: calls of services, and what the page shows of the setpoint and draws."""

import time

from stage import PageTest

NUMBER = "input[type=number]"


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
