"""Probabilities by a model's covariance, against models drawn from it and solved one by one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from calibrated import KEPT, MODEL, POSES, ROBOT, model_of
from robots import RECTANGLE

from seecr.description.mjcf import load_robot
from seecr.description.robot import Robot
from seecr.effects import Term, Terms
from seecr.equilibrium.solving import solve
from seecr.errors import InputError, InputFileError
from seecr.inverse.correction import correct
from seecr.pose import Array
from seecr.prediction.model import Model, load_model
from seecr.show.batch_words import chance_lines, likely_lines
from seecr.show.files import write_arrays
from seecr.statics.solution import Solution
from seecr.workspace import edges
from seecr.workspace.edges import boundary, held_chance, kept_chance, margins_at
from seecr.workspace.maps import workspace_map
from seecr.workspace.margins import feasible, is_held, margins_with, tension_margin


def drawn(model: Model, n: int) -> list[Terms]:
    sizes = np.array([np.concatenate([model.stderr[name] for name in model.terms.names])])
    labels = [effect for effect, _key in model.terms.labels]
    correlation = np.eye(len(labels))
    a, b = labels.index("platform_mass"), labels.index("stiffness")
    correlation[a, b] = correlation[b, a] = 0.5
    covariance = correlation * sizes.T * sizes
    vectors = np.random.default_rng(1).multivariate_normal(model.terms.vector, covariance, n)
    return [model.terms.with_vector(one) for one in vectors]


def test_tensions_keep_their_limits_as_often_as_drawn_models_say(tmp_path: Path) -> None:
    model = model_of(tmp_path, MODEL + KEPT)
    found = correct(ROBOT, POSES, effects=model, lowest=0.2)
    # as narrow as half of the models allow
    highest = 1.01 * found.solution.tensions.max()
    said = kept_chance(ROBOT, found.commands, model, lowest=0.2, highest=highest)
    assert said is not None
    seen = []
    for terms in drawn(model, 200):
        rests: Solution = solve(ROBOT, found.commands, effects=terms)
        inside = (rests.tensions >= 0.2 - 1e-9) & (rests.tensions <= highest + 1e-9)
        seen.append(inside.all(axis=1))
    np.testing.assert_allclose(said, np.mean(seen, axis=0), atol=0.08)
    assert 0.02 < said.min() < 0.9
    (line,) = chance_lines(found, said)
    assert line.startswith(
        f"tensions stay within the limits with a probability of at least {said.min():.2f}"
    )
    assert found.as_json(said)["rows"][1]["within_limits_probability"] == said[1]
    assert list(chance_lines(found, None)) == []


@pytest.mark.slow
def test_poses_are_held_as_often_as_drawn_models_say(tmp_path: Path) -> None:
    model = model_of(tmp_path, MODEL + KEPT)
    # towards the edge of what can be held
    poses = np.tile(POSES[0], (9, 1))
    poses[:, 0] = np.linspace(0.02, 0.12, 9)
    said = held_chance(ROBOT, poses, model, lowest=0.02)
    assert said is not None
    seen = [margins_with(ROBOT, poses, terms, 0.02) >= 0.0 for terms in drawn(model, 200)]
    np.testing.assert_allclose(said, np.mean(seen, axis=0), atol=0.08)
    assert said.min() < 0.05 and said.max() == 1.0 and np.any((said > 0.1) & (said < 0.9))


def test_poses_far_from_the_limit_are_decided_by_few_models(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    model = model_of(tmp_path, MODEL + KEPT)
    poses = np.tile(POSES[0], (9, 1))
    poses[:, 0] = [-0.5, *np.linspace(0.02, 0.12, 7), 0.3]
    tried = np.zeros(9, dtype=int)

    def counting(robot: Robot, at: Array, *rest: Any, **how: Any) -> Array:
        tried[np.isin(poses[:, 0], at[:, 0])] += 1
        return margins_at(robot, at, *rest, **how)

    monkeypatch.setattr(edges, "margins_at", counting)
    few = held_chance(ROBOT, poses, model, lowest=0.02)
    assert few is not None
    assert np.all(tried[(few > 0.0) & (few < 1.0)] == 256)
    assert tried.min() == 4
    monkeypatch.setattr(edges, "_STAGES", ((256, 0.0),))
    every = held_chance(ROBOT, poses, model, lowest=0.02)
    assert every is not None
    np.testing.assert_allclose(few, every, atol=0.005)


def test_two_cables_hold_a_position_as_often_as_the_mass_allows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In the middle of two cables the tension is proportional to the mass, whatever else."""
    monkeypatch.setattr(edges, "_STAGES", ((4, 15.0), (64, 0.0)))
    two = load_robot("planar_two_cable")
    (tmp_path / "model.toml").write_text(
        'format = 1\n[[effect]]\nname = "platform_mass"\n[effect.parameters]\n'
        "added_kg = { value = 0.0, stderr = 0.02 }\n[calibration]\n"
        'parameters = ["platform_mass.added_kg"]\ncorrelation = [[1.0]]\n'
    )
    model = load_model(tmp_path / "model.toml", two)
    middle = two.reference_pose[None]
    tension = float(margins_at(two, middle, 0.0, np.inf, None, ())[0])
    # few of the models allow for the second; the first four of them do not
    for z, expected in ((-1.0, 0.159), (-1.8, 0.036), (9.0, 1.0)):
        highest = tension * (1.0 + z * 0.02 / two.mass)
        said = held_chance(two, middle, model, highest=highest)
        assert said is not None and said[0] == pytest.approx(expected, abs=0.02)
    found = workspace_map(two, 0.5, 0.0, [0.5, 0.9], effects=model, highest=tension, chance=True,
                          elastic=False)  # fmt: skip
    assert found.chance is not None
    assert found.chance.ravel() == pytest.approx([0.5, 0.0], abs=0.02)


