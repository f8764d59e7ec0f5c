"""Columns of known loads: payloads, forces and moments."""

from __future__ import annotations

import numpy as np

from seecr.columns.known import POSITION, Columns
from seecr.commands.loads import Loads
from seecr.description.robot import Robot
from seecr.pose import Array


def known_loads(columns: Columns, robot: Robot) -> Loads | None:
    """The known load of each row, or None if the file has no such columns.

    Raises:
        InputFileError: a centre without a payload, an incomplete centre, or a payload that leaves
            the platform without mass.
    """
    mass = _payload(columns, robot)
    wrench = np.zeros((columns.n_rows, 6))
    for k, part in enumerate(
        [f"{kind}_{axis}" for kind in ("force", "moment") for axis in POSITION]
    ):
        if part in columns.known:
            wrench[:, k] = columns.numbers(part)
    centre = _centre(columns, mass)
    if mass is None and not np.any(wrench):
        return None
    return Loads.of(columns.n_rows, mass=mass, centre=centre, wrench=wrench)


def _payload(columns: Columns, robot: Robot) -> Array | None:
    if "payload" not in columns.known:
        return None
    mass = columns.numbers("payload")
    columns.refuse(
        mass <= -robot.mass,
        "payload",
        lambda row: (
            f"expected a payload that leaves the platform some of its {robot.mass:g} kg, got "
            f"{mass[row]:g} kg"
        ),
    )
    return mass


def _centre(columns: Columns, mass: Array | None) -> Array | None:
    """Centres of payloads (n, 3) [m]; NaN, the platform's own, where no cell is filled."""
    present = columns.present("payload", POSITION)
    if not present:
        return None
    missing = [f"payload_{part}_m" for part in POSITION if part not in present]
    if mass is None:
        missing = ["payload_kg"]
    if missing:
        raise columns.half_there(
            "payload", missing, "payload_kg and its centre payload_x_m to _z_m"
        )
    parts = [columns.numbers(f"payload_{part}", blank_is_nan=True) for part in POSITION]
    centre = np.stack(parts, axis=1)
    blank = np.isnan(centre)
    for k, part in enumerate(POSITION):
        columns.refuse(
            blank[:, k] & ~blank.all(axis=1),
            f"payload_{part}",
            lambda row: "incomplete centre; expected all three cells filled or all three empty",
        )
    return centre
