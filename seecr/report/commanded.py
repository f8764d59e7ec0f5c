"""Commands written so that reading the file gives the same commands."""

from __future__ import annotations

import numpy as np

from seecr.commands import Commands, Loads

__all__ = ["load_columns", "toml_beside"]

_WRENCH = [
    f"{kind}_{axis}_{unit}" for kind, unit in (("force", "N"), ("moment", "Nm")) for axis in "xyz"
]


def load_columns(loads: Loads | None) -> dict[str, list[float]]:
    """Known loads as columns; none without loads.

    NaN, which is to be written as an empty cell, where a payload hangs at the platform's own centre
    of mass.
    """
    if loads is None:
        return {}
    columns = {"payload_kg": loads.mass, **dict(zip(_WRENCH, loads.wrench.T, strict=True))}
    if np.isfinite(loads.centre).any():
        centres = zip("xyz", loads.centre.T, strict=True)
        columns |= {f"payload_{axis}_m": one for axis, one in centres}
    return {name: values.tolist() for name, values in columns.items()}


def toml_beside(told: bool, commands: Commands) -> str:
    """The TOML that states how lengths are meant and where runs begin; empty for the defaults.

    Args:
        told: whether the lengths are told lengths.
        commands: for where their runs begin.
    """
    lines = []
    if told:
        lines += [
            "# length_i is the told length of winch i, in the plain model's terms",
            'lengths = "told"',
        ]
    if commands.stands is not None and commands.stands.any():
        lines.append('start = "first_row"')
    return "".join(f"{line}\n" for line in lines)
