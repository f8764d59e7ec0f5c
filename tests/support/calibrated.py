"""A calibrated model of one robot, from text, for tests of what it does not know."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from seecr.description.mjcf import load_robot
from seecr.description.shipped import model_path
from seecr.prediction.model import Model, load_model

ROBOT = load_robot(model_path("demobot_cogiro"))
POSES = np.array([[0.3, 0.2, 0.1, 1, 0, 0, 0], [0.5, 0.3, 0.2, 1, 0, 0, 0]])


def model_of(folder: Path, text: str) -> Model:
    """The model that a file of this text describes."""
    path = folder / "model.toml"
    path.write_text(text)
    return load_model(path, ROBOT)