def test_wrenches_on_joints_count_along_them_with_effects_as_without() -> None:
    """A planar robot with a model had been refused a set of wrenches."""
    robot = load_robot("planar_vertical")
    poses = np.tile(robot.reference_pose, (3, 1))
    poses[:, 0] += [-0.04, 0.0, 0.03]
    # what pushes across the plane is carried by the joints
    pushes = [[0.3, 5.0, 0, 0, 0, 0], [0, 0, 0.2, 0, 0.01, 3.0]]
    expected = tension_margin(robot, poses, lowest=0.1, highest=6.0, wrenches=pushes)
    assert np.all(np.abs(expected - tension_margin(robot, poses, lowest=0.1, highest=6.0)) > 0.05)
    for name, value in (("stiffness", {"factor": 1.2}), ("cable_weight", {"weight_N_per_m": 1e-9})):
        acting = [Term.of(robot, name, **value).effect()]
        own = margins_with(robot, poses, acting, 0.1, 6.0, pushes)
        np.testing.assert_allclose(own, expected, rtol=1e-6)


def test_wrenches_that_are_none_are_refused_with_effects_as_without() -> None:
    """With a model a wrench of NaN came out as held."""
    softer = [Term.of(ROBOT, "stiffness", factor=0.9)]
    for bad, said in (([np.nan, 0, 0, 0, 0, 0], "not finite"), ([1, 2, 3], r"must be \(k, 6\)")):
        for acting in ((), softer):
            with pytest.raises(InputError, match=said):
                workspace_map(ROBOT, 0.3, 0.2, 0.1, effects=acting, wrenches=bad, elastic=False)


def test_a_model_without_covariance_says_nothing(tmp_path: Path) -> None:
    model = model_of(tmp_path, MODEL)
    found = correct(ROBOT, POSES, effects=model)
    assert kept_chance(ROBOT, found.commands, model) is None
    assert held_chance(ROBOT, POSES, model) is None


@pytest.mark.slow
def test_a_map_has_the_probabilities_of_its_poses(tmp_path: Path) -> None:
    model, x = model_of(tmp_path, MODEL + KEPT), np.linspace(0.02, 0.12, 6)
    found = workspace_map(
        ROBOT, x, 0.2, 0.1, effects=model, lowest=0.02, elastic=False, chance=True
    )
    poses = np.tile(POSES[0], (6, 1))
    poses[:, 0] = x
    assert found.chance is not None
    expected = held_chance(ROBOT, poses, model, lowest=0.02)
    np.testing.assert_allclose(found.chance.ravel(), expected, atol=1e-6)
    # margins are those of the robot that the model describes
    np.testing.assert_allclose(found.margin.ravel(), margins_with(ROBOT, poses, model, 0.02))
    sure = int(found.likely(0.95).sum())
    assert 0 < sure < int(found.likely(0.05).sum())
    (line,) = likely_lines(found, 0.95)
    expected_line = f"with a probability of 0.95 or more {sure} poses can be held, "
    assert line.startswith(f"{expected_line}{0.02 * (sure - 0.5):.4g} m (")
    assert found.as_json(0.95)["likely"]["size"] == pytest.approx(0.02 * (sure - 0.5))
    write_arrays(tmp_path / "map.npz", found)
    with np.load(tmp_path / "map.npz") as kept:
        np.testing.assert_array_equal(kept["probability"], found.chance)


@pytest.mark.slow
def test_the_boundary_is_that_of_the_model_and_of_the_probability_asked_for(tmp_path: Path) -> None:
    model = model_of(tmp_path, MODEL + KEPT)
    inside, outside = POSES[:1].copy(), POSES[:1].copy()
    inside[:, :3], outside[:, :3] = [0.3, 0.2, 0.1], [0.0, 0.2, 0.1]
    ends = {"lowest": 0.02, "tolerance": 1e-5, "effects": model}
    own = boundary(ROBOT, inside, outside, **ends)
    np.testing.assert_allclose(margins_with(ROBOT, own, model, 0.02), 0.0, atol=1e-3)
    plain = boundary(ROBOT, inside, outside, lowest=0.02, tolerance=1e-5)
    assert abs(own - plain).max() > 5e-4
    ends["tolerance"] = 2e-3
    sure = boundary(ROBOT, inside, outside, at_least=0.95, **ends)
    maybe = boundary(ROBOT, inside, outside, at_least=0.05, **ends)
    assert sure[0, 0] > own[0, 0] > maybe[0, 0]
    further = sure + np.array([-2e-3, 0, 0, 0, 0, 0, 0])
    said = held_chance(ROBOT, np.concatenate([sure, further]), model, lowest=0.02)
    assert said is not None and said[0] >= 0.95 > said[1]
    with pytest.raises(InputError, match="need a model with its covariance"):
        boundary(ROBOT, inside, outside, at_least=0.95)


