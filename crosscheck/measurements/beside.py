"""The TOML beside a file of measurements: noise, meaning of lengths, start of runs."""

from __future__ import annotations

import difflib
from dataclasses import dataclass, field, fields
from pathlib import Path

from crosscheck.errors import CrosscheckError
from crosscheck.measurements.data import Sigma
from crosscheck.measurements.stated import EXAMPLE, LEAST_NOISE, MOST, parse_quantity
from seecr.columns.commands import CHOICES, choice
from seecr.effects import catalogue
from seecr.files import Toml, read_toml

_SIGMAS = tuple(item.name for item in fields(Sigma))
# Where stated noise comes from, the default first.
SOURCES = ("stated", "dwell_scatter", "revisited")


@dataclass(frozen=True)
class Beside:
    """The content of the TOML.

    Attributes:
        sigma: stated noise. source: where it comes from, one of :data:`SOURCES`.
        told: ``lengths = "told"``: lengths are told lengths.
        stands: ``start = "first_row"``: runs start at their first row.
        free: names of effects that every fit of these data includes.
    """

    sigma: Sigma = field(default_factory=Sigma)
    source: str = SOURCES[0]
    told: bool = False
    stands: bool = False
    free: tuple[str, ...] = ()


def read_beside(path: Path) -> Beside:
    """Read the TOML.

    Raises:
        InputFileError: a missing or broken TOML, an unknown key, a value that is not a positive
            quantity, or a value that its key does not allow.
    """
    toml = read_toml(path, "expected a TOML file with a table [sigma]")
    _check_names(toml)
    table = toml.content.get("sigma", {})
    if not isinstance(table, dict):
        raise toml.error("sigma must be a table, [sigma]", "sigma")
    said = {key: choice(toml, key) for key in CHOICES}
    source = _source(toml, table)
    values = {key: _sigma(toml, key, value) for key, value in table.items() if key != "source"}
    return Beside(
        Sigma(**values),
        source,
        said["lengths"] == "told",
        said["start"] == "first_row",
        _free(toml),
    )


def _check_names(toml: Toml) -> None:
    """Refuse misspelt keys; other names are the user's own."""
    known = ["sigma", "free", *CHOICES]
    for name in toml.content:
        if name in _SIGMAS:
            raise toml.error(f"{name} is outside the table [sigma]; put it into that table", name)
        near = difflib.get_close_matches(name.lower(), known, n=1, cutoff=0.7)
        if name not in known and near:
            shown = "[{}]" if near[0] == "sigma" else "{}"
            what = "table" if near[0] == "sigma" else "key"
            text = f"unknown {what} {shown.format(name)}; expected {shown.format(near[0])}"
            raise toml.error(text, name)


def _source(toml: Toml, table: dict[str, object]) -> str:
    source = table.get("source", SOURCES[0])
    if source not in SOURCES:
        words = " or ".join(f'"{word}"' for word in SOURCES)
        raise toml.error(f"source must be {words}, got {source!r:.60}", "source")
    return str(source)


def _free(toml: Toml) -> tuple[str, ...]:
    names = toml.content.get("free", [])
    sensing = [name for name, effect in catalogue().items() if effect.place == "sensing"]
    if not isinstance(names, list) or not all(name in sensing for name in names):
        text = f'free must be a list of some of {", ".join(sensing)}, such as ["tracker_frame"]'
        raise toml.error(f"{text}, got {names!r}", "free")
    return tuple(dict.fromkeys(names))


def _sigma(toml: Toml, key: str, value: object) -> float:
    if key not in _SIGMAS:
        # Nearest first, so that the likely one is read first.
        keys = (*_SIGMAS, "source")
        likeness = {k: difflib.SequenceMatcher(None, key, k).ratio() for k in keys}
        known = ", ".join(sorted(keys, key=lambda k: -likeness[k]))
        raise toml.error(f"unknown key {key} in [sigma]; known are {known}", key)
    kind, _, unit = key.rpartition("_")
    if isinstance(value, str):
        try:
            return parse_quantity(key, kind, value, LEAST_NOISE)
        except CrosscheckError as error:
            raise toml.error(str(error), key) from None
    # not yet a float, which cannot hold a whole number of hundreds of digits
    number = value if isinstance(value, int | float) and value is not True else 0.0
    if not LEAST_NOISE < number < MOST:
        size = f" between {LEAST_NOISE:g} and {MOST:g}" if number > 0.0 else ""
        text = f'{key} must be a positive number [{unit}]{size} or a text such as "{EXAMPLE[kind]}"'
        raise toml.error(f"{text}, got {value!r:.60}; leave it out if it is not known", key)
    return float(number)
