"""The descent of :mod:`seecr.compiled.newton`, sixteen poses abreast.

A lane takes the steps of ``solve_one`` one by one, with its trust region and its tests, so that it
arrives where that arrives. What a lane cannot do it leaves to ``solve_one``, which begins again
from the start: cables that are not straight and linear, moments, steps away from saddles, falls,
and whatever does not end in an equilibrium that is certified, or free to move. Along a free
direction rounding decides where a descent ends.

LLVM turns a loop over the lanes into vector instructions if its body has no branches, if the number
of lanes is a constant, and if rows of numbers are seen not to overlap. So the numbers of all lanes
are rows of flat arrays: C with the rows of one cable after the other, P with their tensions, S with
constant places for all else.
"""

from __future__ import annotations

import math

import numpy as np

from seecr.compiled.algebra import norm, rotated_less
from seecr.compiled.columns import (
    ANCHOR,
    CENTRE_OF_MASS,
    COMPLIANCE,
    CONVERGED,
    CREEP,
    CREEP_PART,
    CREEP_RATE,
    CREEP_TIME,
    EA,
    EXIT,
    EXTERNAL_FORCE,
    FORCE_OF_WEIGHT,
    GAP,
    HYSTERESIS_STRETCH,
    IDLE,
    N_COLUMNS,
    REST,
    SINGULAR,
    SINGULAR_PART,
    TOLERANCE,
    WINCH_SIDE,
)
from seecr.compiled.jit import jit, jit_allocating, jit_inner, jit_lanes
from seecr.compiled.newton import FINE, LATE, PATIENCE, SHORT, mirrored_step

N = 16
"""Number of lanes."""

# Rows of a cable: arm of its anchor point, way from its exit point to the anchor point and length
# of that at the commanded pose, stretch there, and stiffness.
_ARM, _WAY, _BEFORE, _STRETCH, _RATE, _CABLE = (N * k for k in (0, 3, 6, 7, 8, 9))
# Rows of a lane: its problem (arm of the centre of mass, weight, external force, load, squared
# reach); the trial state; what is summed at it (gradient, lower triangle of the stiffness, tension
# over length, that times the arms, halves of the force's own stiffness, energy, tension next to
# slackness); the last state accepted with its energy; and what solve_one keeps. END is 0 while a
# descent goes on, 1 when it has converged, and 2 when it is left to solve_one.
(
    _CENTRE, _WEIGHT, _FORCE, _SCALE, _REACH, _PLACE, _TURN, _LESS,
    _GRADIENT, _HESSIAN, _TURNING, _MOMENT, _HALVES, _ENERGY, _LEAST,
    _AT_PLACE, _AT_TURN, _AT_ENERGY,
    _SIZE, _RADIUS, _SHIFT, _COUNT, _IDLES, _LATES, _SHORTS, _STEP, _MOVE, _VALUE, _AT_VALUE,
    _SPAN, _WORK, _TOP, _BACK, _FAILED, _END, _ALL,
) = (N * np.cumsum([
    0, 3, 3, 3, 1, 1, 3, 4, 9,
    6, 21, 1, 3, 3, 1, 1,
    3, 4, 1,
    1, 1, 1, 1, 1, 1, 1, 6, 6, 4, 4,
    1, 1, 1, 1, 1, 1,
])).tolist()  # fmt: skip


@jit_lanes
def _larger(a, b):
    """The built-in asks for nan, which takes a branch."""
    return a if a > b else b


@jit_lanes
def _begin_sums(S):
    """The trial rotation as a matrix less the identity, and the sums with the load alone."""
    for i in range(N):
        w, x, y, z = S[_TURN + i], S[_TURN + N + i], S[_TURN + 2 * N + i], S[_TURN + 3 * N + i]
        w, x2, y2, z2 = 2.0 * w, 2.0 * x, 2.0 * y, 2.0 * z
        xx, xy, xz, yy, yz, zz = x * x2, x * y2, x * z2, y * y2, y * z2, z * z2
        wx, wy, wz = w * x, w * y, w * z
        d = _LESS + i
        S[d], S[d + N], S[d + 2 * N] = -(yy + zz), xy - wz, xz + wy
        S[d + 3 * N], S[d + 4 * N], S[d + 5 * N] = xy + wz, -(xx + zz), yz - wx
        S[d + 6 * N], S[d + 7 * N], S[d + 8 * N] = xz - wy, yz + wx, -(xx + yy)
        a, b, c = S[_CENTRE + i], S[_CENTRE + N + i], S[_CENTRE + 2 * N + i]
        dx = S[d] * a + S[d + N] * b + S[d + 2 * N] * c
        dy = S[d + 3 * N] * a + S[d + 4 * N] * b + S[d + 5 * N] * c
        dz = S[d + 6 * N] * a + S[d + 7 * N] * b + S[d + 8 * N] * c
        a, b, c = a + dx, b + dy, c + dz
        px, py, pz = S[_PLACE + i], S[_PLACE + N + i], S[_PLACE + 2 * N + i]
        fx, fy, fz = S[_WEIGHT + i], S[_WEIGHT + N + i], S[_WEIGHT + 2 * N + i]
        ex, ey, ez = S[_FORCE + i], S[_FORCE + N + i], S[_FORCE + 2 * N + i]
        work = fx * (px + dx) + fy * (py + dy) + fz * (pz + dz)
        S[_ENERGY + i] = -work - (ex * px + ey * py + ez * pz)
        g, h = _GRADIENT + i, _HESSIAN + i
        S[g], S[g + N], S[g + 2 * N] = -fx - ex, -fy - ey, -fz - ez
        S[g + 3 * N], S[g + 4 * N] = c * fy - b * fz, a * fz - c * fx
        S[g + 5 * N] = b * fx - a * fy
        fx, fy, fz = 0.5 * fx, 0.5 * fy, 0.5 * fz
        for k in range(21):
            S[h + k * N] = 0.0
        S[h + 13 * N] = -fx * b - fy * a
        S[h + 18 * N] = -fx * c - fz * a
        S[h + 19 * N] = -fy * c - fz * b
        S[_TURNING + i], S[_LEAST + i] = 0.0, 1e300
        for k in range(3):
            S[_MOMENT + k * N + i] = 0.0
        S[_HALVES + i], S[_HALVES + N + i], S[_HALVES + 2 * N + i] = fx * a, fy * b, fz * c


