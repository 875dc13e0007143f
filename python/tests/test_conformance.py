"""The referee in the wheel, and its report in JUnit's form, which a CI reads."""

import subprocess
import sysconfig
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

PROGRAM = str(Path(sysconfig.get_path("scripts")) / "pendularm")

# Of the form that Jenkins and pytest share, which is called xunit2 there: the elements, the elements inside each, its
# attributes, and those that it must have.
SHAPE = {
    "testsuites": ({"testsuite"}, {"name", "time", "tests", "failures", "errors"}, set()),
    "testsuite": (
        {"testsuite", "properties", "testcase", "system-out", "system-err"},
        {"name", "tests", "failures", "errors", "group", "time", "skipped", "timestamp", "hostname", "id", "package", "file", "log", "url"},
        {"name", "tests", "failures", "errors"},
    ),
    "testcase": ({"skipped", "error", "failure", "system-out", "system-err"}, {"name", "time", "classname", "group"}, {"name"}),
    "failure": (set(), {"type", "message"}, set()),
    "skipped": (set(), {"type", "message"}, set()),
}


def check(element):
    """Passes if an element and all inside it have that shape, and if the totals are those of the cases."""
    inside, allowed, needed = SHAPE[element.tag]
    assert needed <= set(element.attrib) <= allowed, element.attrib
    assert {one.tag for one in element} <= inside
    is_total = element.tag.startswith("testsuite")
    assert not is_total or not (element.text or "").strip(), "text is in failures alone"
    for name, tag in [("tests", "testcase"), ("failures", "failure"), ("errors", "error"), ("skipped", "skipped")]:
        if is_total and name in element.attrib:
            assert int(element.get(name)) == len(list(element.iter(tag))), (element.attrib, tag)
    if "time" in element.attrib:
        assert float(element.get("time")) >= 0
    for one in element:
        check(one)


def sabotaged(rule):
    """The number of a fault that this rule finds, from the list of the program."""
    listed = subprocess.run([PROGRAM, "sabotage", "--list"], capture_output=True, text=True, check=True).stdout
    return next(line.split()[0] for line in listed.splitlines() if line.split()[1].rstrip(":") == rule)


@pytest.mark.parametrize(
    ("rule", "section", "failures", "skipped"),
    [(None, "checkpoint", 0, 0), ("envelope-1", "envelope", 1, 0), ("pace-2", "pace", 0, 1)],
    ids=["right", "wrong", "remark"],
)
def test_the_junit_report_has_the_form_that_a_ci_reads(tmp_path, rule, section, failures, skipped):
    serve = ["sabotage", sabotaged(rule), "127.0.0.1:0"] if rule else ["--bind", "127.0.0.1:0"]
    report = tmp_path / "report.xml"
    with subprocess.Popen([PROGRAM, *serve], stdout=subprocess.PIPE, text=True) as server:
        try:
            address = server.stdout.readline().split()[2].rstrip(":,;")
            order = [PROGRAM, "conformance", address, "--rule", section, "--junit", str(report)]
            run = subprocess.run(order, capture_output=True, text=True)
        finally:
            server.terminate()
    assert run.returncode == (failures > 0), run.stdout + run.stderr
    root = ET.parse(report).getroot()
    assert root.tag == "testsuites"
    check(root)
    assert [len(list(root.iter(tag))) for tag in ("failure", "skipped")] == [failures, skipped], run.stdout
