"""Inputs before the arm is known: each acts once the runtime has answered, and says so if there is no connection."""

from stage import NUMBER, PageTest, needs_chromium, needs_server

# Holds back the runtime's answers, not its topics, until `release()` is called.
HOLD = """
window.held = [];
window.release = () => { const all = window.held; window.held = null; for (const react of all) react(); };
for (const name of ["WebSocket", "Worker"]) window[name] = class extends window[name] {
  set onmessage(react) {
    super.onmessage = (event) => {
      if (window.held && `${event.data}`.includes('"service_response"')) window.held.push(() => react(event));
      else react(event);
    };
  }
};"""
# No attempt to connect succeeds.
REFUSE = "window.WebSocket = class { static OPEN = 1; constructor() { setTimeout(() => this.onclose(), 50); } };"
MAP = "$('#map')"


def key(name, place="document.body"):
    return f"{place}.dispatchEvent(new KeyboardEvent('keydown', {{ key: '{name}', bubbles: true, cancelable: true }}))"


def pressed(place, *kinds):
    """Mouse events in the middle of an element."""
    return (f"(() => {{ const one = $('{place}'), b = one.getBoundingClientRect(), at = {{ clientX: b.x + b.width / 2, clientY: b.y + b.height / 2 }};"
            f" for (const kind of {list(kinds)}) one.dispatchEvent(new PointerEvent(kind, {{ ...at, bubbles: true, pointerId: 7 }})); }})()")


def given(place, value, kind="change"):
    return f"(() => {{ const one = $('{place}'); one.value = '{value}'; one.dispatchEvent(new Event('{kind}')); }})()"


# The input, what it must lead to, and the panel in which it is, or the view.
INPUTS = (
    (f"{key('ArrowUp', MAP)}, {key('ArrowUp', MAP)}", "state.gains?.kp[0] === 1210", "stability"),
    (pressed("#map", "click"), "state.integrator && state.integrator.timestep !== 0.001", "stability"),
    (given(f"#masses-fields {NUMBER}", "2"), "state.params?.masses[0] === 2", "plots"),
    (given("#kp-fields input[type=range]", "400", "input"), "state.gains?.kp[0] === 20000", "plots"),
    (given(f"#setpoint-fields {NUMBER}", "0.5"), "state.setpoint[0] === 0.5", "plots"),
    (key("e"), "state.setpoint[0] === 0.05", "plots"),
    (key("a"), "state.pushed", "plots"),
    (key("j"), "state.joint === 1", "plots"),
    ("$('input[value=euler]').click()", "!$('#undo').disabled", "plots"),
    (f"{given(f'#gravity-field {NUMBER}', '4')}, {key('z')}", "$('#announce-polite').textContent === 'Undone.'", "plots"),
    ("$('#defaults').click()", "$('#announce-polite').textContent.startsWith('All settings')", "plots"),
    ("$('#suggest button').click()", "state.gains && state.gains.kp[0] !== 1000", "plots"),
    ("$('#share').click()", "location.hash.includes('kp=')", "plots"),
    ("location.hash = 'gravity=4'", "$('#offer').checkVisibility()", "plots"),
    ("$('#compare-form button').click()", "!$('#compare-result').hidden", "compare"),
    (f"$('#ladder-form {NUMBER}').value = 0.1, $('#ladder-form button').click()", "$('#ladder-table tbody') !== null", "error"),
    ("$('#stability .robot').open = true", "$('#stability .robot textarea').value !== ''", "stability"),
    # The arm swings, so its left may be out of reach.
    (key("ArrowLeft", "$('#arm')"), "state.goal !== null || $('#goal-body .refusal').textContent !== ''", "plots"),
    (pressed("#arm", "pointerdown", "pointerup"), "state.goal !== null", "plots"),
    ("$('#course-steps [data-step=slow]').click()", "$('#course-start').textContent === 'Restart step'", "course"),
)


@needs_chromium("a script before those of the page")
class Early(PageTest):
    def setUp(self):
        pass  # each page has an arm of its own

    def early(self, script, view, until):
        """A page of a new arm, with a script before its own; in a panel, or in the course."""
        self.begin()
        self.course = view == "course"
        page = self.visit("about:blank")
        page.before(script)
        page.go(self.runtime.url + ("" if self.course else "#workbench"))
        self.runtime.page = page
        page.until(f"$('#map') && {until}")
        self.own(page)
        if not self.course:
            page.run(f"$('#tab-{view}').click()")
        page.run("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
        return page

    def test_an_input_before_the_first_answers_is_not_lost(self):
        for act, wanted, view in INPUTS:
            with self.subTest(act):
                page = self.early(HOLD, view, "$('#connection').className === 'pill open' && $('#kp-fields input') !== null")
                # Both in one go, so that the input never waits for this program.
                page.run(f"own('store.js').then(({{ state }}) => {{ window.state = state; {act}; setTimeout(release, 100); }})")
                page.until(wanted, why=f"{wanted} after {act}")
                self.assertEqual(page.complaints, [])
            self.doCleanups()

    @needs_server("no server, no connection that others could have or lose")
    def test_an_input_without_a_connection_says_so(self):
        page = self.early(REFUSE, "stability", "$('#connection').className === 'pill lost'")
        for act in (*(key(one) for one in "1jregascx. "), key("ArrowUp", MAP), key("ArrowLeft", "$('#arm')"), key("Escape", "$('#arm')"),
                    pressed("#map", "click"), pressed("#arm", "pointerdown", "pointerup"), "$('#pause').click()", "$('#reset').click()",
                    "$('#controller').click()", "$('#defaults').click()", "$('#suggest button').click()", "$('#share').click()",
                    "$('#compare-form button').click()", "$('#ladder-form button').click()", "$('#stability .robot').open = true"):
            page.run("Promise.all([own('store.js'), own('dom.js')]).then(([{ tell }, { announce }]) => { tell('anew'); announce('next'); })")
            page.until("$('#announce-polite').textContent === 'next'")
            page.run(f"void ($('#announce-polite').textContent = $('#announce-assertive').textContent = $('#share-text').textContent = '', {act})")
            page.until("[...$$('.refusal'), $('#announce-assertive'), $('#share-text')].some((one) => one.textContent === 'not connected')", why=act)
        self.assertEqual(page.complaints, [])
