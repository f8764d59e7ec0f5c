"""An exit point whose compliance upwards differs from that sideways, compiled.

A frame moves its exit points by C p under the pull p = -force of a cable on its anchor point,
C = c (I - z z^T) + c_up z z^T with the vertical z. The isotropic part, c p, is along the cable and
lengthens it by c T (column COMPLIANCE, in series with all else). The remainder lifts the exit point
by s = (c_up - c) z.p, one unknown per cable:

    s - (c_up - c) z . p(move - s z) = 0,

where p(move) is the pull of the cable from an exit point that is not lifted. The slope
1 + (c_up - c) z.K z is positive, since K, with c in series, is no stiffer than 1/c.
"""

from __future__ import annotations

from seecr.compiled.jit import jit_inner


@jit_inner
def along(up, vector):
    """Component of a vector (3,) along the vertical."""
    return up[0] * vector[0] + up[1] * vector[1] + up[2] * vector[2]


@jit_inner
def lowered(move, lift, up, out):
    """``out`` = displacement of the anchor point as seen from the lifted exit point."""
    for k in range(3):
        out[k] = move[k] - lift * up[k]


@jit_inner
def lift_slope(more, up, stiffness):
    """Slope of the equation for the lift."""
    total = 0.0
    for i in range(3):
        total += up[i] * along(up, stiffness[i])
    return 1.0 + more * total


@jit_inner
def soften(more, up, stiffness, gradient, column):
    """Stiffness (3, 3) and gradient (3,) of a cable with its yielding exit point, in place.

    By Sherman and Morrison: K (I + e z z^T K)^-1 = K - e/(1 + e z.K z) (K z)(K z)^T.
    """
    share = more / lift_slope(more, up, stiffness)
    for i in range(3):
        column[i] = along(up, stiffness[i])
    slope = along(up, gradient)
    for i in range(3):
        gradient[i] -= share * slope * column[i]
        for j in range(3):
            stiffness[i, j] -= share * column[i] * column[j]