@jit_lanes
def _add_cable(S, C, P):
    """Add a cable with rows C to the sums, and fill its tensions P, negative where it is slack.

    With u its direction, r its arm and w = (u, r x u), the gradient is T w, and the stiffness
    (k - T/l) w w^T + T/l J^T J - T u . d2r with J = [I, -[r]x], see seecr.compiled.platform.
    """
    for i in range(N):
        d = _LESS + i
        a, b, c = C[_ARM + i], C[_ARM + N + i], C[_ARM + 2 * N + i]
        dx = S[d] * a + S[d + N] * b + S[d + 2 * N] * c
        dy = S[d + 3 * N] * a + S[d + 4 * N] * b + S[d + 5 * N] * c
        dz = S[d + 6 * N] * a + S[d + 7 * N] * b + S[d + 8 * N] * c
        a, b, c = a + dx, b + dy, c + dz
        dx, dy, dz = dx + S[_PLACE + i], dy + S[_PLACE + N + i], dz + S[_PLACE + 2 * N + i]
        sx, sy, sz = C[_WAY + i], C[_WAY + N + i], C[_WAY + 2 * N + i]
        growth = dx * (2.0 * sx + dx) + dy * (2.0 * sy + dy) + dz * (2.0 * sz + dz)
        lx, ly, lz = sx + dx, sy + dy, sz + dz
        now = math.sqrt(lx * lx + ly * ly + lz * lz)
        both = now + C[_BEFORE + i]
        inverse = 1.0 / (now * both)  # one division, which takes longest, for two
        stretch, inverse = growth * (inverse * now) + C[_STRETCH + i], inverse * both
        rate = C[_RATE + i]
        tension = rate * stretch
        P[i] = tension
        least, taut = abs(tension), 1.0 if stretch >= 0.0 else 0.0
        rate, tension = taut * rate, taut * tension
        S[_ENERGY + i] += 0.5 * tension * stretch
        S[_LEAST + i] = least if least < S[_LEAST + i] else S[_LEAST + i]
        turning, ux, uy, uz = tension * inverse, lx * inverse, ly * inverse, lz * inverse
        mx, my, mz = b * uz - c * uy, c * ux - a * uz, a * uy - b * ux
        g, h = _GRADIENT + i, _HESSIAN + i
        S[g] += tension * ux
        S[g + N] += tension * uy
        S[g + 2 * N] += tension * uz
        S[g + 3 * N] += tension * mx
        S[g + 4 * N] += tension * my
        S[g + 5 * N] += tension * mz
        along = rate - turning
        ex, ey, ez = along * ux, along * uy, along * uz
        S[h] += ex * ux
        S[h + N] += ey * ux
        S[h + 2 * N] += ey * uy
        S[h + 3 * N] += ez * ux
        S[h + 4 * N] += ez * uy
        S[h + 5 * N] += ez * uz
        S[h + 6 * N] += ex * mx
        S[h + 7 * N] += ey * mx
        S[h + 8 * N] += ez * mx
        S[h + 10 * N] += ex * my
        S[h + 11 * N] += ey * my
        S[h + 12 * N] += ez * my
        S[h + 15 * N] += ex * mz
        S[h + 16 * N] += ey * mz
        S[h + 17 * N] += ez * mz
        S[_TURNING + i] += turning
        S[_MOMENT + i] += turning * a
        S[_MOMENT + N + i] += turning * b
        S[_MOMENT + 2 * N + i] += turning * c
        turning *= 0.5
        fx, fy, fz = turning * (a - lx), turning * (b - ly), turning * (c - lz)
        S[_HALVES + i] += fx * a
        S[_HALVES + N + i] += fy * b
        S[_HALVES + 2 * N + i] += fz * c
        ex, ey, ez = along * mx, along * my, along * mz
        S[h + 9 * N] += ex * mx
        S[h + 13 * N] += ex * my - fx * b - fy * a
        S[h + 14 * N] += ey * my
        S[h + 18 * N] += ex * mz - fx * c - fz * a
        S[h + 19 * N] += ey * mz - fy * c - fz * b
        S[h + 20 * N] += ez * mz


