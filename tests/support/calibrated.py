"""A calibrated model of one robot, from text, for tests of what it does not know."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from seecr.description.mjcf import load_robot, model_path
from seecr.prediction.model import Model, load_model

ROBOT = load_robot(model_path("demobot_cogiro"))
POSES = np.array([[0.3, 0.2, 0.1, 1, 0, 0, 0], [0.5, 0.3, 0.2, 1, 0, 0, 0]])
# Effects with their errors, and how two of those go together.
MODEL = """format = 1
[[effect]]
name = "platform_mass"
[effect.parameters]
added_kg = { value = 0.05, stderr = 0.02 }
[[effect]]
name = "stiffness"
[effect.parameters]
factor = { value = 0.9, stderr = 0.01 }
[[effect]]
name = "centre_of_mass"
[effect.parameters]
shift_x_m = { value = 0.0, stderr = 0.002 }
shift_y_m = { value = 0.0, stderr = 0.002 }
shift_z_m = { value = 0.0, stderr = 0.002 }
"""
KEPT = """[calibration]
parameters = ["platform_mass.added_kg", "stiffness.factor"]
correlation = [[1.0], [0.5, 1.0]]
"""


def model_of(folder: Path, text: str) -> Model:
    """The model that a file of this text describes."""
    path = folder / "model.toml"
    path.write_text(text)
    return load_model(path, ROBOT)
