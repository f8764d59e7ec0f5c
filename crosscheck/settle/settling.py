"""What a settling in MuJoCo gives back: statuses, one pose's answer, a batch's answers."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seecr.pose import Array


class SettleStatus(Enum):
    """How a settling ended; the value is the sentence a person reads."""

    SETTLED = "MuJoCo came to rest in a stable equilibrium"
    DIVERGED = "MuJoCo's state became infinite or not a number, also with shorter time steps"
    TIME_LIMIT = "MuJoCo had not come to rest after the allowed number of steps"
    FELL = "nothing holds the platform: in MuJoCo it left by over ten times the robot's size"
    UNSTABLE = "MuJoCo stopped on an unstable equilibrium again and again, though pushed off it"
    POLISH_MOVED = "the polish left the equilibrium in which MuJoCo had come to rest"
    POLISH_STALLED = "the polish could not balance the forces down to rounding"


@dataclass(frozen=True, eq=False)
class Settling:
    """One platform at rest, or why not: on failure every number of the answer is NaN.

    Attributes:
        status: how it ended.
        pose: (7,) after the polish.
        qpos: (nq,) MuJoCo's coordinates of that pose.
        tensions: (m,) [N] after the polish.
        slack: (m,) which cables carry nothing; all False on failure.
        energy: potential energy [J], see :meth:`crosscheck.settle.physics.Physics.energy`.
        smallest_eigenvalue: of the stiffness [N/m], rotations as metres at the robot's length;
            within ``neutral`` of zero where the platform may move freely.
        neutral: below this an eigenvalue is rounding [N/m].
        residual: unbalanced force after the polish relative to the load (torques over length).
        rounding: the relative residual that rounding alone may leave.
        settled_pose: (7,) after stage 1 alone.
        settled_residual: as residual, after stage 1 alone; also given on failure.
        steps: of MuJoCo in stage 1.
        time_step: [s] at the end of stage 1.
        simulated_s: simulated time of stage 1 [s].
        settle_wall_s: time that stage 1 took [s].
        polish_steps: Newton steps of stage 2.
        polish_wall_s: time that stage 2 took [s].
        polish_moved_m: how far stage 2 moved the platform [m].
        polish_moved_rad: how far stage 2 turned it [rad].
        nudges: how often the platform was pushed off an unstable equilibrium.
    """

    status: SettleStatus
    pose: Array
    qpos: Array
    tensions: Array
    slack: NDArray[np.bool_]
    energy: float
    smallest_eigenvalue: float
    neutral: float
    residual: float
    rounding: float
    settled_pose: Array
    settled_residual: float
    steps: int
    time_step: float
    simulated_s: float
    settle_wall_s: float
    polish_steps: int
    polish_wall_s: float
    polish_moved_m: float
    polish_moved_rad: float
    nudges: int

    @property
    def settled(self) -> bool:
        """Whether there is an answer."""
        return self.status is SettleStatus.SETTLED

    @property
    def free_to_move(self) -> bool:
        """Whether some motion changes no force: where it stops along it is then arbitrary.

        Two taut cables, say, leave a platform free to turn about the line through their
        anchor points when its centre of mass lies on that line.
        """
        return self.settled and self.smallest_eigenvalue <= self.neutral

    @property
    def wall_s(self) -> float:
        """Time of both stages [s]."""
        return self.settle_wall_s + self.polish_wall_s


class SettlingBatch(tuple[Settling, ...]):
    """Settlings in the order of their poses; any attribute of one, stacked: ``batch.pose``.

    ``batch.pose`` is (n, 7), ``batch.tensions`` (n, m), ``batch.status`` (n,) of
    :class:`SettleStatus`, ``batch.settled`` (n,) bool, and so on.
    """

    __slots__ = ()

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_") or not (name in _FIELDS or hasattr(Settling, name)):
            raise AttributeError(f"a settling has no {name}")
        values = [getattr(one, name) for one in self]
        if name == "status":
            stacked = np.empty(len(values), dtype=object)
            stacked[:] = values
            return stacked
        return np.array(values)


_FIELDS = frozenset(Settling.__dataclass_fields__)