@jit_lanes
def _end_sums(S, per):
    """Gradient and stiffness complete, and by rotations times the robot's length 1/per."""
    for i in range(N):
        g, h, square = _GRADIENT + i, _HESSIAN + i, per * per
        S[g + 3 * N], S[g + 4 * N] = per * S[g + 3 * N], per * S[g + 4 * N]
        S[g + 5 * N] = per * S[g + 5 * N]
        turning = S[_TURNING + i]
        S[h], S[h + 2 * N] = S[h] + turning, S[h + 2 * N] + turning
        S[h + 5 * N] = S[h + 5 * N] + turning
        a, b, c = S[_MOMENT + i], S[_MOMENT + N + i], S[_MOMENT + 2 * N + i]
        S[h + 6 * N], S[h + 7 * N] = per * S[h + 6 * N], per * (S[h + 7 * N] - c)
        S[h + 8 * N], S[h + 10 * N] = per * (S[h + 8 * N] + b), per * (S[h + 10 * N] + c)
        S[h + 11 * N], S[h + 12 * N] = per * S[h + 11 * N], per * (S[h + 12 * N] - a)
        S[h + 15 * N], S[h + 16 * N] = per * (S[h + 15 * N] - b), per * (S[h + 16 * N] + a)
        S[h + 17 * N] = per * S[h + 17 * N]
        a, b, c = 2.0 * S[_HALVES + i], 2.0 * S[_HALVES + N + i], 2.0 * S[_HALVES + 2 * N + i]
        S[h + 9 * N], S[h + 14 * N] = (
            square * (S[h + 9 * N] + b + c),
            square * (S[h + 14 * N] + a + c),
        )
        S[h + 20 * N], S[h + 13 * N] = square * (S[h + 20 * N] + a + b), square * S[h + 13 * N]
        S[h + 18 * N], S[h + 19 * N] = square * S[h + 18 * N], square * S[h + 19 * N]


@jit_lanes
def _accept(S, per, largest, limit, free):
    """Accept the trial states that solve_one would accept, and see which descents end.

    From a state that is not accepted a lane goes BACK by a step of no length, and evaluates the
    last one that was accepted once more.
    """
    for i in range(N):
        g, s, h = _GRADIENT + i, _STEP + i, _HESSIAN + i
        g0, g1, g2, g3 = S[g], S[g + N], S[g + 2 * N], S[g + 3 * N]
        g4, g5 = S[g + 4 * N], S[g + 5 * N]
        force, torque = g0 * g0 + g1 * g1 + g2 * g2, g3 * g3 + g4 * g4 + g5 * g5
        trial = math.sqrt(_larger(force, torque) if free else force + torque)
        there = g0 * S[s] + g1 * S[s + N] + g2 * S[s + 2 * N]
        there += g3 * S[s + 3 * N] + g4 * S[s + 4 * N] + g5 * S[s + 5 * N]
        top = _larger(_larger(abs(S[h]), abs(S[h + 2 * N])), abs(S[h + 5 * N]))
        top = _larger(_larger(top, abs(S[h + 9 * N])), abs(S[h + 14 * N]))
        top = _larger(top, abs(S[h + 20 * N]))
        scale, size, span, radius = S[_SCALE + i], S[_SIZE + i], S[_SPAN + i], S[_RADIUS + i]
        energy, shift, again = S[_AT_ENERGY + i], S[_SHIFT + i], S[_BACK + i] > 0.0
        count = S[_COUNT + i] + (0.0 if again else 1.0)
        fell, expected = -0.5 * (S[_WORK + i] + there), -0.5 * S[_WORK + i]
        rounding = 1e-14 * (abs(energy) + scale * span)
        fell = energy - S[_ENERGY + i] if abs(fell) > rounding else fell
        level, near = TOLERANCE * scale, size < 1e-3 * scale
        falls = (fell > 1e-3 * expected) | (near & (trial < 0.9 * size)) | (span == 0.0)
        slow = (size <= level) & ((trial > 0.5 * size) | ~falls)
        wide = falls & (span > 0.8 * radius) & (fell > 0.7 * expected)
        wider = 2.5 * radius if 2.5 * radius < largest else largest
        narrow = 0.3 * (span if span < radius else radius)
        radius = (wider if wide else radius) if falls else narrow
        idles = S[_IDLES + i]
        idles = idles if again else (idles + 1.0 if slow else (0.0 if falls else idles))
        size = trial if falls else size
        shift = 0.1 * shift if falls & ~again else shift
        shift = 0.0 if falls & ~again & (shift < 1e-9 * top) else shift
        balanced, lates = size <= level, S[_LATES + i]
        lates = lates if again else (lates + 1.0 if balanced else 0.0)
        done = (size <= FINE * scale) | (balanced & ((idles >= 2.0) | (lates >= LATE)))
        x, y, z = S[_PLACE + i], S[_PLACE + N + i], S[_PLACE + 2 * N + i]
        lost = falls & (x * x + y * y + z * z > S[_REACH + i])
        lost |= (count >= limit) & ~done
        # no cable may be within rounding of its rest length, where it has stiffness on one side
        # only: solve_one looks closer. A load stiffens its platform by about itself over the
        # length, so that what is left of the residual may move that by its part of the length.
        idle = IDLE * scale + 10.0 * size / scale * top / per
        lost |= done & falls & (S[_LEAST + i] < idle)
        S[_SIZE + i], S[_RADIUS + i], S[_TOP + i] = size, radius, top
        S[_COUNT + i], S[_IDLES + i], S[_LATES + i] = count, idles, lates
        S[_END + i] = 2.0 if lost else (1.0 if done & falls else 0.0)
        S[_BACK + i] = 0.0 if falls else 1.0
        S[_SHIFT + i] = -SINGULAR_PART * top if done & falls else shift
        S[_AT_ENERGY + i] = S[_ENERGY + i] if falls else energy
        for k in range(7):
            old = S[_AT_PLACE + k * N + i]
            S[_AT_PLACE + k * N + i] = S[_PLACE + k * N + i] if falls else old


