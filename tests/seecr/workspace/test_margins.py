"""Margins at poses, and whether they mean that a pose is held."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rectangle import RECTANGLE

from seecr.description.mjcf import load_robot
from seecr.effects import Term, Terms
from seecr.errors import InputError, InputFileError
from seecr.workspace.edges import margins_at
from seecr.workspace.maps import workspace_map
from seecr.workspace.margins import feasible, is_held, tension_margin

COGIRO = load_robot("demobot_cogiro")
HOME = COGIRO.reference_pose[None]


def test_a_pose_is_held_to_within_rounding_of_the_load() -> None:
    margins = 20.0 * np.array([0.0, -9e-10, -1.1e-9, np.inf, -np.inf, np.nan])
    assert is_held(RECTANGLE, margins).tolist() == [True, True, False, True, False, False]
    floating = replace(RECTANGLE, gravity=np.zeros(3))  # of the cables, without a load
    margins = 1e-3 * 1000.0 * np.array([-9e-10, -1.1e-9])
    assert is_held(floating, margins).tolist() == [True, False]


def test_a_heavier_platform_is_the_robot_with_that_mass() -> None:
    added = Terms([Term.of(COGIRO, "platform_mass", added_kg=0.2)])
    heavy = replace(COGIRO, mass=COGIRO.mass + 0.2)
    limits = 0.1, 6.0
    found = margins_at(COGIRO, HOME, *limits, None, added)
    assert found == pytest.approx(margins_at(heavy, HOME, *limits, None, ()), rel=1e-9)
    assert abs(found[0] - margins_at(COGIRO, HOME, *limits, None, ())[0]) > 1e-3


PUSHES = [[0.3, 0, 0, 0, 0, 0], [-0.3, 0, 0, 0, 0, 0], [0, 0, 0, 0, 0.01, 0]]
# Effects of load, geometry and cables; with the last the balance is not linear in the tensions.
ACTING = {
    "none": (),
    "mass": (("platform_mass", {"added_kg": 0.1}),),
    "pulleys": (("pulley_radius", {"radius_m": 0.02}), ("platform_mass", {"added_kg": 0.1})),
    "weight": (("cable_weight", {"weight_N_per_m": 0.02}),),
}


@pytest.mark.parametrize("acting", ACTING)
@pytest.mark.parametrize("pushed", [False, True])
def test_poses_are_held_as_on_a_map_with_its_effects_and_wrenches(
    acting: str, pushed: bool
) -> None:
    """Only maps took effects, and only maps and margins a set of wrenches."""
    x, y = np.linspace(0.05, 0.75, 8), np.linspace(0.05, 0.45, 5)
    effects = [Term.of(COGIRO, name, **values) for name, values in ACTING[acting]]
    asked = {
        "lowest": 0.05, "highest": 4.0, "effects": effects,
        "wrenches": PUSHES if pushed else None,
    }  # fmt: skip
    found = workspace_map(COGIRO, x, y, 0.1, elastic=False, **asked)
    places = np.stack(np.meshgrid(x, y, 0.1, indexing="ij"), axis=-1).reshape(-1, 3)
    poses = np.column_stack([places, np.tile(HOME[0, 3:], (len(places), 1))])
    np.testing.assert_array_equal(tension_margin(COGIRO, poses, **asked), found.margin.ravel())
    held = feasible(COGIRO, poses, **asked)
    np.testing.assert_array_equal(held, found.feasible.ravel())
    assert 0 < held.sum() < len(held)
    plain = tension_margin(COGIRO, poses, lowest=0.05, highest=4.0)
    assert (acting == "none" and not pushed) == np.array_equal(plain, found.margin.ravel())


@pytest.mark.parametrize("acting", ["pulleys", "weight"])
def test_a_wrench_adds_to_effects_and_to_each_of_a_set(acting: str) -> None:
    effects = [Term.of(COGIRO, name, **values) for name, values in ACTING[acting]]
    wrench = np.array([0.1, -0.05, 0.2, 0.001, 0.002, -0.003])
    names = ("force_x_N", "force_y_N", "force_z_N", "moment_x_Nm", "moment_y_Nm", "moment_z_Nm")
    values = dict(zip(names, wrench.tolist(), strict=True))
    outside = [*effects, Term.of(COGIRO, "external_wrench", **values)]
    poses, limits = np.repeat(HOME, 2, axis=0), {"lowest": 0.05, "highest": 6.0}
    for more in (None, PUSHES):
        expected = tension_margin(COGIRO, poses, wrenches=more, effects=outside, **limits)
        own = tension_margin(COGIRO, poses, wrench=wrench, wrenches=more, effects=effects, **limits)
        np.testing.assert_allclose(own, expected, rtol=1e-9)
    each = np.array([wrench, np.zeros(6)])
    by_row = tension_margin(COGIRO, poses, wrench=each, effects=effects, **limits)
    alone = tension_margin(COGIRO, poses, effects=effects, **limits)
    np.testing.assert_allclose(
        by_row, [tension_margin(COGIRO, HOME, effects=outside, **limits)[0], alone[1]], rtol=1e-9
    )
    assert abs(by_row[0] - by_row[1]) > 1e-3


def test_a_wrong_model_or_wrench_is_refused(tmp_path: Path) -> None:
    for ask in (feasible, tension_margin):
        with pytest.raises(InputFileError, match=r"no\.toml: no such file"):
            ask(COGIRO, HOME, effects=tmp_path / "no.toml")
        with pytest.raises(InputError, match="effect"):
            ask(COGIRO, HOME, effects=[3])  # type: ignore[list-item]
        with pytest.raises(InputError, match=r"wrenches must be \(k, 6\) \[N, N m\], got \(2,\)"):
            ask(COGIRO, HOME, wrenches=[1.0, 2.0])
        path = tmp_path / "m.toml"
        path.write_text('[[effect]]\nname = "platform_mass"\nparameters.added_kg = 0.2\n')
        term = Term.of(COGIRO, "platform_mass", added_kg=0.2)
        assert ask(COGIRO, HOME, effects=path) == ask(COGIRO, HOME, effects=[term])
