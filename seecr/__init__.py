"""Static equilibrium of cable-driven parallel robots with elastic cables (SEECR).

    import seecr

    robot = seecr.load_robot(seecr.model_path("demobot_cogiro"))
    solution = seecr.solve(robot, [[0.4, 0.25, 0.1, 1, 0, 0, 0]])
    print(solution)

``seecr.predict`` adds what a real robot has beyond that: effects, such as pulleys with a radius,
and what sensors would report. ``seecr.catalogue()`` lists them; docs/effects.md says how to write
one of your own.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from seecr.lazy import lazily

if TYPE_CHECKING:
    from seecr.chances import held_chance, kept_chance
    from seecr.commands import Commands
    from seecr.effects import (
        Effect,
        Knowledge,
        Readings,
        Term,
        Terms,
        catalogue,
        effect_named,
        layout_of,
        parameter,
    )
    from seecr.equilibrium import solve
    from seecr.errors import (
        InputError,
        InputFileError,
        MissingPackageError,
        RobotError,
        SeecrError,
    )
    from seecr.experiment import Experiment, Prediction, predict
    from seecr.exported.export import Export, export
    from seecr.following import Jump
    from seecr.inverse import Correction, correct
    from seecr.loads import Loads
    from seecr.maps import Workspace, boundary, default_axes, workspace_map
    from seecr.mjcf import load_robot
    from seecr.model import Model, load_model, new_model
    from seecr.multiple import equilibria
    from seecr.passes import Barrier, barriers
    from seecr.planar import BarRest, bar_equilibria, bar_tilt, midline_point, solution_manifold
    from seecr.robot import Joint, Robot
    from seecr.sensitivity import sensitivities
    from seecr.setup import Setup
    from seecr.shipped import model_names, model_path
    from seecr.solution import Solution, Status
    from seecr.uncertainty import Spread, spread_of
    from seecr.workspace import Zone, feasible, slack_zones, tension_margin

__version__ = "0.1.0"

# Imported when first used: the compiled loop and MuJoCo take a while to load.
_MODULES = {
    "passes": ("Barrier", "barriers"),
    "chances": ("held_chance", "kept_chance"),
    "commands": ("Commands",),
    "effects": (
        "Effect", "Knowledge", "Readings", "Term", "Terms", "catalogue", "effect_named",
        "layout_of", "parameter",
    ),
    "equilibrium": ("solve",),
    "errors": ("InputError", "InputFileError", "MissingPackageError", "RobotError", "SeecrError"),
    "experiment": ("Experiment", "Prediction", "predict"),
    "exported.export": ("Export", "export"),
    "following": ("Jump",),
    "loads": ("Loads",),
    "inverse": ("Correction", "correct"),
    "maps": ("Workspace", "boundary", "default_axes", "workspace_map"),
    "mjcf": ("load_robot",),
    "model": ("Model", "load_model", "new_model"),
    "multiple": ("equilibria",),
    "planar": ("BarRest", "bar_equilibria", "bar_tilt", "midline_point", "solution_manifold"),
    "robot": ("Joint", "Robot"),
    "sensitivity": ("sensitivities",),
    "setup": ("Setup",),
    "solution": ("Solution", "Status"),
    "shipped": ("model_names", "model_path"),
    "uncertainty": ("Spread", "spread_of"),
    "workspace": ("Zone", "feasible", "slack_zones", "tension_margin"),
}  # fmt: skip
_WHERE = {name: module for module, names in _MODULES.items() for name in names}

__all__ = [
    "BarRest",
    "Barrier",
    "Commands",
    "Correction",
    "Effect",
    "Experiment",
    "Export",
    "InputError",
    "InputFileError",
    "Joint",
    "Jump",
    "Knowledge",
    "Loads",
    "MissingPackageError",
    "Model",
    "Prediction",
    "Readings",
    "Robot",
    "RobotError",
    "SeecrError",
    "Setup",
    "Solution",
    "Spread",
    "Status",
    "Term",
    "Terms",
    "Workspace",
    "Zone",
    "bar_equilibria",
    "bar_tilt",
    "barriers",
    "boundary",
    "catalogue",
    "correct",
    "default_axes",
    "effect_named",
    "equilibria",
    "export",
    "feasible",
    "held_chance",
    "kept_chance",
    "layout_of",
    "load_model",
    "load_robot",
    "midline_point",
    "model_names",
    "model_path",
    "new_model",
    "parameter",
    "predict",
    "sensitivities",
    "slack_zones",
    "solution_manifold",
    "solve",
    "spread_of",
    "tension_margin",
    "workspace_map",
]


__getattr__ = lazily(__name__, _WHERE, modules=("inverse", "workspace"))


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
