"""Margins at poses, and whether they mean that a pose is held."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rectangle import RECTANGLE

from seecr.description.mjcf import load_robot
from seecr.effects import Term, Terms
from seecr.prediction.model import Model
from seecr.workspace.margins import is_held, margins_at, read_once

COGIRO = load_robot("demobot_cogiro")
HOME = COGIRO.reference_pose[None]


def test_a_pose_is_held_to_within_rounding_of_the_load() -> None:
    margins = 20.0 * np.array([0.0, -9e-10, -1.1e-9, np.inf, -np.inf, np.nan])
    assert is_held(RECTANGLE, margins).tolist() == [True, True, False, True, False, False]


def test_without_gravity_it_is_the_rounding_of_the_cables() -> None:
    floating = replace(RECTANGLE, gravity=np.zeros(3))
    margins = 1e-3 * 1000.0 * np.array([-9e-10, -1.1e-9])
    assert is_held(floating, margins).tolist() == [True, False]


def test_a_heavier_platform_is_the_robot_with_that_mass() -> None:
    added = Terms([Term.of(COGIRO, "platform_mass", added_kg=0.2)])
    heavy = replace(COGIRO, mass=COGIRO.mass + 0.2)
    limits = 0.1, 6.0
    found = margins_at(COGIRO, HOME, *limits, None, added)
    assert found == pytest.approx(margins_at(heavy, HOME, *limits, None, ()), rel=1e-9)
    assert abs(found[0] - margins_at(COGIRO, HOME, *limits, None, ())[0]) > 1e-3


def test_a_model_is_read_once_and_what_is_read_stays_as_it_is(tmp_path: Path) -> None:
    path = tmp_path / "m.toml"
    path.write_text('[[effect]]\nname = "platform_mass"\nparameters.added_kg = 0.2\n')
    for given in (path, str(path)):
        model = read_once(given, COGIRO)
        assert isinstance(model, Model) and model.terms["platform_mass"].vector == [0.2]
        assert read_once(model, COGIRO) is model
