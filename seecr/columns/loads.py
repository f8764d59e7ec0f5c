"""Columns of known loads: payloads, forces and moments."""

from __future__ import annotations

import numpy as np

from seecr.columns.known import POSITION, Columns
from seecr.commands.loads import Loads
from seecr.description.robot import Robot
from seecr.pose import Array

# A load that would strain all cables together, if they were parallel to it, by this much: few ropes
# bear it. Robots with softer ones carry so many times their platform's weight or their tension.
_STRAIN, _TIMES = 0.05, 10.0
# A payload of so many times the platform's mass is noted.
_HEAVY = 5.0
# Units that a load which is too large by a thousand may be in.
_SMALLER = {"kg": "g", "kN": "N"}


def known_loads(columns: Columns, robot: Robot) -> Loads | None:
    """The known load of each row, or None if the file has no such columns.

    Raises:
        InputFileError: a centre without a payload, an incomplete centre, one that is farther from
            the platform than the robot is large, a payload that leaves the platform without mass,
            or a load that the cables cannot carry.
    """
    mass = _payload(columns, robot)
    wrench = np.zeros((columns.n_rows, 6))
    for k, part in enumerate(
        [f"{kind}_{axis}" for kind in ("force", "moment") for axis in POSITION]
    ):
        if part in columns.known:
            wrench[:, k] = columns.numbers(part)
            arm = 1.0 if k < 3 else robot.reach
            _refuse_heavy(columns, part, wrench[:, k], arm * _most(robot), "N" if k < 3 else "N m")
    centre = _centre(columns, mass, robot)
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
    gravity = float(np.linalg.norm(robot.gravity))
    if gravity > 0.0:
        _refuse_heavy(columns, "payload", mass, _most(robot) / gravity, "kg")
        _note_heavy(columns, mass, robot)
    return mass


def _most(robot: Robot) -> float:
    """More than all cables together can carry [N]."""
    weight = robot.mass * float(np.linalg.norm(robot.gravity))
    pull = float(np.sum(robot.ea * np.maximum(robot.reference_lengths / robot.rest_lengths - 1, 0)))
    return max(_STRAIN * float(np.sum(robot.ea)), _TIMES * weight, _TIMES * pull)


def _refuse_heavy(columns: Columns, quantity: str, load: Array, most: float, unit: str) -> None:
    smaller = _SMALLER.get(columns.known[quantity].unit.suffix)
    guess = f"is it in {smaller}? Name the column {quantity}_{smaller}" if smaller else "check it"
    columns.refuse(
        np.abs(load) > most,
        quantity,
        lambda row: (
            f"expected a load that the cables of this robot can carry, at most {most:.3g} {unit}, "
            f"got {load[row]:g} {unit}; {guess}"
        ),
    )


def _note_heavy(columns: Columns, mass: Array, robot: Robot) -> None:
    """Note payloads in kg that are many times the platform's mass."""
    most = float(np.max(mass))
    column = columns.known["payload"]
    if robot.mass > 0.0 and most > _HEAVY * robot.mass and column.unit.suffix == "kg":
        columns.notes.append(
            f"Column {column.name} is up to {most:g} kg, {most / robot.mass:.3g} times the mass of "
            "the platform: if it is in g, name it payload_g."
        )


def _refuse_far(columns: Columns, centre: Array, robot: Robot) -> None:
    """Refuse centres (n, 3) farther from all anchor points than the robot is large."""
    apart = np.linalg.norm(centre[:, None] - robot.anchor_points, axis=-1).min(axis=1)
    far = apart > robot.reach  # False where it is not given
    if np.any(far):
        largest = int(np.argmax(np.abs(centre[int(np.argmax(far))])))
        columns.refuse(
            far,
            f"payload_{POSITION[largest]}",
            lambda row: (
                "expected the centre of a payload on the platform, in the platform's frame, got "
                f"one that is {apart[row]:.3g} m from its anchor points, where the frame is "
                f"{robot.reach:.3g} m across"
            ),
        )


def _centre(columns: Columns, mass: Array | None, robot: Robot) -> Array | None:
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
    _refuse_far(columns, centre, robot)
    return centre
