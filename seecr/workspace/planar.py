"""Planar robots in closed form: a bar on two cables, and pairs of parallel cables.

Everything here lies in the paper's vertical plane: x horizontal, y upwards, and a tilt theta that
turns x towards y (Fig 2). In the shipped planar robots, which lie in the x-z plane, theta is minus
the value of the hinge about +y.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from seecr.arguments import finite, numbers
from seecr.errors import InputError
from seecr.pose import Array
from seecr.result import Record, Result

# A root of the quartic this far off the unit circle is not an angle (roots are polished later).
_OFF_CIRCLE = 1e-5
# Sine of the angle between cables on one line, up to rounding.
_OPPOSED = 1e-12
# A tension below this part of the weight is zero: forces of poses at rest balance to as much.
_ROUNDED = 1e-9


def bar_tilt(exit_points: ArrayLike, positions: ArrayLike, half_length: float = 0.0) -> Array:
    """Tilt at which a bar on two inextensible cables is in equilibrium (paper, section III-A).

    The centre of mass is the bar's middle. For a half length of zero this is the paper's
    closed form, eqs 5 and 6 without their misprints,

        theta = 2 atan((B + sqrt(B^2 + A^2)) / -A) = atan(A / B),
        A = Y1 X2 + Y2 X1,  B = 2 X1 X2,  X_i = a_ix - p_x,  Y_i = a_iy - p_y,

    which the paper gives for any bar, but which only holds in the limit of zero half length.
    Otherwise it is the tilt at which the lines of both cables and of the weight meet in one point,
    to rounding. If there are several, it is the most level one that is stable with both cables
    taut.

    Args:
        exit_points: a_1, a_2, (2, 2) [m].
        positions: of the bar's middle, (..., 2) [m].
        half_length: from the middle to either anchor point, h [m]; cable 1 holds the end at -h.

    Returns:
        theta, (...) [rad]; nan if the two cables cannot hold the bar.

    Raises:
        InputError: wrong shapes, numbers that are not finite, or a negative half length.

    Example:
        ``seecr.bar_tilt([[0, 1], [1, 1]], [[0.4, 0.5]], 0.1)``
    """
    exits, places = _points(exit_points), finite(positions, "positions")
    if places.shape[-1:] != (2,):
        raise InputError(f"positions must be (..., 2), x y, got {places.shape}")
    half_length = _half_length(half_length)
    if half_length < 0.0:
        raise InputError(f"half_length must not be negative [m], got {half_length:g}")
    to_exit = exits - places[..., None, :]
    if half_length == 0.0:
        return _point_tilt(to_exit)
    flat = to_exit.reshape(-1, 2, 2)
    tilts = [_most_level(_roots(one, half_length), one, half_length) for one in flat]
    return np.array(tilts).reshape(places.shape[:-1])


@dataclass(frozen=True, repr=False)
class BarRest(Result):
    """An equilibrium of a bar on two inextensible cables.

    Attributes:
        theta: tilt [rad].
        tensions: of both cables, in weights; negative for a cable that would have to push.
        stable: whether no cable would have to push and the equilibrium is stable: the bar's one
            free motion raises its middle.
    """

    theta: float
    tensions: tuple[float, float]
    stable: bool

    def lines(self) -> list[str]:
        """One line: tilt, tensions, and stability."""
        first, second = self.tensions
        return [
            f"tilted by {np.degrees(self.theta):.4g} deg, tensions of {first:.4g} and "
            f"{second:.4g} times the weight, {'stable' if self.stable else 'not stable'}"
        ]

    def as_json(self) -> Record:
        """Its only row."""
        return self.records()[0]

    def records(self) -> Sequence[Record]:
        """One row; tensions in weights."""
        tensions = dict(zip(("tension_1", "tension_2"), self.tensions, strict=True))
        return [{"theta_rad": self.theta, **tensions, "stable": self.stable}]


def bar_equilibria(
    exit_points: ArrayLike, position: ArrayLike, half_length: float
) -> tuple[BarRest, ...]:
    """All tilts at which a bar on two cables is in equilibrium at a position, in ascending order.

    There the lines of both cables and of the weight meet in one point. The tilts are the roots of a
    quartic in exp(i theta), two or four. Those at which both cables are on one line are left out:
    no tension carries the weight there. The paper speaks of a unique one; if there are more,
    several can be stable.

    Args:
        exit_points: (2, 2) [m].
        position: (2,) [m] of the bar's middle.
        half_length: h [m], above zero.

    Returns:
        the tilts [rad], each with whether it is stable.

    Raises:
        InputError: wrong shapes, numbers that are not finite, a length that is not above zero, or
            coinciding exit points.

    Example:
        ``seecr.bar_equilibria([[0, 1], [1, 1]], [0.4, 0.5], 0.1)``
    """
    half_length = _half_length(half_length)
    if half_length <= 0.0:
        raise InputError(f"half_length must be above zero [m], got {half_length:g}")
    place = finite(position, "position")
    if place.shape != (2,):
        raise InputError(f"position must be (2,), x y, got {place.shape}")
    exits = _points(exit_points)
    if np.array_equal(exits[0], exits[1]):
        raise InputError(
            "exit_points must be two places, got one for both cables: there the bar swings as a "
            "pendulum, and tensions are not determined"
        )
    to_exit = exits - place
    found = []
    for theta in np.sort(_roots(to_exit, half_length)):
        tensions, stable = _balance(theta, to_exit, half_length)
        if np.all(np.isfinite(tensions)):
            found.append(BarRest(float(theta), tensions, stable))
    return tuple(found)


def solution_manifold(
    exit_points: ArrayLike, x: ArrayLike, y: ArrayLike, half_length: float = 0.0
) -> Array:
    """Tilts at which the bar is in equilibrium, over a grid of positions (paper, Fig 3).

    Args:
        exit_points: (2, 2) [m].
        x, y: (k,) and (r,) [m], the grid.
        half_length: [m].

    Returns:
        (r, k) [rad]; nan where the two cables cannot hold the bar.

    Raises:
        InputError: wrong shapes, numbers that are not finite, or a negative half length.

    Example:
        ``seecr.solution_manifold([[0, 1], [1, 1]], [0.3, 0.4], [0.5], 0.1)``
    """
    grid = np.stack(np.meshgrid(finite(x, "x"), finite(y, "y")), axis=-1)
    return bar_tilt(exit_points, grid, half_length)


def midline_point(exit_points: ArrayLike, anchor_points: ArrayLike) -> Array:
    """Where the midlines of two pairs of parallel cables meet: the paper's V or H (Fig 9).

    Cables 1 and 2 are one pair, 3 and 4 the other. Equal tensions in a parallel pair amount to
    one force along its midline. So the platform can only be in equilibrium with equal tensions on
    each side if the weight acts through this point.

    Args:
        exit_points: (4, 2) or (..., 4, 2) [m].
        anchor_points: in the same frame, at the pose in question, (..., 4, 2) [m].

    Returns:
        (..., 2) [m]; infinite if the midlines are parallel.

    Raises:
        InputError: wrong shapes.

    Example:
        ``seecr.midline_point(planar.exit_points[:, [0, 2]], planar.anchor_points[:, [0, 2]])``
    """
    exits, anchors = numbers(exit_points, "exit_points"), numbers(anchor_points, "anchor_points")
    if exits.shape[-2:] != (4, 2) or anchors.shape[-2:] != (4, 2):
        raise InputError(
            "exit_points and anchor_points must be (..., 4, 2), got "
            f"{exits.shape} and {anchors.shape}"
        )
    top, bottom = _middles(exits), _middles(anchors)
    along = top - bottom
    across = _cross(along[..., 0, :], along[..., 1, :])
    between = bottom[..., 1, :] - bottom[..., 0, :]
    with np.errstate(divide="ignore", invalid="ignore"):
        part = _cross(between, along[..., 1, :]) / across
        point = bottom[..., 0, :] + part[..., None] * along[..., 0, :]
    return np.where(across[..., None] == 0.0, np.inf, point)


def _points(values: ArrayLike) -> Array:
    points = numbers(values, "exit_points")
    if points.shape != (2, 2) or not np.all(np.isfinite(points)):
        raise InputError(f"exit_points must be (2, 2) finite numbers, got {points.shape}")
    return points


def _half_length(value: float) -> float:
    length = finite(value, "half_length")
    if length.shape:
        raise InputError(f"half_length must be one number [m], got {length.shape}")
    return float(length)


def _middles(points: Array) -> Array:
    return 0.5 * (points[..., 0::2, :] + points[..., 1::2, :])


def _cross(a: Array, b: Array) -> Array:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def _point_tilt(to_exit: Array) -> Array:
    """Eqs 5 and 6 as one arctangent, whose numerator and denominator do not cancel."""
    (x1, y1), (x2, y2) = to_exit[..., 0, :].T, to_exit[..., 1, :].T
    a, b = (y1 * x2 + y2 * x1).T, (2.0 * x1 * x2).T
    # both cables pull: they are on either side, and together pull upwards
    lift = (y1 * x2 - y2 * x1).T * np.sign((x2 - x1).T)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where((b < 0.0) & (lift > 0.0), np.arctan(a / b), np.nan)


def _equation(theta: Array, to_exit: Array, h: float) -> tuple[Array, Array]:
    """Zero where the lines of both cables and of the weight meet in one point; and its derivative.

        -2 X1 X2 sin + h sin cos (X1 - X2) + cos (Y1 X2 + Y2 X1) + h cos^2 (Y2 - Y1)

    with X_i = a_ix - p_x and Y_i = a_iy - p_y. It is the torque about the bar's middle of the two
    forces that balance its weight, cleared of denominators, and replaces eqs 5 and 6 for a bar of
    half length h.
    """
    x1, y1 = to_exit[..., 0, 0], to_exit[..., 0, 1]
    x2, y2 = to_exit[..., 1, 0], to_exit[..., 1, 1]
    s, c = np.sin(theta), np.cos(theta)
    a, b = -2.0 * x1 * x2, h * (x1 - x2)
    d, e = y1 * x2 + y2 * x1, h * (y2 - y1)
    value = a * s + b * s * c + d * c + e * c * c
    slope = a * c + b * (c * c - s * s) - d * s - 2.0 * e * s * c
    return value, slope


def _roots(to_exit: Array, h: float) -> Array:
    """All angles that solve the equation, from its quartic in exp(i theta), polished."""
    (x1, y1), (x2, y2) = to_exit
    single = complex(y1 * x2 + y2 * x1, 2.0 * x1 * x2) / 2.0
    double = complex(h * (y2 - y1), -h * (x1 - x2)) / 4.0
    constant = h * (y2 - y1) / 2.0
    z = np.roots([double, single, constant, single.conjugate(), double.conjugate()])
    theta = np.angle(z[np.abs(np.abs(z) - 1.0) < _OFF_CIRCLE])
    for _ in range(4):
        value, slope = _equation(theta, to_exit, h)
        theta = theta - value / np.where(slope == 0.0, np.inf, slope)
    return np.asarray(theta)


def _most_level(theta: Array, to_exit: Array, h: float) -> float:
    held = theta[[_balance(t, to_exit, h)[1] for t in theta]] if len(theta) else theta
    return float(held[np.argmin(np.abs(held))]) if len(held) else float("nan")


def _balance(theta: float, to_exit: Array, h: float) -> tuple[tuple[float, float], bool]:
    """Tensions in weights; whether none is below zero and the bar's one free motion raises it.

    That motion keeps both cable lengths. The second derivative of the energy along it is tension
    times second derivative of length, summed over the cables.
    """
    arms = h * np.array([[-1.0], [1.0]]) * np.array([np.cos(theta), np.sin(theta)])
    cables = to_exit - arms
    lengths = np.linalg.norm(cables, axis=1)
    if np.any(lengths == 0.0):
        return (np.nan, np.nan), False
    u = cables / lengths[:, None]
    # forces that cancel horizontally and carry the weight: tau_1 u_1x + tau_2 u_2x = 0
    lift = _cross(u[0], u[1])
    if abs(lift) < _OPPOSED:
        return (np.nan, np.nan), False
    tension = np.array([-u[1, 0], u[0, 0]]) / lift
    tension[np.abs(tension) < _ROUNDED] = 0.0
    pair = (float(tension[0]), float(tension[1]))
    if np.any(tension < 0.0):
        return pair, False
    rows = np.column_stack([u, _cross(arms, u)])
    x, y, turn = np.cross(rows[0], rows[1])
    moves = np.array([x, y]) + turn * np.column_stack([-arms[:, 1], arms[:, 0]])
    sideways = np.sum(moves**2, axis=1) - np.sum(moves * u, axis=1) ** 2
    bending = sideways / lengths + turn**2 * np.sum(arms * u, axis=1)
    return pair, bool(tension @ bending > 0.0)
