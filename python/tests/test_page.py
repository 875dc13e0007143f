"""The page in one file, in the wheel."""

import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pendularm
import pytest
from pendularm._page import SETTINGS


class Frame(HTMLParser):
    """The attributes of the first frame."""

    def __init__(self, text):
        super().__init__()
        self.found = None
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        if tag == "iframe" and self.found is None:
            self.found = dict(attrs)


def test_a_cell_shows_the_whole_page_at_its_step():
    shown = pendularm.page(4, timestep=0.01, kp=np.array([900, 200]), controller=True, height=500)
    frame = Frame(shown._repr_html_()).found
    assert frame["height"] == "500"
    assert frame["srcdoc"] == shown.text
    assert 'location.hash = "#step=4&links=2&timestep=0.01&kp=900.0,200.0&controller=on";' in shown.text
    file = Path(pendularm.__file__).with_name("pendularm.html").read_text(encoding="utf-8")
    first = shown.text.index("<script>location.hash")
    assert shown.text.index("<script") == first
    assert shown.text.replace(re.search(r"<script>location.*\n", shown.text)[0], "") == file


def test_it_opens_in_a_browser(monkeypatch):
    opened = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    file = pendularm.page(method="euler").open()
    assert opened == [file.as_uri()]
    assert 'location.hash = "#links=2&method=euler";' in file.read_text(encoding="utf-8")
    file.unlink()


def test_the_settings_are_those_of_a_link():
    source = (Path(__file__).parents[2] / "page/settings.js").read_text(encoding="utf-8")
    table = source[source.index("const IN_LINKS = [") :]
    table = table[: table.index("\n];\n")]
    assert tuple(re.findall(r'\["(\w+)", "', table)) == SETTINGS
    shown = pendularm.page(effort_limit=None, encoder_step=[0.001, 0], velocity_sensor="difference", control_delay=1)
    assert shown.fragment == "links=2&effort_limit=none&encoder_step=0.001,0.0&velocity_sensor=difference&control_delay=1.0"


@pytest.mark.parametrize(
    ("settings", "kind", "said"),
    [
        ({"metod": "euler"}, TypeError, "no setting 'metod'"),
        ({"timestep": None}, TypeError, "timestep must be"),
        ({"kp": [None]}, TypeError, "kp must be"),
        ({"links": 4}, ValueError, "links must be 2 or 3"),
    ],
)
def test_a_wrong_setting_is_named(settings, kind, said):
    with pytest.raises(kind, match=said):
        pendularm.page(**settings)
