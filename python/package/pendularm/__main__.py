"""``python -m pendularm``: the live runtime, with its own command line."""

import os
import sys
from importlib.metadata import files
from pathlib import Path


def program() -> Path:
    """The program that the wheel installed beside Python's own.

    Raises `FileNotFoundError` where this package was installed from something else than a wheel of `make wheel`.
    """
    # With `pip install --target` it is beside the package, and the record names a place where it is not.
    beside = Path(__file__).resolve().parent.parent / "bin" / "pendularm"
    recorded = [Path(str(file.locate())) for file in files("pendularm") or [] if file.parent.name == "bin"]
    for path in [beside, *recorded]:
        if path.name == "pendularm" and path.is_file():
            return path.resolve()
    raise FileNotFoundError("this installation of pendularm has no program: only wheels made by `make wheel` bring it")


def main() -> None:
    """Becomes the program, so that signals reach it and its exit status is that of this process."""
    path = str(program())
    os.execv(path, [path, *sys.argv[1:]])


if __name__ == "__main__":
    main()
