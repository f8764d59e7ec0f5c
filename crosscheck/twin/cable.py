"""Cables of a twin: springs for MuJoCo's tendons, laws for which it has none, and how chains hang.

A cable in MuJoCo is a one-sided spring, T = k x + p x^2 + q x^3 with x = L - rest. For
hysteresis, creep and friction the law is implemented here, and the spring is its tangent at the
present length. MuJoCo settles, and a new tangent is taken, until the two agree.

The point masses of a hanging cable start where a chain hangs; MuJoCo then finds their equilibrium.
With both ends held, the tension in the lowest segment determines the shape. It minimises a
convex function (the complementary energy), so Newton's method always finds it, however slack the
cable is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from crosscheck.twin.robot import TrueRobot
from seecr.pose import Array

_BISECTIONS = 200
_ITERATIONS, _SHORTENINGS = 100, 40


@dataclass(frozen=True, eq=False)
class Springs:
    """One-sided springs of m cables.

    Attributes:
        rest: (m,) [m]; stiffness: (m,) [N/m]; poly: (m, 2) [N/m^2, N/m^3].
    """

    rest: Array
    stiffness: Array
    poly: Array

    @classmethod
    def plain(cls, lengths: Array, true: TrueRobot) -> Springs:
        """Elastic cables of rest lengths (m,) [m]."""
        k = true.ea / lengths
        poly = np.stack([k / lengths * true.quadratic, k / lengths**2 * true.cubic], axis=1)
        return cls(lengths.copy(), k, poly)

    def halfway(self, other: Springs) -> Springs:
        """The mean of these springs and others."""
        rest = 0.5 * (self.rest + other.rest)
        stiffness = 0.5 * (self.stiffness + other.stiffness)
        return Springs(rest, stiffness, 0.5 * (self.poly + other.poly))


@dataclass(eq=False)
class Cable:
    """One cable with a history.

    Attributes:
        true: the robot; ea: [N].
        rest: paid-out length [m].
        stretch, pull: e = l0 eps [m] and Dahl's part of the tension [N] when it last pulled: a
            slack cable keeps those at which its tension became zero, and continues from there.
        crept: creep strain then.
        creep_by_tension: creep strain at the end of this step per newton of tension at its end.
        winch_tension: [N] behind the exit point while the cable does not slip.
        fresh: whether a run starts, without any history but creep.
    """

    true: TrueRobot
    ea: float
    rest: float = 1.0
    stretch: float = 0.0
    pull: float = 0.0
    crept: float = 0.0
    creep_by_tension: float = 0.0
    winch_tension: float = 0.0
    fresh: bool = True
    strain: float = field(default=0.0, init=False)
    tension_before: float = field(default=0.0, init=False)

    def tension(self, strain: float) -> tuple[float, float, float]:
        """Tension [N], its slope [N], and Dahl's part [N] at a strain >= 0."""
        q, c = self.true.quadratic, self.true.cubic
        tension = self.ea * (strain + q * strain**2 + c * strain**3)
        slope = self.ea * (1.0 + 2.0 * q * strain + 3.0 * c * strain**2)
        if self.fresh or self.true.hysteresis == 0.0:
            return tension, slope, 0.0
        # dz/de = (amplitude - z sign(de)) / stretch, integrated from the last equilibrium
        change = self.rest * strain - self.stretch
        end = math.copysign(self.true.hysteresis, change)
        left = math.exp(-abs(change) / self.true.hysteresis_stretch)
        z = end + (self.pull - end) * left
        z_slope = abs(end - self.pull) * left * self.rest / self.true.hysteresis_stretch
        return tension + z, slope + z_slope, z

    def behind(self, tension: float) -> tuple[float, float]:
        """Tension behind the exit point [N], and its slope, with capstan friction."""
        if self.fresh or self.true.friction == 0.0:
            return tension, 1.0
        grip = math.exp(self.true.friction)
        held = min(max(self.winch_tension, tension / grip), tension * grip)
        slope = 0.0 if held == self.winch_tension else held / tension if tension > 0.0 else grip
        return held, slope

    def length(self, strain: float) -> tuple[float, float, float, float]:
        """Length [m] and its slope, tension [N] and its slope, at a strain."""
        tension, slope, _ = self.tension(strain)
        if tension < 0.0:
            tension = 0.0
        behind, behind_slope = self.behind(tension)
        soft = self.true.winch_side / self.ea if self.true.friction > 0.0 else 0.0
        length = self.rest * (1.0 + strain + self.crept + self.creep_by_tension * tension)
        length += soft * behind
        rate = self.rest * (1.0 + self.creep_by_tension * slope) + soft * behind_slope * slope
        return length, rate, tension, slope

    def tangent(self, length: float) -> tuple[float, float]:
        """Rest length [m] and stiffness [N/m] of the spring tangent to the law at a length."""
        self.strain = self._strain_at(length)
        at, rate, tension, slope = self.length(self.strain)
        stiffness = slope / rate
        if tension == 0.0:
            # slack: the spring becomes taut where the law does
            return at, stiffness
        return at - tension / stiffness, stiffness

    def _strain_at(self, length: float) -> float:
        """Strain at which the cable has this length, or at which it just becomes taut.

        Newton's method inside a bracket; at the point where a cable becomes taut, bisection alone.
        """
        low, high = 0.0, max(2.0 * self.strain, 1e-6)
        while not self._reaches(length, high):
            low, high = high, 2.0 * high
        strain = min(max(self.strain, low), high)
        for _ in range(_BISECTIONS):
            at, rate, tension, _ = self.length(strain)
            if tension > 0.0 and abs(at - length) <= 2e-16 * length:
                return strain
            if tension > 0.0 and at >= length:
                high = strain
            else:
                low = strain
            following = strain - (at - length) / rate
            if not (tension > 0.0 and low < following < high):
                following = 0.5 * (low + high)
            if following in (low, high):
                break
            strain = following
        return high

    def _reaches(self, length: float, strain: float) -> bool:
        at, _, tension, _ = self.length(strain)
        return tension > 0.0 and at >= length

    def rests(self, slack: bool) -> None:
        """Store the state in which the cable has come to rest."""
        tension, _, z = self.tension(self.strain)
        tension = 0.0 if slack else max(tension, 0.0)
        self.winch_tension = self.behind(tension)[0]
        # for a slack cable the strain is that at which its tension becomes zero, unless it already
        # was
        if self.fresh or not slack or self.rest * self.strain < self.stretch:
            self.stretch = self.rest * self.strain
            self.pull = 0.0 if self.fresh else z
        self.crept += self.creep_by_tension * tension
        self.creep_by_tension = 0.0
        self.tension_before = tension

    def pays_out(self, rest: float, elapsed: float, fresh: bool) -> None:
        """Begin a step: a new rest length [m], some time later [s].

        Creep strain c follows time dc/dt = amount T/EA - c, with a tension that is linear in time
        from the last value to the coming one; between runs it is the coming one throughout.
        """
        paid, self.rest, self.fresh = rest - self.rest, rest, fresh
        if self.true.friction > 0.0 and self.true.winch_side > 0.0:
            self.winch_tension -= paid * self.ea / self.true.winch_side
        if self.true.creep == 0.0:
            return
        x = elapsed / self.true.creep_time
        left = math.exp(-x)
        mean = -math.expm1(-x) / x if x > 0.0 else 1.0
        now, before = (1.0 - left, 0.0) if fresh else (1.0 - mean, mean - left)
        per_newton = self.true.creep / self.ea
        self.crept = self.crept * left + per_newton * before * self.tension_before
        self.creep_by_tension = per_newton * now


