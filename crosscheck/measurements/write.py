"""Write measurements as a CSV and a TOML that can be read again."""

from __future__ import annotations

import json
from pathlib import Path

from crosscheck.measurements.data import Measurements
from seecr.columns.csv import table_text
from seecr.errors import InputError
from seecr.files import write_texts

# More than any sensor reads.
_DIGITS = 9


def write_measurements(path: str | Path, data: Measurements, remark: str = "") -> None:
    """Write the CSV and, beside it, the TOML with everything else; both completely or not at all.

    Numbers have 9 significant digits, missing readings are empty cells. Either all runs start at
    the reference pose or all at their first rows: a TOML cannot state it run by run.

    Args:
        path: of the CSV. data: what is written.
        remark: text of a line before the header.

    Raises:
        InputFileError: the folder cannot be written.
        InputError: not measurements.

    Example:
        ``crosscheck.write_measurements("copy.csv", data)``
    """
    if not isinstance(data, Measurements):
        raise InputError(f"expected measurements, got {type(data).__name__}")
    path = Path(path)
    said = f"# {remark}\n" if remark else ""
    text = said + table_text(dict(data.columns()), _DIGITS)
    # The CSV last: a TOML without it is no measurement.
    write_texts({path.with_suffix(".toml"): _toml(data), path: text})


def _toml(data: Measurements) -> str:
    """The text of the TOML, which reading reproduces exactly."""
    lines = ['lengths = "told"'] if data.told else []
    lines += ['start = "first_row"'] if data.stands.any() else []
    lines += [f"free = {json.dumps(data.free)}"] if data.free else []
    lines += ["# one standard deviation of each kind of reading", "[sigma]"]
    for key, value in vars(data.sigma).items():
        if value is not None:
            lines.append(f"{key} = {float(value)!r}")
    if data.sigma_source != "stated":
        lines.append(f"source = {json.dumps(data.sigma_source)}")
    return "\n".join(lines) + "\n"
