"""How uncertain each kind of reading is: the TOML beside the measurements."""

from __future__ import annotations

import difflib
import math
import re
import tomllib
from dataclasses import dataclass, fields
from pathlib import Path

from crosscheck.errors import InputFileError
from crosscheck.text_file import read_text


@dataclass(frozen=True)
class Sigma:
    """One standard deviation of each kind of reading; None where nobody stated it.

    Attributes:
        position_m: of each measured coordinate [m].
        orientation_rad: of each measured rotation component [rad].
        tension_N: of each measured tension [N].
        length_m: of the *commanded* lengths [m]; reaches the pose through the robot.
    """

    position_m: float | None = None
    orientation_rad: float | None = None
    tension_N: float | None = None
    length_m: float | None = None


KNOWN = tuple(field.name for field in fields(Sigma))


def load_sigma(path: str | Path) -> Sigma:
    """Read ``[sigma]`` of a TOML file.

    Raises:
        InputFileError: missing or broken TOML, an unknown key, a value that is no positive
            finite number.
    """
    path = Path(path)
    text = read_text(path, "expected a TOML file with a table [sigma]")
    try:
        content = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputFileError.at(path, f"is not TOML: {error}") from None
    _check_tables(path, text, content)
    table = content.get("sigma", {})
    if not isinstance(table, dict):
        line = _line_of(text, "sigma")
        raise InputFileError.at(path, "sigma must be a table, [sigma]", line=line)
    return Sigma(**{key: _value(path, text, key, value) for key, value in table.items()})


def sigma_toml(sigma: Sigma) -> str:
    """The text that :func:`load_sigma` reads back, exactly."""
    lines = ["# one standard deviation of each kind of reading", "[sigma]"]
    for key in KNOWN:
        value = getattr(sigma, key)
        if value is not None:
            lines.append(f"{key} = {float(value)!r}")
    return "\n".join(lines) + "\n"


def _check_tables(path: Path, text: str, content: dict[str, object]) -> None:
    """Other tables are the user's own; a misspelt [sigma] must not be passed over."""
    for name in content:
        if name in KNOWN:
            raise InputFileError.at(
                path, f"{name} stands outside [sigma]; put it under that", line=_line_of(text, name)
            )
        if name != "sigma" and difflib.get_close_matches(name.lower(), ["sigma"], cutoff=0.7):
            raise InputFileError.at(
                path, f"unknown table [{name}]; expected [sigma]", line=_line_of(text, name)
            )


def _value(path: Path, text: str, key: str, value: object) -> float:
    line = _line_of(text, key)
    if key not in KNOWN:
        # Nearest first, so that the likely one is read first.
        likeness = {k: difflib.SequenceMatcher(None, key, k).ratio() for k in KNOWN}
        known = ", ".join(sorted(KNOWN, key=lambda k: -likeness[k]))
        raise InputFileError.at(path, f"unknown key {key} in [sigma]; known are {known}", line=line)
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if not number or not math.isfinite(float(value)) or float(value) <= 0:  # type: ignore[arg-type]
        unit = key.rpartition("_")[2]
        text = f"{key} must be a positive number [{unit}], came {value!r}"
        raise InputFileError.at(path, f"{text}; leave it out if it is not known", line=line)
    return float(value)  # type: ignore[arg-type]


def _line_of(text: str, key: str) -> int | None:
    pattern = re.compile(rf"^[^#]*(?:\b{re.escape(key)}\b[\"']?\s*=|\[\s*{re.escape(key)}\s*\])")
    for number, line in enumerate(text.splitlines(), start=1):
        if pattern.match(line):
            return number
    return None
