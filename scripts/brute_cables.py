"""What one cable does in brute force for nearest poses: straight, or hanging as a catenary.

Equations and derivatives of its own, so that it can tell on what :mod:`seecr` has.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from seecr.description.robot import Robot
from seecr.pose import Array

_ROUNDS, _EXACT = 60, 1e-13
# Cables that go this little to the side are plumb: what they hang through is next to nothing.
_PLUMB = 1e-3


@dataclass(frozen=True, eq=False)
class Pull:
    """What m cables do to their anchor points at given tensions.

    Attributes:
        force: (m, 3) [N]. by_anchor: (m, 3, 3) [N/m] its rates by the anchor point, by_tension:
            (m, 3) by the tension.
        grip: (m, 3) [N/m] rates of the tension by the anchor point, the cable as long as it is.
    """

    force: Array
    by_anchor: Array
    by_tension: Array
    grip: Array


def straight(robot: Robot, ways: Array, tensions: Array) -> Pull:
    """Cables without weight; ways (m, 3) lead from anchor to exit points."""
    size = np.linalg.norm(ways, axis=1)
    unit = ways / size[:, None]
    across = unit[:, :, None] * unit[:, None] - np.eye(3)
    # a cable's own stiffness EA/l0 with l0 = l/(1 + tau/EA)
    own = (robot.ea + tensions) / size
    return Pull(
        unit * tensions[:, None], across * (tensions / size)[:, None, None], unit,
        -own[:, None] * unit,
    )  # fmt: skip


def nearly_straight(robot: Robot, ways: Array, tensions: Array, weight: float) -> Pull:
    """Cables that hang through by next to nothing, for their own weight on both ends."""
    rise, size = ways @ robot.up, np.linalg.norm(ways, axis=1)
    unit = ways / size[:, None]
    out = straight(robot, ways, tensions - 0.5 * weight * rise)
    lift = 0.5 * weight * (robot.up[:, None] * unit[:, None] + unit[:, :, None] * robot.up)
    return replace(
        out,
        force=out.force - 0.5 * weight * size[:, None] * robot.up,
        by_anchor=out.by_anchor + lift,
    )


def hanging(robot: Robot, ways: Array, tensions: Array, weight: float) -> Pull | None:
    """Cables with weight, see :func:`_catenaries`; None where some can have no such tension."""
    out = nearly_straight(robot, ways, tensions, weight)
    rise, size = ways @ robot.up, np.linalg.norm(ways, axis=1)
    bent = np.flatnonzero(size**2 - rise**2 > (_PLUMB * size) ** 2)
    if len(bent) == 0:
        return out
    with np.errstate(invalid="ignore"):
        found = _catenaries(robot, robot.ea[bent], ways[bent], tensions[bent], weight)
    if found is None:
        return None
    for name in ("force", "by_anchor", "by_tension", "grip"):
        getattr(out, name)[bent] = getattr(found, name)
    return out


def _catenaries(
    robot: Robot, ea: Array, ways: Array, tensions: Array, weight: float
) -> Pull | None:
    """Elastic catenaries (Irvine 1981, section 1.2) by the tension at the exit point.

    Args:
        ea: (m,) [N].
        ways: (m, 3) [m] from anchor to exit points.
        tensions: (m,) [N] at the exit points.
        weight: [N/m].

    Returns:
        None where some cable has no such tension, or more length than that takes.
    """
    up = robot.up
    rise = ways @ up
    flat = ways - rise[:, None] * up
    span = np.linalg.norm(flat, axis=1)
    along = flat / span[:, None]
    found = _solved(span, rise, tensions, weight, ea)
    if found is None:
        return None
    top, length = found
    across, by = _rates(top, length, tensions, weight, ea)
    # unknowns (top, length) by span, rise and tension
    change = np.linalg.solve(by[..., :2], np.concatenate(
        [np.tile(np.eye(2), (len(span), 1, 1)), -by[..., 2:]], axis=2))  # fmt: skip
    side_by = -(top / across)[:, None] * change[:, 0]
    side_by[:, 2] += tensions / across
    lift_by = change[:, 0] - weight * change[:, 1]
    force = across[:, None] * along + (top - weight * length)[:, None] * up
    plane = np.stack([along, np.tile(up, (len(span), 1))], axis=1)
    both = np.stack([side_by, lift_by], axis=1)
    by_way = np.einsum("mia,mij,mjb->mab", plane, both[..., :2], plane)
    level = np.eye(3) - np.outer(up, up) - along[:, :, None] * along[:, None]
    by_way += (across / span)[:, None, None] * level
    by_tension = np.einsum("mi,mia->ma", both[..., 2], plane)
    grip = np.einsum("mj,mja->ma", change[:, 1, :2], plane) / change[:, 1, 2:]
    return Pull(force, -by_way, by_tension, grip)


def _shape(
    top: Array, length: Array, tensions: Array, weight: float, ea: Array
) -> tuple[Array, Array]:
    """Span and rise (m,) [m] of cables with a rise of the pull at their exit points."""
    across, low = np.sqrt(tensions**2 - top**2), top - weight * length
    angles = np.arcsinh(top / across) - np.arcsinh(low / across)
    span = across * (angles / weight + length / ea)
    rise = (tensions - np.hypot(across, low)) / weight + (low + 0.5 * weight * length) * length / ea
    return span, rise


def _rates(
    top: Array, length: Array, tensions: Array, weight: float, ea: Array
) -> tuple[Array, Array]:
    """The level pull (m,) and rates (m, 2, 3) of span and rise by top, length and tension."""
    across, low = np.sqrt(tensions**2 - top**2), top - weight * length
    end = np.hypot(across, low)
    angles = np.arcsinh(top / across) - np.arcsinh(low / across)
    by_across = np.stack([
        (angles - top / tensions + low / end) / weight + length / ea,
        (across / tensions - across / end) / weight,
    ], axis=1)  # fmt: skip
    by_low = np.stack([-across / (weight * end), -low / (weight * end) + length / ea], axis=1)
    by_top = np.stack([across, top], axis=1) / (weight * tensions)[:, None] + by_low
    by_length = np.stack([across, top], axis=1) / ea[:, None] - weight * by_low
    # the level pull is what the tension leaves
    by_top -= (top / across)[:, None] * by_across
    by_tension = (tensions / across)[:, None] * by_across
    return across, np.stack([by_top, by_length, by_tension], axis=2)


def _solved(
    span: Array, rise: Array, tensions: Array, weight: float, ea: Array
) -> tuple[Array, Array] | None:
    """Rise of the pull at exit points (m,) [N] and lengths (m,) [m], by Newton's method."""
    size = np.hypot(span, rise)
    first = np.where(tensions > 0.0, weight * size / np.maximum(tensions, 1e-300), np.inf)
    if first.max() > 3.0:
        return None
    share = rise / size + 0.5 * first * (span / size) ** 2
    top = tensions * np.clip(share, -0.999, 0.999)
    length = size * (1.0 - tensions / ea + (first * span / size) ** 2 / 24.0)
    for _ in range(_ROUNDS):
        x, z = _shape(top, length, tensions, weight, ea)
        left = np.stack([span - x, rise - z], axis=1)
        if not np.isfinite(left).all():
            return None
        if np.abs(left / size[:, None]).max() < _EXACT:
            break
        step = np.linalg.solve(
            _rates(top, length, tensions, weight, ea)[1][..., :2], left[..., None]
        )[..., 0]
        # not beyond the half of what is left of the tension
        room = 0.5 * (tensions - np.sign(step[:, 0]) * top)
        part = np.minimum(1.0, room / np.maximum(np.abs(step[:, 0]), 1e-300))
        part = np.minimum(part, 0.3 * length / np.maximum(np.abs(step[:, 1]), 1e-300))
        top, length = top + part * step[:, 0], length + part * step[:, 1]
    else:
        if not np.abs(left / size[:, None]).max() < 1e-9:
            return None
    by = _rates(top, length, tensions, weight, ea)[1]
    # longer cables that pull as much hang through: on that side the length falls with tension
    more = np.linalg.solve(by[..., :2], by[..., 2:])[:, 1, 0]
    return (top, length) if np.all(more > 0.0) else None
