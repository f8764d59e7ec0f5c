"""How MuJoCo moves the bodies of cables: a time step that is stable, and drag that ends swinging.

Neither shifts an equilibrium. MuJoCo's ``discrete`` integrator is implicit in springs, but in their
stiffness at the beginning of a step only: as cables turn, long steps add energy.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np

# Largest angle by which the fastest motion of a cable advances in a step [rad]. Pushed platforms on
# hanging cables stayed at rest up to 117 and ran away from 148.
_PER_STEP = 30.0
# MuJoCo's own step [s], where cables allow it.
_LONGEST = 0.002


def fastest(stiffness: float, mass: float) -> float:
    """Bound of the angular frequencies [1/s] of masses [kg] between springs [N/m] on either side.

    It is that of neighbours that move against each other.
    """
    return float(2.0 * np.sqrt(stiffness / mass))


def drag(tension: float, length: float, mass: float, part: float) -> float:
    """Drag coefficient [N s/m] of a part of a cable that damps its first mode critically.

    Args:
        tension: mean over the cable [N].
        length: [m] of the cable.
        mass: [kg] of the cable.
        part: [kg], mass that the drag acts on.
    """
    first = np.pi * np.sqrt(tension / (mass * length))
    return float(2.0 * first * part)


def take_steps(root: ET.Element, rate: float, damped: bool) -> None:
    """Write the time step of a file whose cables have bodies of their own, and say why.

    Args:
        root: with all its joints.
        rate: angular frequency of the fastest motion of cables [1/s]; 0 if they have no bodies.
        damped: whether they have masses, with drag.
    """
    if rate == 0.0:
        return
    step = min(_LONGEST, _PER_STEP / rate)
    option = next(root.iter("option"))
    option.set("timestep", f"{step:.2g}")
    if not damped:
        return
    # conjugate gradients end after as many steps as there are unknowns; MuJoCo stops at 100
    option.set("iterations", str(6 + sum(1 for _ in root.iter("joint"))))
    root.insert(
        list(root).index(option),
        ET.Comment(
            f" parts of cables swing at up to {rate:.2g} rad/s: longer steps than {step:.2g} s may "
            "be unstable. Their drag only ends their swinging; where they rest it is zero "
        ),
    )
