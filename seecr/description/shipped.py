"""What comes with the package: the paper's robots as MJCF files, and its two cables."""

from __future__ import annotations

import difflib
from pathlib import Path

from seecr.errors import InputError
from seecr.files import path_of

__all__ = ["CABLES", "is_shipped", "model_names", "model_path", "robot_file"]

CABLES: dict[str, float] = {"vectran": 3000.0, "fishing": 300.0}
"""k_c = E S [N] of the paper's two cables (eq 10), by name.

The paper gives no number, only that the fishing line is "approximately 10 times" softer than
the Vectran (section IV). The fishing line, 0.4 mm of nylon at 1.5 to 3 GPa, has 190 to 380 N:
300 N is taken, and ten times that for the 0.7 mm Vectran. Fit them where it matters.
"""

_HERE = Path(__file__).resolve().parents[1]
# inside the package if installed from a wheel, beside it in a checkout or an editable install
_PLACES = (_HERE / "models", _HERE.parent / "models")


def model_names() -> tuple[str, ...]:
    """Names of the shipped robots, in alphabetical order."""
    files = (file for place in _PLACES for file in place.glob("*/*.xml"))
    return tuple(sorted({file.stem for file in files if file.stem == file.parent.name}))


def model_path(name: str) -> Path:
    """The MJCF file of a shipped robot.

    Args:
        name: as in ``models/<name>/<name>.xml``, for example ``"demobot_cogiro"``.

    Raises:
        InputError: there is no robot of that name; the message lists the names, nearest first.
    """
    if str(name) in model_names():
        files = (place / name / f"{name}.xml" for place in _PLACES)
        return next(file for file in files if file.is_file())
    raise InputError(f"shipped robot {name!r}: expected one of {_names_near(str(name))}")


def robot_file(given: str | Path) -> Path:
    """The MJCF file for a path, or for the name of a shipped robot if there is no such file.

    Raises:
        InputError: neither, and without a file extension; the message lists the names, nearest
            first.
    """
    path = path_of(given, "an MJCF file, or the name of a shipped robot")
    if path.is_file() or path.suffix:
        return path
    if str(given) in model_names():
        return model_path(str(given))
    if path.exists() or path.name != str(given):
        return path
    raise InputError(
        f"{given}: neither a file nor a shipped robot; expected an MJCF file or one of "
        f"{_names_near(str(given))}"
    )


def is_shipped(path: Path) -> bool:
    """Whether a file is that of a shipped robot, as :func:`model_path` gives it."""
    return path.parent.parent in _PLACES and path.stem == path.parent.name and path.is_file()


def _names_near(name: str) -> str:
    known = model_names()
    nearest = difflib.get_close_matches(name, known, n=max(1, len(known)))
    names = ", ".join([*nearest, *(k for k in known if k not in nearest)])
    return names or "none: the models folder is missing"
