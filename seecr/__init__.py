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

from seecr.lazy import lazily, pictured

if TYPE_CHECKING:
    from seecr.commands import Commands, Loads
    from seecr.controlled.control import control
    from seecr.controlled.plant import SensorNoise
    from seecr.controlled.result import Control, Controlled
    from seecr.controlled.schemes import Feedback, FeedForward, Scheme
    from seecr.description.mjcf import load_robot, model_names, model_path
    from seecr.description.robot import Joint, Robot
    from seecr.effects import (
        Effect,
        Knowledge,
        Readings,
        Term,
        Terms,
        catalogue,
        effect_named,
        introduce,
        layout_of,
        parameter,
    )
    from seecr.effects.setup import Setup
    from seecr.equilibrium.lower import LowerEquilibria, lower_equilibria
    from seecr.equilibrium.saddles import Barrier, barriers
    from seecr.equilibrium.search import equilibria
    from seecr.equilibrium.solving import solve
    from seecr.errors import (
        ExecutorError,
        InputError,
        InputFileError,
        MissingPackageError,
        NoRestError,
        RobotError,
        SeecrError,
    )
    from seecr.exported.export import Export, export
    from seecr.inverse.correction import correct
    from seecr.inverse.result import Correction
    from seecr.prediction.experiment import Experiment, Prediction, placed, predict, tracked
    from seecr.prediction.model import Model, load_model, new_model
    from seecr.prediction.sensitivity import sensitivities
    from seecr.prediction.uncertainty import Spread, spread_of
    from seecr.statics.solution import Jump, Solution, Status
    from seecr.workspace.bars import (
        BarBalance,
        BarManifold,
        Midlines,
        bar_balances,
        bar_manifold,
        midline_points,
    )
    from seecr.workspace.edges import boundary, held_chance, kept_chance
    from seecr.workspace.grid import Workspace
    from seecr.workspace.maps import default_axes, with_history, workspace_map
    from seecr.workspace.margins import Zone, feasible, slack_zones, tension_margin
    from seecr.workspace.planar import (
        BarRest,
        bar_equilibria,
        bar_tilt,
        midline_point,
        solution_manifold,
    )
    from seecr.workspace.spans import SlackSpan, slack_spans
    from seecr.workspace.stored import StoredMap, store_map

__version__ = "0.1.0"

# Imported on first use: the compiled loop and MuJoCo take a while to load.
_MODULES = {
    "equilibrium.saddles": ("Barrier", "barriers"),
    "workspace.edges": ("held_chance", "kept_chance", "boundary"),
    "commands": ("Commands", "Loads",),
    "controlled.control": ("control",),
    "controlled.plant": ("SensorNoise",),
    "controlled.result": ("Control", "Controlled"),
    "controlled.schemes": ("FeedForward", "Feedback", "Scheme"),
    "effects": (
        "Effect", "Knowledge", "Readings", "Term", "Terms", "catalogue", "effect_named",
        "introduce", "layout_of", "parameter",
    ),
    "equilibrium.solving": ("solve",),
    "errors": (
        "ExecutorError", "InputError", "InputFileError", "MissingPackageError", "NoRestError",
        "RobotError", "SeecrError",
    ),
    "prediction.experiment": ("Experiment", "Prediction", "predict", "placed", "tracked"),
    "exported.export": ("Export", "export"),
    "inverse.correction": ("correct",),
    "inverse.result": ("Correction",),
    "workspace.grid": ("Workspace",),
    "workspace.maps": ("default_axes", "with_history", "workspace_map"),
    "workspace.stored": ("StoredMap", "store_map"),
    "description.mjcf": ("load_robot", "model_names", "model_path",),
    "prediction.model": ("Model", "load_model", "new_model"),
    "equilibrium.lower": ("LowerEquilibria", "lower_equilibria"),
    "equilibrium.search": ("equilibria",),
    "workspace.planar": (
        "BarRest", "bar_equilibria", "bar_tilt", "midline_point", "solution_manifold",
    ),
    "description.robot": ("Joint", "Robot"),
    "prediction.sensitivity": ("sensitivities",),
    "effects.setup": ("Setup",),
    "statics.solution": ("Jump", "Solution", "Status"),
    "prediction.uncertainty": ("Spread", "spread_of"),
    "workspace.bars": (
        "BarBalance", "BarManifold", "Midlines", "bar_balances", "bar_manifold", "midline_points",
    ),
    "workspace.spans": ("SlackSpan", "slack_spans"),
    "workspace.margins": ("Zone", "feasible", "slack_zones", "tension_margin"),
}  # fmt: skip
_WHERE = {name: module for module, names in _MODULES.items() for name in names}

__all__ = [
    "BarBalance", "BarManifold", "BarRest", "Barrier", "Commands", "Control", "Controlled",
    "Correction", "Effect", "ExecutorError", "Experiment", "Export", "FeedForward", "Feedback",
    "InputError",
    "InputFileError", "Joint", "Jump", "Knowledge", "Loads", "LowerEquilibria", "Midlines",
    "MissingPackageError",
    "Model", "NoRestError", "Prediction", "Readings", "Robot", "RobotError", "Scheme",
    "SeecrError", "SensorNoise", "Setup", "SlackSpan", "Solution", "Spread", "Status", "StoredMap",
    "Term",
    "Terms", "Workspace", "Zone", "bar_balances", "bar_equilibria", "bar_manifold", "bar_tilt",
    "barriers", "boundary", "catalogue", "control", "correct", "default_axes", "effect_named",
    "equilibria", "export", "feasible", "held_chance", "introduce", "kept_chance", "layout_of",
    "load_model",
    "load_robot", "lower_equilibria", "midline_point", "midline_points", "model_names",
    "model_path", "new_model",
    "parameter", "placed", "predict", "sensitivities", "slack_spans", "slack_zones",
    "solution_manifold", "solve", "spread_of", "store_map", "tension_margin", "tracked",
    "with_history", "workspace_map",
]  # fmt: skip


_FOLDERS = ("inverse", "workspace")
pictured(__name__, "show.pictures")
__getattr__ = lazily(__name__, _WHERE, modules=_FOLDERS)


def __dir__() -> list[str]:
    return sorted({*__all__, *_FOLDERS, *(name for name in globals() if name.startswith("__"))})