@jit_lanes
def _pivot(square, low):
    """One over the root of a pivot, of 1 if that is not positive; and the lowest pivot so far.

    It needs no bound of rounding, as ``cholesky`` has: rests are certified with the stiffness less
    SINGULAR_PART, a thousand times that bound; and a step uphill is not accepted, so that the
    descent is left to solve_one. With the bound, 3e5 rows ended the same.
    """
    low = square if square < low else low
    return 1.0 / math.sqrt(square if square > 0.0 else 1.0), low


@jit_lanes
def _step(S):
    """Newton's steps where the shifted stiffness is positive definite; FAILED where it is not."""
    for i in range(N):
        h, shift = _HESSIAN + i, S[_SHIFT + i]
        d0, low = _pivot(S[h] + shift, 1e300)
        l10, l20, l30 = S[h + N] * d0, S[h + 3 * N] * d0, S[h + 6 * N] * d0
        l40, l50 = S[h + 10 * N] * d0, S[h + 15 * N] * d0
        t = S[h + 2 * N] + shift - l10 * l10
        d1, low = _pivot(t, low)
        l21, l31 = (S[h + 4 * N] - l20 * l10) * d1, (S[h + 7 * N] - l30 * l10) * d1
        l41, l51 = (S[h + 11 * N] - l40 * l10) * d1, (S[h + 16 * N] - l50 * l10) * d1
        t = S[h + 5 * N] + shift - l20 * l20 - l21 * l21
        d2, low = _pivot(t, low)
        l32 = (S[h + 8 * N] - l30 * l20 - l31 * l21) * d2
        l42 = (S[h + 12 * N] - l40 * l20 - l41 * l21) * d2
        l52 = (S[h + 17 * N] - l50 * l20 - l51 * l21) * d2
        t = S[h + 9 * N] + shift - l30 * l30 - l31 * l31 - l32 * l32
        d3, low = _pivot(t, low)
        l43 = (S[h + 13 * N] - l40 * l30 - l41 * l31 - l42 * l32) * d3
        l53 = (S[h + 18 * N] - l50 * l30 - l51 * l31 - l52 * l32) * d3
        t = S[h + 14 * N] + shift - l40 * l40 - l41 * l41 - l42 * l42 - l43 * l43
        d4, low = _pivot(t, low)
        l54 = (S[h + 19 * N] - l50 * l40 - l51 * l41 - l52 * l42 - l53 * l43) * d4
        t = S[h + 20 * N] + shift - l50 * l50 - l51 * l51 - l52 * l52 - l53 * l53 - l54 * l54
        d5, low = _pivot(t, low)
        g = _GRADIENT + i
        g0, g1, g2, g3 = S[g], S[g + N], S[g + 2 * N], S[g + 3 * N]
        g4, g5 = S[g + 4 * N], S[g + 5 * N]
        x0 = g0 * d0
        x1 = (g1 - l10 * x0) * d1
        x2 = (g2 - l20 * x0 - l21 * x1) * d2
        x3 = (g3 - l30 * x0 - l31 * x1 - l32 * x2) * d3
        x4 = (g4 - l40 * x0 - l41 * x1 - l42 * x2 - l43 * x3) * d4
        x5 = (g5 - l50 * x0 - l51 * x1 - l52 * x2 - l53 * x3 - l54 * x4) * d5 * d5
        x4 = (x4 - l54 * x5) * d4
        x3 = (x3 - l43 * x4 - l53 * x5) * d3
        x2 = (x2 - l32 * x3 - l42 * x4 - l52 * x5) * d2
        x1 = (x1 - l21 * x2 - l31 * x3 - l41 * x4 - l51 * x5) * d1
        x0 = (x0 - l10 * x1 - l20 * x2 - l30 * x3 - l40 * x4 - l50 * x5) * d0
        span = math.sqrt(x0 * x0 + x1 * x1 + x2 * x2 + x3 * x3 + x4 * x4 + x5 * x5)
        radius = S[_RADIUS + i]
        part = -1.0 if span <= radius else -radius / (span if span > radius else 1.0)
        back = S[_BACK + i] > 0.0
        part = 0.0 if back else part
        x0, x1, x2, x3, x4, x5 = part * x0, part * x1, part * x2, part * x3, part * x4, part * x5
        s = _STEP + i
        S[s], S[s + N], S[s + 2 * N], S[s + 3 * N], S[s + 4 * N] = x0, x1, x2, x3, x4
        S[s + 5 * N] = x5
        s = _MOVE + i
        S[s], S[s + N], S[s + 2 * N], S[s + 3 * N], S[s + 4 * N] = x0, x1, x2, x3, x4
        S[s + 5 * N] = x5
        span = span if span <= radius else radius
        S[_SPAN + i] = 0.0 if back else span
        S[_WORK + i] = g0 * x0 + g1 * x1 + g2 * x2 + g3 * x3 + g4 * x4 + g5 * x5
        # where all cables are slack there is no stiffness to compare with
        loose = math.sqrt(g0 * g0 + g1 * g1 + g2 * g2 + g3 * g3 + g4 * g4 + g5 * g5) / radius
        least = 1e-6 * (S[_TOP + i] if S[_TOP + i] > 0.0 else loose) + 1e-300
        raised = 4.0 * shift if 4.0 * shift > least else least
        fails = ~(low > 0.0) & ~back
        going, rests = S[_END + i] == 0.0, S[_END + i] == 1.0
        # a rest that is not stable is free to move, unless it is a saddle: see escape
        firm = rests & (shift < 0.0)
        S[_FAILED + i] = 1.0 if (going | firm) & fails else 0.0
        shift = raised if going & fails else shift
        S[_SHIFT + i] = -shift if firm & fails else shift
        S[_END + i] = 2.0 if rests & ~firm & fails else S[_END + i]


