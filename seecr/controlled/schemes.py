"""Schemes of control: what winches are told for wanted poses, and how readings change that.

A scheme is lengths that are fed forward, and any number of feedbacks on top, each one small class.
The steps of a feedback are those of its rate; see :mod:`seecr.controlled.loop`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from seecr.commands import Commands
from seecr.controlled.belief import Belief
from seecr.controlled.stiffest import stiffest_tensions
from seecr.counted import counted, some
from seecr.errors import InputError
from seecr.pose import Array, changes_between, moved_by

READS = ("position", "orientation", "tensions")
"""What sensors of a robot can read."""


class FeedForward(ABC):
    """What winches are told before anything is read; one small class for each way.

    Attributes:
        name: as in a scheme's name.
    """

    name: ClassVar[str]

    @abstractmethod
    def commands(self, belief: Belief) -> tuple[Commands, NDArray[np.bool_]]:
        """The commands of the n wanted poses, and (n,) whether there is one."""


class GeometricForward(FeedForward):
    """Rigid inverse kinematics, as in the paper's experiment.

    l_i = ||a_i - b_i(p)|| + (l_i0 - ||a_i - b_i(p_0)||) [m], with p the wanted pose and l_i0 the
    rest length at the reference pose p_0 (paper, eqs 1, 2). No model is believed.
    """

    name: ClassVar[str] = "geometric"

    def commands(self, belief: Belief) -> tuple[Commands, NDArray[np.bool_]]:
        return belief.commands, np.ones(len(belief.commands), dtype=bool)


class ElasticForward(FeedForward):
    """Lengths with which the believed robot rests at the wanted pose: :func:`seecr.correct`.

    Of a plain cable l_i = s_i/(1 + tau_i/(E S)) [m], with the span s_i and tensions tau [N] that
    balance the load, W tau = -w_e (paper, eq 3), near to the aim within the limits.
    """

    name: ClassVar[str] = "elastic"

    def commands(self, belief: Belief) -> tuple[Commands, NDArray[np.bool_]]:
        return belief.correction.commands, belief.correction.found


class StiffestForward(FeedForward):
    """As elastic, with the tensions within the limits that make a stiffness largest.

    Picard, Caro, Plestan and Claveau (Stiffness oriented tension distribution algorithm for
    cable-driven parallel robots, Advances in Robot Kinematics 2020; the paper's [11]). See
    :mod:`seecr.controlled.stiffest`.
    """

    name: ClassVar[str] = "stiffness"

    def commands(self, belief: Belief) -> tuple[Commands, NDArray[np.bool_]]:
        found = belief.corrected(stiffest_tensions(belief))
        return found.commands, found.found


class Feedback(ABC):
    """Integral action: a state x (n, k) follows the error e of the readings, and moves winches.

    x <- x - gain G e, and the told lengths are those fed forward plus ``change(x)``. G and the rate
    of ``change`` are of the believed model, at the wanted poses.

    Attributes:
        name: as in a scheme's name. needs: kinds of readings, of :data:`READS`, any of which do.
        base: what it is on top of where a scheme does not say.
        from_home: whether such a loop alone starts with the platform at its reference pose.
    """

    name: ClassVar[str]
    needs: ClassVar[tuple[str, ...]]
    base: ClassVar[str]
    from_home: ClassVar[bool] = False

    @abstractmethod
    def gains(self, belief: Belief, seen: NDArray[np.bool_]) -> Array:
        """G (n, k, 6 + m), by which errors [m, rad, N] change the state.

        Args:
            belief: what the controller knows. seen: (6,) parts of the pose that are read.
        """

    @abstractmethod
    def change(self, belief: Belief, state: Array) -> Array:
        """Change (n, m) [m] of the told lengths in a state (n, k)."""

    @abstractmethod
    def rates(self, belief: Belief, state: Array) -> Array:
        """Derivatives (n, m, k) of ``change`` by the state, in a state (n, k)."""

    def start(self, belief: Belief) -> Array:
        """The state (n, k) of a loop that is alone, where the platform is at its reference pose."""
        return self.rest(belief)

    @abstractmethod
    def rest(self, belief: Belief) -> Array:
        """The state (n, k) that changes nothing: zero."""

    def why_not(self, belief: Belief) -> str:
        """A sentence about what it cannot control; "" for nothing."""
        return ""


class PoseFeedback(Feedback):
    """Integral action on the tracker's pose, through the believed lengths.

    x <- x - gain e [m, rad]: the pose that winches are told is moved against the error, and they
    are told L(p + x) - L(p), to first order J x, with the believed Jacobian J of the lengths
    [m/m, m/rad] (resolved motion: Whitney, IEEE Transactions on Man-Machine Systems 10, 1969). Of
    the error, what lengths cannot change is left out: x stays zero along motions that no cable
    resists.
    """

    name: ClassVar[str] = "pose_feedback"
    needs: ClassVar[tuple[str, ...]] = ("position", "orientation")
    base: ClassVar[str] = "geometric"
    from_home: ClassVar[bool] = True

    def gains(self, belief: Belief, seen: NDArray[np.bool_]) -> Array:
        steered = belief.steered(seen)
        tensions = np.zeros((len(steered), 6, belief.robot.n_cables))
        return np.concatenate([steered * seen, tensions], axis=2)

    def change(self, belief: Belief, state: Array) -> Array:
        poses = belief.commands.pose
        return belief.lengths(moved_by(poses, state)) - belief.lengths(poses)

    def rates(self, belief: Belief, state: Array) -> Array:
        return belief.rates_of(lambda x: self.change(belief, x), state)

    def rest(self, belief: Belief) -> Array:
        return np.zeros((len(belief.commands), 6))

    def start(self, belief: Belief) -> Array:
        return changes_between(belief.robot.reference_pose, belief.commands.pose)


class TensionFeedback(Feedback):
    """Integral action on tensions, around the lengths that ``elastic`` feeds forward.

    Lengths change by dl = gain c (tau - tau*) [m], with tau* [N] the tensions of ``correct`` and
    c_i [m/N] the believed compliance of cable i, l_i/(E S) of a plain one. Of a block and tackle
    tau is that of all falls together, so many times what is read of its line. Winches that hold
    tensions do so by themselves, the others hold lengths. If none is named, all do, but of the
    error only what moves no platform, its part in the null space of W. So forces are controlled
    along some directions and positions along the others (Raibert and Craig, Hybrid position/force
    control of manipulators, ASME Journal of Dynamic Systems, Measurement and Control 103, 1981).
    """

    name: ClassVar[str] = "tension_feedback"
    needs: ClassVar[tuple[str, ...]] = ("tensions",)
    base: ClassVar[str] = "elastic"

    def gains(self, belief: Belief, seen: NDArray[np.bool_]) -> Array:
        slope, share = belief.rates.by_length, self._share(belief)
        softness = -np.divide(1.0, slope, out=np.zeros_like(slope), where=slope != 0.0)
        out = -softness[:, :, None] * share * belief.robot.falls
        return np.concatenate([np.zeros((*softness.shape, 6)), out], axis=2)

    def _share(self, belief: Belief) -> Array:
        """(n, m, m) the part of errors of tensions that is done away with; none of slack cables.

        Nor of passive lines, which follow from where the platform is.
        """
        m, holding, driven = belief.robot.n_cables, belief.limits.holding, belief.robot.driven
        pulls = belief.rates.by_tension * driven
        taut = (belief.rates.by_length != 0.0) & driven & belief.correction.found[:, None]
        if holding is not None:
            chosen = taut & np.isin(np.arange(m), holding)
            return np.asarray(np.eye(m) * chosen[:, None, :])
        share = np.eye(m) - np.linalg.pinv(pulls, rcond=_SPARE) @ pulls
        share = share * taut[:, :, None] * taut[:, None, :]
        return np.asarray(np.where(np.abs(share) > _SPARE, share, 0.0))

    def change(self, belief: Belief, state: Array) -> Array:
        return state

    def rates(self, belief: Belief, state: Array) -> Array:
        return np.broadcast_to(np.eye(state.shape[1]), (*state.shape, state.shape[1]))

    def rest(self, belief: Belief) -> Array:
        return np.zeros((len(belief.commands), belief.robot.n_cables))

    def why_not(self, belief: Belief) -> str:
        holding = belief.limits.holding
        if holding is not None:
            return self._leaves_free(belief, holding)
        if np.any(self._share(belief)):
            return ""
        return (
            f"{belief.robot.name} has no taut cable to spare at these poses, so that its tensions "
            "follow from the load; expected more cables than degrees of freedom, and a lowest "
            "tension above 0 that keeps them taut"
        )

    def _leaves_free(self, belief: Belief, holding: tuple[int, ...]) -> str:
        """Why the lengths of the other lines do not hold the platform; "" if they do.

        Passive springs keep their lengths as well. A constant tension holds nothing.
        """
        robot, pulls = belief.robot, belief.rates.by_tension[belief.correction.found]
        others = np.delete(np.arange(robot.n_cables), holding)
        whole, left = (np.linalg.matrix_rank(p, tol=_HELD) for p in (pulls, pulls[:, :, others]))
        free = np.flatnonzero(left < whole)
        if len(free) == 0:
            return ""
        held, most = int(whole[free[0]]), int(np.sum(robot.ea > 0.0))
        more, springs = int(robot.driven[others].sum()), most - robot.n_driven
        keep = counted(more, "winch").replace("winchs", "winches")
        keep += f" and {counted(springs, 'spring')}" if springs else ""
        return (
            f"if {some([robot.cable_names[k] for k in holding])} hold tensions, only {keep} hold "
            f"lengths, which leaves the platform free to move: cables hold "
            f"{counted(held, 'degree')} of freedom there; expected at most {most - held} that hold "
            "tensions"
        )


# Pulls of cables that are no combination of the others' to less than this are rounding.
_SPARE = 1e-9
# A motion that pulls of one newton resist with less than this [N] is free.
_HELD = 1e-6
FORWARDS: dict[str, type[FeedForward]] = {
    c.name: c for c in (GeometricForward, ElasticForward, StiffestForward)
}
FEEDBACKS: dict[str, type[Feedback]] = {c.name: c for c in (PoseFeedback, TensionFeedback)}


@dataclass(frozen=True, eq=False)
class Scheme:
    """A feed-forward with feedbacks on top.

    Attributes:
        name: "elastic+pose_feedback", for example.
        forward: what is told first.
        feedbacks: on top of it.
        from_home: whether the loop starts at the reference pose and does all by itself.
    """

    name: str
    forward: FeedForward
    feedbacks: tuple[Feedback, ...] = ()
    from_home: bool = False

    @classmethod
    def named(cls, name: str) -> Scheme:
        """The scheme of a name: one of :data:`FORWARDS` and :data:`FEEDBACKS`, or several with +.

        Raises:
            InputError: a part that is unknown, or two that feed forward.
        """
        parts = [part.strip() for part in name.split("+")]
        known = (*FORWARDS, *FEEDBACKS)
        for part in parts:
            if part not in known:
                raise InputError(
                    f"scheme {name!r}: expected {some(known, len(known))}, or a sum such as "
                    f"elastic+pose_feedback, got {part!r}"
                )
        forwards = [part for part in parts if part in FORWARDS]
        if len(forwards) > 1 or len(set(parts)) < len(parts):
            raise InputError(
                f"scheme {name!r}: expected one feed-forward and feedbacks on top of it, each "
                "once; give two schemes with a comma between them to compare them"
            )
        loops = tuple(FEEDBACKS[part]() for part in parts if part in FEEDBACKS)
        alone = not forwards
        bases = {loop.base for loop in loops}
        base = forwards[0] if forwards else "elastic" if "elastic" in bases else bases.pop()
        return cls(name, FORWARDS[base](), loops, alone and all(one.from_home for one in loops))

    def check(self, belief: Belief, reads: Sequence[str]) -> None:
        """Refuse readings that the robot has not, and what a feedback cannot control.

        Raises:
            InputError: in a sentence.
        """
        for loop in self.feedbacks:
            if not set(loop.needs) & set(reads):
                raise InputError(
                    f"scheme {self.name}: for {loop.name} it needs readings of "
                    f"{' or '.join(loop.needs)}, and this robot reads "
                    f"{' and '.join(reads) or 'nothing'}; leave the scheme out, or say what is read"
                )
            if why := loop.why_not(belief):
                raise InputError(f"scheme {self.name}: {why}")
