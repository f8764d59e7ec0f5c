"""The thresholds of the suite, from a TOML file that a user can copy and change."""

from __future__ import annotations

import difflib
import math
import tomllib
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from crosscheck.errors import InputFileError

SHIPPED = Path(__file__).with_name("thresholds.toml")


@dataclass(frozen=True)
class Settled:
    """For MuJoCo after plain settling."""

    position_m: float = math.nan
    orientation_rad: float = math.nan


@dataclass(frozen=True)
class Polished:
    """For MuJoCo after the polish."""

    position_m: float = math.nan
    orientation_rad: float = math.nan
    tension_N: float = math.nan


@dataclass(frozen=True)
class Thresholds:
    """Largest differences between SEECR and MuJoCo that count as agreement.

    Attributes:
        settled: against MuJoCo after plain settling.
        polished: against MuJoCo after the polish.
    """

    settled: Settled = field(default_factory=Settled)
    polished: Polished = field(default_factory=Polished)

    def as_dict(self) -> dict[str, dict[str, float]]:
        """Tables and values as in the file."""
        return asdict(self)


def load_thresholds(path: str | Path | None = None) -> Thresholds:
    """Read thresholds; what the file leaves out keeps its shipped value.

    Args:
        path: a TOML file; None for the shipped one.

    Raises:
        InputFileError: not TOML, an unknown table or key, a value that is no positive number.
    """
    shipped = _merge(Thresholds(), SHIPPED)
    return shipped if path is None else _merge(shipped, Path(path))


def thresholds_toml(thresholds: Thresholds) -> str:
    """Thresholds as the text of a file, with the comments of the shipped one."""
    import tomlkit

    document = tomlkit.parse(SHIPPED.read_text(encoding="utf-8"))
    for table, values in thresholds.as_dict().items():
        for key, value in values.items():
            if document[table][key] != value:  # type: ignore[index]
                document[table][key] = value  # type: ignore[index]
    return tomlkit.dumps(document)


def _merge(thresholds: Thresholds, path: Path) -> Thresholds:
    tables = _read(path)
    _check_names(path, tables, thresholds.as_dict(), "table")
    parts = {}
    for table, values in tables.items():
        part = getattr(thresholds, table)
        if not isinstance(values, dict):
            raise InputFileError(f"{path}: {table}: expected a table [{table}], got {values!r}")
        _check_names(path, values, asdict(part), f"key of [{table}]")
        for key, value in values.items():
            _check_value(path, f"[{table}] {key}", value)
        parts[table] = replace(part, **{key: float(value) for key, value in values.items()})
    return replace(thresholds, **parts)


def _read(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        reason = error.strerror or error
        raise InputFileError(
            f"{path}: cannot read the thresholds: {reason}; expected a TOML file like {SHIPPED}"
        ) from None
    except UnicodeDecodeError as error:
        raise InputFileError(
            f"{path}: expected TOML in UTF-8, got a byte that is none at offset {error.start}"
        ) from None
    except tomllib.TOMLDecodeError as error:
        raise InputFileError(f"{path}: not TOML: {error}") from None


def _check_names(path: Path, got: dict[str, Any], known: dict[str, Any], what: str) -> None:
    for name in got:
        if name not in known:
            near = difflib.get_close_matches(name, known, n=len(known), cutoff=0.0)
            raise InputFileError(
                f"{path}: {name!r} is no {what} of thresholds; expected {' or '.join(near)}"
            )


def _check_value(path: Path, where: str, value: Any) -> None:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if not number or not (value > 0 and math.isfinite(value)):
        raise InputFileError(f"{path}: {where}: expected a positive number, got {value!r}")