@jit_inner
def _take_hessian(S, i, hessian):
    """Fill the stiffness (6, 6) of lane i."""
    k = _HESSIAN + i
    for r in range(6):
        for c in range(r + 1):
            hessian[r, c] = hessian[c, r] = S[k]
            k += N


@jit_allocating
def _mirror(S, i, space):
    """The other step of solve_one for lane i, where a shift has shortened several in turn."""
    gradient, hessian, step = space
    _take_hessian(S, i, hessian)
    for r in range(6):
        gradient[r] = S[_GRADIENT + r * N + i]
    mirrored_step(gradient, hessian, S[_RADIUS + i], step)
    work = 0.0
    for r in range(6):
        S[_STEP + r * N + i] = S[_MOVE + r * N + i] = step[r]
        work += gradient[r] * step[r]
    S[_SPAN + i], S[_WORK + i] = norm(step), work


# Platforms on up to three slides and then a hinge through their origin: planar robots, and those
# that only translate. None of their axes turns as they move.


@jit_lanes
def _onto_joints(S, axes):
    """From the platform's own gradient and stiffness to those along slides and about the hinge.

    They take the first four places. Axes that are missing are zero; there, and in the last two
    places, the stiffness is the largest there is, which decides nothing.
    """
    a, b, c = axes[0, 0], axes[0, 1], axes[0, 2]
    d, e, f = axes[1, 0], axes[1, 1], axes[1, 2]
    u, v, w = axes[2, 0], axes[2, 1], axes[2, 2]
    x, y, z = axes[3, 0], axes[3, 1], axes[3, 2]
    no0, no1 = 1.0 - (a * a + b * b + c * c), 1.0 - (d * d + e * e + f * f)
    no2, no3 = 1.0 - (u * u + v * v + w * w), 1.0 - (x * x + y * y + z * z)
    for i in range(N):
        g, h = _GRADIENT + i, _HESSIAN + i
        g0, g1, g2 = S[g], S[g + N], S[g + 2 * N]
        S[g], S[g + N] = a * g0 + b * g1 + c * g2, d * g0 + e * g1 + f * g2
        S[g + 2 * N] = u * g0 + v * g1 + w * g2
        S[g + 3 * N] = x * S[g + 3 * N] + y * S[g + 4 * N] + z * S[g + 5 * N]
        S[g + 4 * N], S[g + 5 * N] = 0.0, 0.0
        xx, xy, yy = S[h], S[h + N], S[h + 2 * N]
        xz, yz, zz = S[h + 3 * N], S[h + 4 * N], S[h + 5 * N]
        p, q, r = xx * a + xy * b + xz * c, xy * a + yy * b + yz * c, xz * a + yz * b + zz * c
        h0, h1, h3 = a * p + b * q + c * r, d * p + e * q + f * r, u * p + v * q + w * r
        p, q, r = xx * d + xy * e + xz * f, xy * d + yy * e + yz * f, xz * d + yz * e + zz * f
        h2, h4 = d * p + e * q + f * r, u * p + v * q + w * r
        p, q, r = xx * u + xy * v + xz * w, xy * u + yy * v + yz * w, xz * u + yz * v + zz * w
        h5 = u * p + v * q + w * r
        p = x * S[h + 6 * N] + y * S[h + 10 * N] + z * S[h + 15 * N]
        q = x * S[h + 7 * N] + y * S[h + 11 * N] + z * S[h + 16 * N]
        r = x * S[h + 8 * N] + y * S[h + 12 * N] + z * S[h + 17 * N]
        h6, h7, h8 = a * p + b * q + c * r, d * p + e * q + f * r, u * p + v * q + w * r
        p = S[h + 9 * N] * x + S[h + 13 * N] * y + S[h + 18 * N] * z
        q = S[h + 13 * N] * x + S[h + 14 * N] * y + S[h + 19 * N] * z
        r = S[h + 18 * N] * x + S[h + 19 * N] * y + S[h + 20 * N] * z
        h9 = x * p + y * q + z * r
        top = _larger(_larger(abs(h0), abs(h2)), _larger(abs(h5), abs(h9)))
        S[h], S[h + N], S[h + 2 * N], S[h + 3 * N] = h0 + no0 * top, h1, h2 + no1 * top, h3
        S[h + 4 * N], S[h + 5 * N], S[h + 6 * N], S[h + 7 * N] = h4, h5 + no2 * top, h6, h7
        S[h + 8 * N], S[h + 9 * N] = h8, h9 + no3 * top
        for k in range(10, 21):
            S[h + k * N] = 0.0
        S[h + 14 * N], S[h + 20 * N] = top, top


