"""Write measurements as the CSV and the TOML that are read back."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from crosscheck.files import write_texts
from crosscheck.measurements.data import Mask, Measurements, Sigma
from seecr.pose import Array


def write_measurements(path: str | Path, data: Measurements) -> None:
    """Write the CSV and, beside it, the TOML with sigma; both whole or not at all.

    Numbers have 9 significant digits, readings that are missing are empty cells.

    Raises:
        InputFileError: the folder cannot be written.
    """
    path = Path(path)
    columns = list(_columns(data))
    header = ",".join(name for name, _ in columns)
    rows = (",".join(cells) for cells in zip(*(cells for _, cells in columns), strict=True))
    text = "\n".join([header, *rows]) + "\n"
    # The CSV last: a TOML without it is no measurement.
    write_texts({path.with_suffix(".toml"): _sigma_toml(data.sigma), path: text})


def _columns(data: Measurements) -> Iterator[tuple[str, list[str]]]:
    yield "run", [_quoted(name) for name in data.run.tolist()]
    if data.t_s is not None:
        yield "t_s", _texts(data.t_s)
    if data.command_pose is not None:
        names = [f"cmd_{c}" for c in ("x_m", "y_m", "z_m", "qw", "qx", "qy", "qz")]
        yield from _block(names, data.command_pose)
    if data.command_lengths is not None:
        names = [f"length_{i + 1}_m" for i in range(data.n_cables)]
        yield from _block(names, data.command_lengths)
    yield from _block([f"meas_{c}_m" for c in "xyz"], data.position, data.position_mask)
    if data.quat_wxyz is not None:
        yield from _block([f"meas_q{c}" for c in "wxyz"], data.quat_wxyz)
    yield from _block([f"meas_r{c}_rad" for c in "xyz"], data.angles_rad, data.angle_mask)
    names = [f"tension_{i + 1}_N" for i in range(data.n_cables)]
    yield from _block(names, data.tensions, data.tension_mask)
    if data.temperature_C is not None:
        yield "temperature_C", _texts(data.temperature_C)


def _block(
    names: list[str], values: Array, mask: Mask | None = None
) -> Iterator[tuple[str, list[str]]]:
    for k, name in enumerate(names):
        if mask is None or mask[k]:
            yield name, _texts(values[:, k])


def _texts(values: Array) -> list[str]:
    # Adding zero turns -0.0 into 0.0.
    return ["" if v != v else f"{v + 0.0:.9g}" for v in values.tolist()]


def _quoted(name: str) -> str:
    """A run's name as a CSV cell; a leading # would make the line a comment."""
    if any(mark in name for mark in ',"\n\r') or name.startswith("#"):
        return '"' + name.replace('"', '""') + '"'
    return name


def _sigma_toml(sigma: Sigma) -> str:
    """The text that reading gives back exactly."""
    lines = ["# one standard deviation of each kind of reading", "[sigma]"]
    for key, value in vars(sigma).items():
        if value is not None:
            lines.append(f"{key} = {float(value)!r}")
    return "\n".join(lines) + "\n"
