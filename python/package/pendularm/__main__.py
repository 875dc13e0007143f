"""``python -m pendularm``: the live runtime, with its own command line.

``python -m pendularm page`` opens the page in one file in a browser instead, ``page 4`` its fourth step.
"""

import os
import sys
from importlib.metadata import files
from pathlib import Path


def program() -> Path:
    """The path of the program that the wheel installed.

    Raises `FileNotFoundError` if this package was not installed from a wheel of `make wheel`.
    """
    # With `pip install --target` the program is beside the package, and the wheel's record has another
    # path.
    beside = Path(__file__).resolve().parent.parent / "bin" / "pendularm"
    recorded = [Path(str(file.locate())) for file in files("pendularm") or [] if file.parent.name == "bin"]
    for path in [beside, *recorded]:
        if path.name == "pendularm" and path.is_file():
            return path.resolve()
    raise FileNotFoundError("this installation of pendularm has no program: install a wheel from `make wheel`")


def main() -> None:
    """Replaces this process by the program, so signals and the exit status are those of the program."""
    if sys.argv[1:2] == ["page"]:
        from ._page import page

        print(page(*sys.argv[2:3]).open())
        return
    path = str(program())
    os.execv(path, [path, *sys.argv[1:]])


if __name__ == "__main__":
    main()