@jit_inner
def _start_joints(S, i, axes, values, per):
    """The state of lane i at values (4,) of its joints."""
    half = 0.5 * per * values[3]
    S[_TURN + i] = math.cos(half)
    for k in range(3):
        S[_PLACE + k * N + i] = 0.0
        for j in range(3):
            S[_PLACE + k * N + i] += axes[j, k] * values[j]
        S[_TURN + (1 + k) * N + i] = math.sin(half) * axes[3, k]
    for k in range(4):
        S[_VALUE + k * N + i] = values[k]


@jit_lanes
def _move_joints(S, axes):
    """The joints' values where trial states are accepted, and the motions of the steps."""
    for k in range(4):
        for i in range(N):
            value, step = S[_VALUE + k * N + i], S[_STEP + k * N + i]
            value = S[_AT_VALUE + k * N + i] if S[_BACK + i] > 0.0 else value
            S[_AT_VALUE + k * N + i], S[_VALUE + k * N + i] = value, value + step
    for k in range(3):
        a, b, c, x = axes[0, k], axes[1, k], axes[2, k], axes[3, k]
        for i in range(N):
            slides = a * S[_STEP + i] + b * S[_STEP + N + i] + c * S[_STEP + 2 * N + i]
            S[_MOVE + k * N + i] = slides
            S[_MOVE + (3 + k) * N + i] = x * S[_STEP + 3 * N + i]


@jit_lanes
def _advance(S, per):
    """The trial states after the steps."""
    for i in range(N):
        S[_PLACE + i] = S[_AT_PLACE + i] + S[_MOVE + i]
        S[_PLACE + N + i] = S[_AT_PLACE + N + i] + S[_MOVE + N + i]
        S[_PLACE + 2 * N + i] = S[_AT_PLACE + 2 * N + i] + S[_MOVE + 2 * N + i]
        a = 0.5 * per * S[_MOVE + 3 * N + i]
        b = 0.5 * per * S[_MOVE + 4 * N + i]
        c = 0.5 * per * S[_MOVE + 5 * N + i]
        # cosine and sin(h)/h of half the angle, at most 5, from their series for its quarter, which
        # are exact to double precision there, by doubling twice
        t = (a * a + b * b + c * c) * 0.0625
        cosine, sine = 1.0, 1.0
        for k in range(10, 0, -1):
            cosine = 1.0 - cosine * t * (1.0 / (2 * k * (2 * k - 1)))
            sine = 1.0 - sine * t * (1.0 / (2 * k * (2 * k + 1)))
        cosine, sine = 1.0 - 2.0 * t * sine * sine, sine * cosine
        cosine, sine = 1.0 - 8.0 * t * sine * sine, sine * cosine
        a, b, c = sine * a, sine * b, sine * c
        w, x, y, z = (
            S[_AT_TURN + i], S[_AT_TURN + N + i], S[_AT_TURN + 2 * N + i],
            S[_AT_TURN + 3 * N + i],
        )  # fmt: skip
        p = cosine * w - (a * x + b * y + c * z)
        q = cosine * x + w * a + (b * z - c * y)
        r = cosine * y + w * b + (c * x - a * z)
        s = cosine * z + w * c + (a * y - b * x)
        inverse = 1.0 / math.sqrt(p * p + q * q + r * r + s * s)
        S[_TURN + i], S[_TURN + N + i] = p * inverse, q * inverse
        S[_TURN + 2 * N + i], S[_TURN + 3 * N + i] = r * inverse, s * inverse
        lost = (S[_END + i] == 0.0) & (S[_FAILED + i] > 0.0)
        S[_END + i] = 2.0 if lost else S[_END + i]


