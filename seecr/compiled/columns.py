"""Columns and entries of the compiled tables, and how a descent ends."""

from __future__ import annotations

# Columns of a cable.
N_COLUMNS = 30
(
    EXIT, _, _,  # A in the base frame [m]
    ANCHOR, _, _,  # B in the platform frame [m]
    REST,  # paid-out rest length l0 from A on, wrap included [m]
    GAP,  # geometric length at the commanded pose minus the rest length [m], kept exact
    EA,  # E S [N]
    QUADRATIC, CUBIC,  # T = EA (eps + quadratic eps^2 + cubic eps^3)
    RADIUS,  # of the pulley [m]
    COMPLIANCE,  # of the exit point along the cable [m/N]
    LIFT,  # compliance of the exit point upwards minus that sideways [m/N]
    WINCH_SIDE,  # length of elastic cable behind the exit point [m]
    WEIGHT,  # per metre of cable [N/m]
    CREEP, CREEP_RATE,  # creep strain = creep + creep_rate T
    CREEP_PART, CREEP_TIME,  # part of the elastic strain that creeps, time constant [s]
    HYSTERESIS, HYSTERESIS_STRETCH,  # Dahl: amplitude [N], stretch over which it turns [m]
    STRETCH_BEFORE, HYSTERESIS_BEFORE,  # state the Dahl law starts from [m, N]
    FRICTION,  # exponent of the capstan at the exit point
    STUCK,  # tension behind the exit point while the cable does not slip [N]
    EXTRA, EXTRA_SLOPE,  # a user's law, linearised: T += extra + extra_slope eps [N]
    PUSHES,  # 1 if it is never slack: where it is shorter than its rest length it pushes
    PULL,  # tension without stretch [N]; with EA = 0 and PUSHES = 1 the tension is constant
) = range(N_COLUMNS)  # fmt: skip
# Columns that a walk along a path fills with the history.
OF_THE_PAST = (CREEP, CREEP_RATE, STRETCH_BEFORE, HYSTERESIS_BEFORE, STUCK)

# Entries that a law returns besides force and stiffness (see straight_law).
N_STATE = 6
TENSION, STRAIN, HYSTERESIS_NOW, WINCH_TENSION, ENERGY, SLACK = range(N_STATE)

# Entries of what a cable does at a pose and of how that changes, see rates_of_each_cable: its force
# on the anchor point (3,) [N]; minus the derivative of that by the anchor point (3, 3) [N/m]; the
# derivative of the tension by the anchor point (3,) [N/m]; arm of the anchor point (3,) [m];
# derivatives of force (3,) and tension by the rest length [N/m].
FORCE, STIFFNESS, SLOPE, ARM, BY_REST, TENSION_BY_REST = 0, 3, 12, 15, 18, 21
N_RATES = 22

# Entries of the load of a pose.
FORCE_OF_WEIGHT, CENTRE_OF_MASS, EXTERNAL_FORCE, EXTERNAL_MOMENT, UP = 0, 3, 6, 9, 12
N_LOAD = 15


# How a descent ends, and the limits that decide it.

# seecr/statics/solution.py turns them into sentences.
CONVERGED, UNSTABLE, SINGULAR, STALLED, FALLING, CABLE_LAW, ITERATIONS, SPINNING = range(8)
NO_LENGTH = 8

# A stiffness below this part of the largest diagonal entry counts as zero.
SINGULAR_PART = 1e-11
# A tension below this part of the load is rounding.
IDLE = 1e-11
# Largest residual of an equilibrium, relative to the load.
TOLERANCE = 1e-9
