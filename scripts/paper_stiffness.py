"""What the paper's text says of k_c = E S, and what hangs on the number that it does not give.

The text has the diameters (Vectran 0.7 mm, fishing line 0.4 mm), a ratio of "approximately 10" and
a worst search of 286 iterations that was found.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from paper_search import search

from seecr.pose import rotvec_from_quat
from seecr.statics.solution import Solution

HEAD = (
    "| k_c of Vectran | implied modulus | fishing line, a tenth | parallel at the end: tilt, z | "
    "Cogiro in the middle: z, fishing line lower by | `fsolve`: most evaluations, poses not found |"
)
# From below what a nylon line can have, times ten, to a solid rod of the fibre.
_STIFFNESSES = (1000.0, 2000.0, 3000.0, 4000.0, 10000.0, 25000.0)
_VECTRAN, _FISHING = (0.25 * np.pi * d**2 for d in (0.7e-3, 0.4e-3))
_EVERY = 4

Sweep = Callable[[str, float, float], Solution]


def stiffness_rows(
    sweep: Sweep, stiffnesses: Sequence[float] = _STIFFNESSES
) -> Iterator[tuple[str, ...]]:
    """One row for each k_c: what it means for the materials, the figures and the search.

    Args:
        sweep: the experiment's sweep of a robot at a height z [m] with k_c [N].
        stiffnesses: of Vectran [N].
    """
    for ea in stiffnesses:
        end = sweep("demobot_parallel", 0.1, ea)
        tilt = np.degrees(np.linalg.norm(rotvec_from_quat(end.pose[0, 3:])))
        stiff, soft = (sweep("demobot_cogiro", 0.1, one) for one in (ea, 0.1 * ea))
        middle = len(stiff) // 2
        sunk, lower = (1e3 * one.deviation[middle, 2] for one in (stiff, soft))
        found = [search(one.robot, one.command[::_EVERY], "fsolve")
                 for one in (end, sweep("demobot_parallel", 0.2, ea))]  # fmt: skip
        calls = max(int(one.calls.max()) for one in found)
        lost = sum(int((~one.claims).sum()) for one in found)
        yield (
            f"{ea:.0f} N", f"{1e-9 * ea / _VECTRAN:.1f} GPa",
            f"{0.1 * ea:.0f} N, {0.1e-9 * ea / _FISHING:.1f} GPa",
            f"{tilt:.2f}°, {1e3 * end.deviation[0, 2]:.1f} mm",
            f"{sunk:.2f} mm, {sunk - lower:.1f} mm",
            f"{calls}, {lost} of {sum(len(one.calls) for one in found)}",
        )  # fmt: skip