def hang(start: Array, end: Array, rest: Array, ea: Array, weight: Array, segments: int) -> Array:
    """Point masses (m, N - 1, 3) [m] of m chains, from start to end.

    Args:
        start: (m, 3) [m] upper ends.
        end: (m, 3) [m] lower ends, on the platform.
        rest: (m,) [m] unstretched lengths.
        ea: (m,) [N].
        weight: (3,) [N/m] of cable, upwards.
        segments: N.
    """
    part = rest / segments
    steps = np.arange(segments)[None, :, None] * part[:, None, None] * weight
    pull = _pull(start - end, part, ea, steps)
    force = pull[:, None] + steps
    size = np.linalg.norm(force, axis=2, keepdims=True)
    pieces = part[:, None, None] * (1.0 + size / ea[:, None, None]) * force / size
    # summed from the platform upwards; the last piece ends at the exit point
    return np.asarray((end[:, None] + np.cumsum(pieces, axis=1))[:, -2::-1])


def _pull(span: Array, part: Array, ea: Array, steps: Array) -> Array:
    """Tension (m, 3) [N] of the lowest segments, for spans (m, 3) [m] from there to the top."""
    n = steps.shape[1]
    chord = np.linalg.norm(span, axis=1)
    stretch = np.maximum(chord / (n * part) - 1.0, 0.0)
    weight = np.linalg.norm(steps[:, -1], axis=1) * n / max(n - 1, 1)
    along = (ea * stretch + 0.3 * weight) / chord
    pull = along[:, None] * span - 0.5 * steps[:, -1]
    for _ in range(_ITERATIONS):
        value, slope, curvature = _complementary(pull, span, part, ea, steps)
        step = -np.linalg.solve(curvature, slope[..., None])[..., 0]
        falls = np.einsum("mi,mi->m", slope, step)
        size = np.ones(len(pull))
        for _ in range(_SHORTENINGS):
            trial = pull + size[:, None] * step
            worse = _complementary(trial, span, part, ea, steps)[0] > value + 1e-4 * size * falls
            worse &= np.abs(size * falls) > 1e-14 * np.abs(value)
            if not np.any(worse):
                break
            size[worse] *= 0.5
        pull = trial
        if np.all(np.linalg.norm(slope, axis=1) < 1e-12 * n * part):
            break
    return np.asarray(pull)


def _complementary(
    pull: Array, span: Array, part: Array, ea: Array, steps: Array
) -> tuple[Array, Array, Array]:
    """Complementary energy (m,) [J], its gradient (m, 3) [m] and Hessian (m, 3, 3) [m/N]."""
    force = pull[:, None] + steps
    size = np.maximum(np.linalg.norm(force, axis=2), 1e-300)
    value = part * np.sum(size + size**2 / (2.0 * ea[:, None]), axis=1)
    value = value - np.einsum("mi,mi->m", pull, span)
    unit = force / size[..., None]
    slope = part[:, None] * np.sum((1.0 + size / ea[:, None])[..., None] * unit, axis=1) - span
    turn = np.eye(3) - unit[..., :, None] * unit[..., None, :]
    curvature = np.sum(turn / size[..., None, None], axis=1)
    curvature = curvature + (steps.shape[1] / ea)[:, None, None] * np.eye(3)
    return value, slope, part[:, None, None] * curvature
