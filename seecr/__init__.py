"""Static equilibrium of cable-driven parallel robots with elastic cables (SEECR).

import seecr
robot = seecr.load_robot("models/demobot_cogiro/demobot_cogiro.xml")
solution = seecr.solve(robot, [[0.4, 0.25, 0.1, 1, 0, 0, 0]])
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from seecr.equilibrium import Solution, Status, solve
    from seecr.errors import InputError, RobotError, SeecrError
    from seecr.mjcf import load_robot
    from seecr.robot import Joint, Robot

__version__ = "0.1.0"

# Imported when first used: the compiled loop and MuJoCo take a while to load.
_WHERE = {
    "InputError": "errors",
    "Joint": "robot",
    "Robot": "robot",
    "RobotError": "errors",
    "SeecrError": "errors",
    "Solution": "equilibrium",
    "Status": "equilibrium",
    "load_robot": "mjcf",
    "solve": "equilibrium",
}

__all__ = [
    "InputError",
    "Joint",
    "Robot",
    "RobotError",
    "SeecrError",
    "Solution",
    "Status",
    "load_robot",
    "solve",
]


def __getattr__(name: str) -> Any:
    if name not in _WHERE:
        raise AttributeError(f"module 'seecr' has no attribute {name!r}")
    return getattr(import_module(f"seecr.{_WHERE[name]}"), name)