@jit_inner
def _stage(S, C, cables, paid, load, poses, starts, scale, reach, first):
    """Fill the problems of S and C with those of the poses from ``first`` on, and their starts."""
    last, m = poses.shape[0] - 1, paid.shape[1]
    own_cables, own_load = cables.shape[0] > 1, load.shape[0] > 1
    own_scale, own_start = scale.shape[0] > 1, starts.shape[0] > 0
    for i in range(N):
        row = min(first + i, last)
        at = row if own_load else 0
        for k in range(3):
            S[_CENTRE + k * N + i] = load[at, CENTRE_OF_MASS + k]
            S[_WEIGHT + k * N + i] = load[at, FORCE_OF_WEIGHT + k]
            S[_FORCE + k * N + i] = load[at, EXTERNAL_FORCE + k]
            S[_PLACE + k * N + i] = poses[row, k]
        for k in range(4):
            S[_TURN + k * N + i] = poses[row, 3 + k]
        S[_SCALE + i] = scale[row if own_scale else 0]
        S[_REACH + i] = reach[row] ** 2
    for c in range(m):
        for i in range(N):
            row = min(first + i, last)
            at = row if own_cables else 0
            for j in range(3):
                C[c, _ARM + j * N + i] = cables[at, c, ANCHOR + j]
                C[c, _WAY + j * N + i] = -cables[at, c, EXIT + j]
            rest, ea = paid[row, c, 0], cables[at, c, EA]
            yields = rest * cables[at, c, CREEP_RATE] + cables[at, c, COMPLIANCE]
            C[c, _STRETCH + i] = paid[row, c, 1] - rest * cables[at, c, CREEP]
            C[c, _BEFORE + i] = rest + ea * yields + cables[at, c, WINCH_SIDE]
            C[c, _RATE + i] = ea
        _turn_cable(S, C[c])
    _turn_centre(S)
    for i in range(N):
        row = min(first + i, last)
        for k in range(7):
            S[_PLACE + k * N + i] = 1.0 if k == 3 else 0.0
            if own_start:
                S[_PLACE + k * N + i] = starts[row, k]


@jit_lanes
def _turn_cable(S, C):
    """From points of a cable to its arm and way at the commanded pose, and its stiffness."""
    for i in range(N):
        w, x, y, z = S[_TURN + i], S[_TURN + N + i], S[_TURN + 2 * N + i], S[_TURN + 3 * N + i]
        a, b, c = C[_ARM + i], C[_ARM + N + i], C[_ARM + 2 * N + i]
        dx, dy, dz = rotated_less(w, x, y, z, a, b, c)
        a, b, c = a + dx, b + dy, c + dz
        C[_ARM + i], C[_ARM + N + i], C[_ARM + 2 * N + i] = a, b, c
        a = S[_PLACE + i] + a + C[_WAY + i]
        b = S[_PLACE + N + i] + b + C[_WAY + N + i]
        c = S[_PLACE + 2 * N + i] + c + C[_WAY + 2 * N + i]
        C[_WAY + i], C[_WAY + N + i], C[_WAY + 2 * N + i] = a, b, c
        C[_RATE + i] = C[_RATE + i] / C[_BEFORE + i]
        C[_BEFORE + i] = math.sqrt(a * a + b * b + c * c)


@jit_lanes
def _turn_centre(S):
    """From the centre of mass in the platform frame to its arm at the commanded pose."""
    for i in range(N):
        w, x, y, z = S[_TURN + i], S[_TURN + N + i], S[_TURN + 2 * N + i], S[_TURN + 3 * N + i]
        a, b, c = S[_CENTRE + i], S[_CENTRE + N + i], S[_CENTRE + 2 * N + i]
        dx, dy, dz = rotated_less(w, x, y, z, a, b, c)
        S[_CENTRE + i], S[_CENTRE + N + i], S[_CENTRE + 2 * N + i] = a + dx, b + dy, c + dz


# Most raises of a shift in one step, before a lane is left to solve_one.
_RAISES = 60


