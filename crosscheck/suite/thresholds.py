"""The thresholds of the suite, from a TOML file that a user can copy and change."""

from __future__ import annotations

import difflib
import fnmatch
import math
from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from seecr.files import Toml, path_of, plain, read_toml

SHIPPED = Path(__file__).with_name("thresholds.toml")


@dataclass(frozen=True)
class SettledLimits:
    """Limits for MuJoCo after plain settling."""

    position_m: float = math.nan
    orientation_rad: float = math.nan


@dataclass(frozen=True)
class PolishedLimits:
    """Limits for MuJoCo after the polish."""

    position_m: float = math.nan
    orientation_rad: float = math.nan
    tension_N: float = math.nan


@dataclass(frozen=True)
class FindingLimits:
    """How many poses of a case may have more than one right answer.

    Attributes:
        branches: largest number with two stable equilibria.
        free_to_move: names ``CASE POSE``, or patterns, of those that may be free to move.
        free_elsewhere: largest share of those in a case whose poses have no names.
    """

    branches: int = 0
    free_to_move: tuple[str, ...] = ()
    free_elsewhere: float = 0.0

    def names(self, case: str, pose: int) -> bool:
        """Whether a pose is named as free to move."""
        return any(fnmatch.fnmatchcase(f"{case} {pose}", name) for name in self.free_to_move)


@dataclass(frozen=True)
class Thresholds:
    """What counts as agreement between SEECR and MuJoCo.

    Attributes:
        settled: largest differences against MuJoCo after plain settling.
        polished: largest differences against MuJoCo after the polish.
        findings: how many poses may have more than one right answer.
    """

    settled: SettledLimits = field(default_factory=SettledLimits)
    polished: PolishedLimits = field(default_factory=PolishedLimits)
    findings: FindingLimits = field(default_factory=FindingLimits)


def load_thresholds(path: str | Path | None = None) -> Thresholds:
    """Read thresholds; those that the file leaves out keep their shipped values.

    Args:
        path: a TOML file; None for the shipped one.

    Raises:
        InputFileError: not TOML, an unknown table or key, or a value of another kind.
        InputError: no path.
    """
    shipped = _merge(Thresholds(), SHIPPED)
    return shipped if path is None else _merge(shipped, path_of(path, "thresholds"))


def thresholds_toml(thresholds: Thresholds) -> str:
    """Thresholds as the text of a file, with the comments of the shipped one."""
    import tomlkit

    document = tomlkit.parse(SHIPPED.read_text(encoding="utf-8"))
    for table, values in plain(thresholds).items():
        for key, value in values.items():
            if document[table][key] != value:
                document[table][key] = value
    return tomlkit.dumps(document)


def _merge(thresholds: Thresholds, path: Path) -> Thresholds:
    file = read_toml(path, f"expected thresholds such as those in {SHIPPED}")
    _check_names(file, file.content, vars(thresholds), "table")
    parts = {}
    for table, values in file.content.items():
        part = getattr(thresholds, table)
        if not isinstance(values, dict):
            raise file.error(f"{table}: expected a table [{table}], got {values!r}", table)
        _check_names(file, values, vars(part), f"key of [{table}]")
        parts[table] = replace(part, **{k: _value(file, table, k, v) for k, v in values.items()})
    return replace(thresholds, **parts)


def _check_names(file: Toml, got: Iterable[str], known: Collection[str], what: str) -> None:
    for name in got:
        if name not in known:
            near = difflib.get_close_matches(name, known, n=len(known), cutoff=0.0)
            raise file.error(
                f"{name!r} is not a {what} of thresholds; expected {' or '.join(near)}", name
            )


def _value(file: Toml, table: str, key: str, value: Any) -> Any:
    """A value in the form that the dataclasses hold, checked for the kind that its key needs."""
    expected, fits, hold = _KINDS.get(key, ("a positive number", _is_positive, float))
    if not fits(value):
        raise file.error(f"[{table}] {key}: expected {expected}, got {value!r}", key)
    return hold(value)


def _is_number(value: Any) -> bool:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    return number and math.isfinite(value)


def _is_positive(value: Any) -> bool:
    return _is_number(value) and value > 0


def _is_count(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and value >= 0


def _is_share(value: Any) -> bool:
    return _is_number(value) and 0 <= value <= 1


def _are_names(value: Any) -> bool:
    return isinstance(value, list) and all(isinstance(name, str) for name in value)


_KINDS: dict[str, tuple[str, Callable[[Any], bool], Callable[[Any], Any]]] = {
    "branches": ("a whole number from 0 on", _is_count, int),
    "free_to_move": ('a list of names "CASE POSE"', _are_names, tuple),
    "free_elsewhere": ("a share from 0 to 1", _is_share, float),
}
