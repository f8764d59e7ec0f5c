"""Commands written so that they are read again as they were given."""

from __future__ import annotations

import numpy as np

from seecr.commands.data import Commands
from seecr.commands.loads import Loads

__all__ = ["load_columns", "toml_beside"]

_WRENCH = [
    f"{kind}_{axis}_{unit}" for kind, unit in (("force", "N"), ("moment", "Nm")) for axis in "xyz"
]


def load_columns(loads: Loads | None) -> dict[str, list[float]]:
    """Known loads as columns, none without."""
    if loads is None:
        return {}
    columns = {"payload_kg": loads.mass, **dict(zip(_WRENCH, loads.wrench.T, strict=True))}
    if np.isfinite(loads.centre).all():
        centres = zip("xyz", loads.centre.T, strict=True)
        columns |= {f"payload_{axis}_m": one for axis, one in centres}
    return {name: values.tolist() for name, values in columns.items()}


def toml_beside(told: bool, commands: Commands) -> str:
    """What says how lengths are meant and where runs begin; nothing where that is as usual.

    Args:
        told: the lengths are those that winches are told.
        commands: whose rows say where they stand at the beginning.
    """
    lines = []
    if told:
        lines += [
            "# length_i is what winch i is told, counted as the plain model counts",
            'lengths = "told"',
        ]
    if commands.stands is not None and commands.stands.any():
        lines.append('start = "first_row"')
    return "".join(f"{line}\n" for line in lines)
