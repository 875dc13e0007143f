"""The program in the wheel: on the path, as a module, with its arguments and its signals."""

import os
import re
import shutil
import signal
import subprocess
import sys
import sysconfig
import time
import urllib.request
import venv
import zipfile
from importlib.metadata import files
from pathlib import Path

import pytest

import pendularm

HERE = Path(__file__).parent
PAPER = HERE.parent.parent / "docs" / "python.md"
PROGRAM = str(Path(sysconfig.get_path("scripts")) / "pendularm")
WAYS = [[PROGRAM], [sys.executable, "-m", "pendularm"]]


def is_of_the_library(said: str) -> bool:
    """Whether a program prints the library's version, which a release build follows by its commit."""
    version = re.escape(pendularm.__version__)
    return re.fullmatch(rf"pendularm {version}(\+[0-9a-f]{{12}}(\.modified)?)? \(web\)\n", said) is not None


@pytest.mark.parametrize("way", WAYS, ids=["on the path", "as a module"])
def test_it_is_the_version_of_the_library(way):
    said = subprocess.run([*way, "--version"], capture_output=True, text=True, check=True).stdout
    assert is_of_the_library(said)


@pytest.mark.parametrize("way", WAYS, ids=["on the path", "as a module"])
def test_bad_arguments_come_back_as_exit_status_2(way):
    run = subprocess.run([*way, "--links", "7"], capture_output=True, text=True)
    assert run.returncode == 2
    assert "--links" in run.stderr


@pytest.mark.parametrize("there", [True, False], ids=["beside it", "nowhere"])
def test_a_module_in_a_folder_of_its_own_finds_the_program_beside_it(tmp_path, there):
    # The state after `pip install --target`, with a record of a program at another path.
    shutil.copytree(Path(pendularm.__file__).parent, tmp_path / "pendularm")
    record = tmp_path / f"pendularm-{pendularm.__version__}.dist-info" / "RECORD"
    record.parent.mkdir()
    record.write_text("../../bin/pendularm,,\n")
    (record.parent / "METADATA").write_text(f"Name: pendularm\nVersion: {pendularm.__version__}\n")
    if there:
        (tmp_path / "bin").mkdir()
        shutil.copy(PROGRAM, tmp_path / "bin")
    run = subprocess.run(
        [sys.executable, "-m", "pendularm", "--version"],
        env={**os.environ, "PYTHONPATH": str(tmp_path)},
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    if there:
        assert is_of_the_library(run.stdout)
    else:
        assert "FileNotFoundError: this installation of pendularm has no program" in run.stderr


def test_it_comes_with_completions():
    share = Path(sysconfig.get_path("data")) / "share"
    assert (share / "bash-completion/completions/pendularm").is_file()


def test_a_rebuilt_wheel_replaces_the_installed_one(tmp_path):
    (wheel,) = (HERE.parent / "target" / "wheels").glob("*.whl")
    [command] = re.findall(r"^\$ pip (install --force-reinstall .*) \S+\.whl$", PAPER.read_text(), re.MULTILINE)
    venv.create(tmp_path / "venv", symlinks=True)
    python = tmp_path / "venv" / "bin" / "python"
    for content in ["1", "2"]:
        made = tmp_path / content / wheel.name
        made.parent.mkdir()
        with zipfile.ZipFile(wheel) as old, zipfile.ZipFile(made, "w") as new:
            for name in old.namelist():
                # Without hashes, which would not match the new content.
                text = re.sub(rb",sha256=[^,]*,\d*", b",,", old.read(name)) if name.endswith("/RECORD") else old.read(name)
                new.writestr(name, content if name.endswith("/py.typed") else text)
        pip = [sys.executable, "-m", "pip", "--python", python, *command.split(), "--no-index", "--quiet", made]
        subprocess.run(pip, check=True, env={**os.environ, "PIP_DISABLE_PIP_VERSION_CHECK": "1"})
        (installed,) = (tmp_path / "venv").glob("lib/python3*/site-packages/pendularm/py.typed")
        assert installed.read_text() == content


def test_the_licences_are_in_the_wheel():
    found = {file.name: file.read_text() for file in files("pendularm") if file.name.startswith("LICENSE")}
    assert found.keys() == {"LICENSE-MIT", "LICENSE-APACHE"}
    assert "Permission is hereby granted" in found["LICENSE-MIT"]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=["SIGINT", "SIGTERM"])
@pytest.mark.parametrize("way", WAYS, ids=["on the path", "as a module"])
def test_it_serves_the_page_until_a_signal(way, number):
    arguments = ["--bind", "127.0.0.1:0", "--links", "3", "--log", "off"]
    with subprocess.Popen([*way, *arguments], stdout=subprocess.PIPE, text=True) as run:
        assert run.stdout is not None
        address = run.stdout.readline().removeprefix("listening on ").strip()
        with urllib.request.urlopen(f"http://{address}/", timeout=60) as page:
            assert b"pendularm" in page.read()
        began = time.monotonic()
        run.send_signal(number)
        assert run.wait(60) == 0
        # The runtime ends within a second. The rest is allowance for a busy machine.
        assert time.monotonic() - began < 10


def test_a_report_can_be_read(tmp_path):
    folder = tmp_path / "report"
    subprocess.run([PROGRAM, "report", "--quick", "--only", "conditioning", "--out", str(folder)], check=True)
    report = pendularm.read_report(folder)
    table = report["conditioning"]
    lines = (folder / "conditioning.csv").read_text().splitlines()
    ratio = "mass of the last link / mass of the others"
    assert list(table) == ["curve", ratio, "digits lost, of 16", "note"]
    assert len(table[ratio]) == len(lines) - 1
    assert table[ratio][0] == 1e-9
    assert table["curve"][0] == "3 links, bent: elimination of M(q)"


@pytest.mark.parametrize(
    ("table", "said"),
    [
        (b"", "has no head"),
        (b"\n1,2\n", "has no head"),
        (b"a,b\n1,2\n3\n", "has 1 cells in row 2, and 2 in its head"),
        (b"a,b\n1,2.5e", "ends amid a line"),
        (b"a,b\n1,2.5", "ends amid a line"),
        (b"a,b\n1,\xff\n", "cannot be read: 'utf-8' codec can't decode byte 0xff"),
        (b"a\n" + b"1" * 200_000 + b"\n", "cannot be read: field larger than field limit"),
        (b'a\n"1\n2\n', "cannot be read: unexpected end of data"),
        (b"a,b,a\n1,2,3\n", "has two columns of the name 'a'"),
        (b"\0" * 100, "cannot be read: line contains NUL"),
    ],
)
def test_an_unreadable_report_is_an_error(tmp_path, table, said):
    (tmp_path / "error.csv").write_bytes(table)
    with pytest.raises(ValueError, match=rf"error\.csv {said}"):
        pendularm.read_report(tmp_path)


def test_a_byte_order_mark_is_no_part_of_a_name(tmp_path):
    (tmp_path / "error.csv").write_bytes(b"\xef\xbb\xbfa,b\r\n1,x\r\n")
    table = pendularm.read_report(tmp_path)["error"]
    assert {name: column.tolist() for name, column in table.items()} == {"a": [1.0], "b": ["x"]}


def test_a_missing_report_is_an_error(tmp_path):
    with pytest.raises(FileNotFoundError, match="holds no report"):
        pendularm.read_report(tmp_path)


@pytest.mark.parametrize("folder", [5, None, b"report", "re\0port"])
def test_a_folder_that_is_no_path_is_refused_by_its_name(folder):
    with pytest.raises((TypeError, ValueError), match="^folder must be a path, got "):
        pendularm.read_report(folder)