@jit_allocating
def descend_abreast(
    cables, paid, load, poses, starts, axes, start_values, length, scale, radius, reach, limit,
    outcome, count, residual, energy, deviation, values, pull,
):  # fmt: skip
    """Descend from ``starts`` (n, 7), or from the commanded poses if that is (0, 7).

    ``axes`` (4, 3) are those of three slides and a hinge, zero where there is none, and
    ``start_values`` (n, 4) and ``values`` (n, 4) their values [m]; a free platform has (n, 0).
    ``cables`` is (n, m, N_COLUMNS), or (1, m, N_COLUMNS) where all poses have the same; ``load``
    and ``scale`` likewise. ``paid`` (n, m, 2) are rest lengths and gaps. All outputs are filled
    where a descent converges, ``pull`` (n, m) with tensions [N] that are negative where a cable
    is slack; elsewhere the outcome is -1.
    """
    n, m, per = poses.shape[0], paid.shape[1], 1.0 / length
    S, C, P = np.zeros(_ALL), np.zeros((m, _CABLE)), np.zeros((m, N))
    T, D = np.zeros(_ALL), np.zeros((m, _CABLE))
    rows, staged, following, going = np.full(N, -1), N, 0, 0
    # rounding grows along narrow valleys: a descent so long may end on either side of the limit
    most = limit // 2
    space, free = (np.zeros(6), np.zeros((6, 6)), np.zeros(6)), values.shape[1] == 0
    while True:
        for i in range(N if following < n else 0):
            if rows[i] >= 0 or following == n:
                continue
            if staged == N:
                _stage(T, D, cables, paid, load, poses, starts, scale, reach, following)
                staged = 0
            for k in range(0, _LESS, N):
                S[k + i] = T[k + staged]
            for k in range(_SIZE, _ALL, N):
                S[k + i] = 0.0
            S[_AT_ENERGY + i], S[_SIZE + i], S[_RADIUS + i] = 0.0, np.inf, radius
            if not free:
                _start_joints(S, i, axes, start_values[following], per)
            for c in range(m):
                for k in range(0, _CABLE, N):
                    C[c, k + i] = D[c, k + staged]
            rows[i] = following
            staged, following, going = staged + 1, following + 1, going + 1
        if going == 0:
            break
        _begin_sums(S)
        for c in range(m):
            _add_cable(S, C[c], P[c])
        _end_sums(S, per)
        if not free:
            _onto_joints(S, axes)
        _accept(S, per, 20.0 * radius, most, free)
        for _ in range(_RAISES):
            _step(S)
            failed = 0.0
            for i in range(N):
                failed += S[_FAILED + i]
            if failed == 0.0:
                break
        for i in range(N):
            # only once the shift is found: shorts are counted by steps
            if rows[i] >= 0 and S[_END + i] + S[_BACK + i] + S[_FAILED + i] == 0.0:
                short = S[_SHIFT + i] > 0.0 and S[_SPAN + i] < SHORT * S[_RADIUS + i]
                S[_SHORTS + i] = S[_SHORTS + i] + 1.0 if short else 0.0
                if S[_SHORTS + i] >= PATIENCE:
                    _mirror(S, i, space)
        if not free:
            _move_joints(S, axes)
        _advance(S, per)
        for i in range(N):
            row = rows[i]
            if row < 0 or S[_END + i] == 0.0:
                continue
            rows[i], going = -1, going - 1
            count[row] = int(S[_COUNT + i])
            outcome[row] = -1
            if S[_END + i] == 1.0:
                outcome[row] = CONVERGED if S[_SHIFT + i] < 0.0 else SINGULAR
                residual[row] = S[_SIZE + i] / S[_SCALE + i]
                energy[row] = S[_AT_ENERGY + i]
                for k in range(7):
                    deviation[row, k] = S[_AT_PLACE + k * N + i]
                for k in range(values.shape[1]):
                    values[row, k] = S[_AT_VALUE + k * N + i]
                for c in range(m):
                    pull[row, c] = P[c, i]


@jit_allocating
def stiffness_abreast(cables, paid, load, poses, deviation, length, scale, hessian):
    """Stiffness (n, 6, 6) [N/m] at deviations (n, 7), from what descend_abreast takes."""
    n, m, per = poses.shape[0], paid.shape[1], 1.0 / length
    S, C, P = np.zeros(_ALL), np.zeros((m, _CABLE)), np.zeros((m, N))
    for first in range(0, n, N):
        _stage(S, C, cables, paid, load, poses, deviation, scale, scale, first)
        _begin_sums(S)
        for c in range(m):
            _add_cable(S, C[c], P[c])
        _end_sums(S, per)
        for i in range(min(N, n - first)):
            _take_hessian(S, i, hessian[first + i])


@jit
def pair_lengths(rest, spans, paid, reach):
    """Rest lengths and gaps (n, m, 2) [m], and the deviation (n,) [m] that counts as a fall."""
    for row in range(rest.shape[0]):
        longest, widest = -np.inf, 0.0
        for c in range(rest.shape[1]):
            gap = spans[row, c] - rest[row, c]
            paid[row, c, 0], paid[row, c, 1] = rest[row, c], gap
            longest, widest = max(longest, rest[row, c]), max(widest, abs(gap))
        reach[row] = 3.0 * (longest + widest)


IN_SCOPE = (
    *range(EXIT, EXIT + 3), *range(ANCHOR, ANCHOR + 3), REST, GAP, EA, COMPLIANCE, WINCH_SIDE,
    CREEP, CREEP_RATE, CREEP_PART, CREEP_TIME, HYSTERESIS_STRETCH,
)  # fmt: skip
"""Columns of a cable that lanes know, or that mean nothing where the others are zero."""
OUT_OF_SCOPE = tuple(k for k in range(N_COLUMNS) if k not in IN_SCOPE)
"""Columns that have to be zero: all others, also those that are added one day."""
