"""How a descent ends, and the limits that decide it."""

from __future__ import annotations

# seecr/statics/solution.py turns them into sentences.
CONVERGED, UNSTABLE, SINGULAR, STALLED, FALLING, CABLE_LAW, ITERATIONS, SPINNING = range(8)
NO_LENGTH = 8

# A stiffness below this part of the largest diagonal entry counts as zero.
SINGULAR_PART = 1e-11
# A tension below this part of the load is rounding.
IDLE = 1e-11
# Largest residual of an equilibrium, relative to the load.
TOLERANCE = 1e-9