def test_maps_that_can_have_no_probabilities_are_refused(tmp_path: Path) -> None:
    def told(_done: int) -> None:
        raise AssertionError("a part was mapped")

    for effects in ((), model_of(tmp_path, MODEL)):
        with pytest.raises(InputError, match="need a model with its covariance; expected a table"):
            workspace_map(ROBOT, 0.3, 0.2, 0.1, effects=effects, chance=True, progress=told)
    plain = workspace_map(ROBOT, 0.3, 0.2, 0.1, elastic=False)
    with pytest.raises(InputError, match="this map has no probabilities"):
        plain.likely(0.9)
    with pytest.raises(InputError, match=r"above 0 and at most 1, got 1\.5"):
        plain.likely(1.5)


def test_draws_spread_as_the_covariance_says_whatever_the_units(tmp_path: Path) -> None:
    """Points were drawn eleven times too far apart beside a coefficient that is off by 10^5."""
    beside = """[[effect]]
name = "nonlinear_elasticity"
[effect.parameters]
quadratic = { value = 0.0, stderr = 3e3 }
cubic = { value = 0.0, stderr = 6e5 }
[[effect]]
name = "cable_length_offset"
[effect.parameters]
offset_m = { value = 0.0, stderr = 1e-4 }
"""
    terms = model_of(tmp_path, MODEL + beside).terms
    p = len(terms)
    error = np.where(terms.scale > 1.0, 6e5, 1e-2 * terms.scale)
    mixed = np.random.default_rng(2).normal(size=(p, 2 * p))
    covariance = mixed @ mixed.T * error / np.linalg.norm(mixed, axis=1)
    covariance = covariance * (error / np.linalg.norm(mixed, axis=1))[:, None]
    draws = edges._drawn(terms, covariance, 4096)
    free = np.isneginf(terms.lower)  # others are put on their bounds
    assert free.sum() > 3 and np.ptp(np.log10(error[free])) > 7.0
    expected = covariance[np.ix_(free, free)] / error[free] / error[free][:, None]
    found = np.cov(draws[:, free].T) / error[free] / error[free][:, None]
    np.testing.assert_allclose(found, expected, atol=0.05)


def test_no_value_is_drawn_beyond_its_bounds(tmp_path: Path) -> None:
    """Half of the draws of a wheel at zero would have a negative radius, which no cable runs on."""
    beside = """[[effect]]
name = "pulley_radius"
[effect.parameters]
radius_m = { value = 0.0, stderr = 0.01 }
[[effect]]
name = "frame_compliance"
[effect.parameters]
sideways_m_per_N = { value = 0.0, stderr = 1e-3 }
upwards_m_per_N = { value = 0.0, stderr = 1e-3 }
"""
    keys = [f"{e}.{k}" for e, k in model_of(tmp_path, MODEL + beside).terms.labels]
    rows = [[0.0] * k + [1.0] for k in range(len(keys))]
    kept = f"[calibration]\nparameters = {keys}\ncorrelation = {rows}\n".replace("'", '"')
    model = model_of(tmp_path, MODEL + beside + kept)
    said = held_chance(ROBOT, POSES, model, lowest=0.02)
    assert said is not None and np.all((said >= 0.0) & (said <= 1.0))
    found = correct(ROBOT, POSES, effects=model)
    assert np.isfinite(kept_chance(ROBOT, found.commands, model)).all()
    # out of all reach no pose is held by any of them
    far = POSES + np.array([9.0, 0, 0, 0, 0, 0, 0])
    np.testing.assert_array_equal(held_chance(ROBOT, far, model, lowest=0.02), 0.0)


# --- Margins at poses, and whether they mean that a pose is held


COGIRO = load_robot("demobot_cogiro")
HOME = COGIRO.reference_pose[None]


def test_a_pose_is_held_to_within_rounding_of_the_load() -> None:
    margins = 20.0 * np.array([0.0, -9e-10, -1.1e-9, np.inf, -np.inf, np.nan])
    assert is_held(RECTANGLE, margins).tolist() == [True, True, False, True, False, False]
    floating = replace(RECTANGLE, gravity=np.zeros(3))  # of the cables, without a load
    margins = 1e-3 * 1000.0 * np.array([-9e-10, -1.1e-9])
    assert is_held(floating, margins).tolist() == [True, False]


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
