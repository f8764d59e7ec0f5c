"""The suite's cases, what can be given to ``run_suite``, and thresholds."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import crosscheck
import seecr
from crosscheck.errors import CrosscheckError
from crosscheck.suite import run as suite
from crosscheck.suite.agreement import SHIPPED, load_thresholds, thresholds_toml
from crosscheck.suite.cases import (
    Case,
    robot_random,
    robot_sweep,
    select,
    shipped_cases,
)
from crosscheck.suite.results import failure_lines, remarks
from crosscheck.suite.run import chosen_cases, run_case
from crosscheck.suite.verdicts import Outcome, Verdict
from seecr.description.mjcf import CABLES, model_path
from seecr.errors import InputFileError
from seecr.files import plain
from seecr.pose import pose_difference

PLANAR = seecr.model_path("planar_vertical")


@pytest.fixture(scope="module")
def shipped() -> list[Case]:
    return shipped_cases()


# --- cases ---------------------------------------------------------------------------------


def test_shipped_cases_are_the_papers(shipped):
    names = [case.name for case in shipped]
    assert len(set(names)) == len(names)
    for robot in ("cogiro", "parallel"):
        for cable in CABLES:
            kinds = ("z0.10", "z0.20", "random")
            assert [f"{robot}-{cable}-{kind}" in names for kind in kinds] == [True] * 3
    by_name = {case.name: case for case in shipped}
    sweep = by_name["parallel-fishing-z0.20"].poses
    assert sweep.shape == (24, 7)
    assert (sweep[0, 0], sweep[-1, 0]) == (0.17, 0.63)
    assert np.all(sweep[:, 1:] == [0.25, 0.2, 1, 0, 0, 0])
    assert by_name["parallel-fishing-z0.20"].ea == 300.0
    assert by_name["cogiro-vectran-random"].poses.shape == (200, 7)


def test_random_poses_lie_in_the_frame_and_crossed_cables_turn(shipped):
    for case in shipped:
        if not case.name.endswith("-random") or not case.model.stem.startswith("demobot"):
            continue
        assert np.all(case.poses[:, :3] > 0.0)
        assert np.all(case.poses[:, :3] < [0.8, 0.5, 0.45])
        turn = 2 * np.arccos(np.clip(case.poses[:, 3], -1, 1))
        if case.name.startswith(("cogiro", "off-centre")):
            assert np.deg2rad(8) < turn.max() <= np.deg2rad(12)
        else:
            assert np.all(turn == 0.0)


def test_turned_sweeps_turn_about_every_axis_and_planar_ones_about_theirs(shipped):
    for case in shipped:
        if not case.name.endswith("-turned"):
            continue
        turns = np.ptp(case.poses[:, 4:], axis=0)
        axes = [1] if case.name.startswith("planar") else [0, 1, 2]
        assert np.all(turns[axes] > np.sin(np.deg2rad(5.0)))
        assert np.all(np.delete(turns, axes) == 0.0)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("cable", "mm", "degrees"), [("vectran", 15.7, 26.2), ("fishing", 4.7, 19.2)]
)
def test_a_tilted_command_is_compared_at_both_of_its_rests(shipped, cable, mm, degrees):
    (case,) = select(shipped, [f"parallel-{cable}-tilted"])
    result = run_case(case, load_thresholds())
    assert result.outcome is Outcome.AGREE and result.compared.all() and not result.findings
    for answers in (result.solution, result.settling):
        away = pose_difference(answers.pose[:1], answers.pose[1:])[0]
        assert 1e3 * np.linalg.norm(away[:3]) == pytest.approx(mm, abs=0.1)
        assert np.degrees(np.linalg.norm(away[3:])) == pytest.approx(degrees, abs=0.1)
    # there are no more: what SEECR finds beside its own rest is where the second start leads
    found = seecr.solve(result.robot, case.poses[0], others=True)
    np.testing.assert_allclose(found.pose, result.settling.pose[:1], rtol=0, atol=1e-8)
    (others,) = found.others
    np.testing.assert_allclose(others.pose, result.settling.pose[1:], rtol=0, atol=1e-8)
    assert np.array_equal(result.as_json()["start"], case.starts)


@pytest.mark.parametrize("cable", CABLES)
@pytest.mark.parametrize("side", ["SEECR", "MuJoCo"])
def test_the_other_rest_of_a_tilted_command_does_not_pass(shipped, cable, side, monkeypatch):
    """A stable equilibrium of that very command, and still not the one that the start leads to."""
    (case,) = select(shipped, [f"parallel-{cable}-tilted"])
    if side == "SEECR":

        def solve(robot, poses, *, start=None, **options):
            other = None if start is None else start[::-1]
            return seecr.solve(robot, poses, start=other, **options)

        monkeypatch.setattr(suite, "seecr_solve", solve)
    else:
        settle = suite.settle_batch
        monkeypatch.setattr(suite, "settle_batch", lambda s, at, rest: settle(s, at[::-1], rest))
    result = run_case(case, load_thresholds())
    assert list(result.verdict) == [Verdict.BRANCH] * 2
    assert result.outcome is Outcome.DIFFER
    assert remarks(result) == "2 two equilibria (2 beyond limits)"
    assert ", started at (0.4 0.25 0.15; 1 0 0 0): two stable" in failure_lines(result)[1]


@pytest.mark.slow
def test_the_seed_decides_the_random_poses():
    one, same, other = shipped_cases(3), shipped_cases(3), shipped_cases(4)
    for a, b, c in zip(one, same, other, strict=True):
        assert np.array_equal(a.poses, b.poses)
        assert np.array_equal(a.poses, c.poses) != a.name.endswith("-random")
    poses = {case.name: case.poses for case in one}
    assert not np.array_equal(poses["cogiro-vectran-random"], poses["cogiro-fishing-random"])


@pytest.mark.parametrize("name", ["demobot_cogiro", "planar_two_cable", "planar_vertical"])
def test_poses_for_any_robot_scale_with_it(name):
    robot = seecr.load_robot(model_path(name))
    hull = np.vstack([robot.exit_points, robot.reference_pose[:3]])
    for poses in (robot_sweep(robot), robot_random(robot, np.random.default_rng(1), 50)):
        assert np.all(poses[:, :3] >= hull.min(axis=0) - 1e-12)
        assert np.all(poses[:, :3] <= hull.max(axis=0) + 1e-12)
        # also with joints, whose manifold these poses must not leave
        assert seecr.solve(robot, poses).converged.all()
    assert np.ptp(robot_sweep(robot)[:, 0]) > 0.4


def test_select_by_pattern_and_refuses_unknown_names(shipped):
    chosen = select(shipped, ["parallel-*-z0.10", "planar-vertical"])
    names = ["parallel-vectran-z0.10", "parallel-fishing-z0.10", "planar-vertical"]
    assert [case.name for case in chosen] == names
    assert select(shipped, []) == shipped
    with pytest.raises(CrosscheckError, match=r"^cogiro-vektran-z0\.1: .*cogiro-vectran-z0"):
        select(shipped, ["planar-*", "cogiro-vektran-z0.1"])


# --- thresholds ----------------------------------------------------------------------------


def test_shipped_thresholds_are_those_agreed():
    found = plain(load_thresholds())
    assert found["settled"] == {"position_m": 1e-6, "orientation_rad": 1e-5}
    assert found["polished"] == {"position_m": 1e-8, "orientation_rad": 1e-7, "tension_N": 1e-6}
    assert found["findings"]["branches"] == 0
    assert len(found["findings"]["free_to_move"]) == 14


def test_a_copy_may_change_one_value_and_is_written_back(tmp_path):
    copy = tmp_path / "mine.toml"
    copy.write_text("[polished]\ntension_N = 2e-3\n")
    thresholds = load_thresholds(copy)
    assert thresholds.polished.tension_N == 2e-3
    assert thresholds.polished.position_m == 1e-8
    copy.write_text(thresholds_toml(thresholds))
    assert load_thresholds(copy) == thresholds
    assert thresholds_toml(load_thresholds()) == SHIPPED.read_text()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[polish]\nposition_m = 1",
         r"'polish' is not a table of thresholds; expected polished or"),
        ("[polished]\nposition_mm = 1",
         r"'position_mm' is not a key of \[polished\] of thresholds; expected position_m or"),
        ("[settled]\nposition_m = 0",
         r"\[settled\] position_m: expected a positive number up to 1, got 0"),
        ("[settled]\nposition_m = -1e-6", r"expected a positive number up to 1, got -1e-06"),
        ("[settled]\nposition_m = nan", r"expected a positive number up to 1, got nan"),
        ("[settled]\nposition_m = inf", r"expected a positive number up to 1, got inf"),
        ("[settled]\nposition_m = 1e23", r"positive number up to 1, got 1e\+23"),
        ("[polished]\norientation_rad = 90", r"positive number up to 3.14, got 90"),
        ("[settled]\nposition_m = true", r"expected a positive number up to 1, got True"),
        ("[settled]\nposition_m = '1e-6'", r"expected a positive number up to 1, got '1e-6'"),
        ("settled = 3", r"settled: expected a table \[settled\], got 3"),
        ("[settled\n", r"is not TOML: .*line 1"),
        ("[findings]\nbranches = 0.5", r"\[findings\] branches: expected a whole number from 0"),
        ("[findings]\nbranches = -1", r"branches: expected a whole number from 0 on, got -1"),
        ("[findings]\nfree_to_move = 'x 1'", r"free_to_move: expected a list of names"),
        ("[findings]\nfree_elsewhere = 2", r"free_elsewhere: expected a share from 0 to 1, got 2"),
    ],
)  # fmt: skip
def test_bad_thresholds(tmp_path, text, message):
    path = tmp_path / "bad.toml"
    path.write_text(text)
    with pytest.raises(InputFileError, match=message) as caught:
        load_thresholds(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


def names(given: Any) -> list[str]:
    return [case.name for case in chosen_cases(given, 0)]


@pytest.mark.slow
def test_cases_are_chosen_by_name_by_pattern_and_by_robot() -> None:
    assert names("planar-vertical") == names(["planar-vertical"]) == ["planar-vertical"]
    every = names("planar-vertical*")
    assert names(["planar-vertical", "planar-vert*"]) == every and len(every) > 1
    assert names(["effects"]) and all(name.startswith("effect-") for name in names("effects"))
    own = ["planar_vertical-sweep", "planar_vertical-random"]
    robot = seecr.load_robot(PLANAR)
    for given in (PLANAR, str(PLANAR), "planar_vertical", robot, [robot]):
        assert names(given) == own
    assert len(names(None)) > len(names("*-*")) - 1 > 50


@pytest.mark.parametrize(
    ("given", "error", "text"),
    [
        ([], seecr.InputError, r"^expected at least one case to run, got none"),
        (3, seecr.InputError, r"^expected cases, .* got int$"),
        ([None], seecr.InputError, r"^expected cases, .* got NoneType$"),
        ("planar-vertica", crosscheck.CrosscheckError, r"^planar-vertica: .* planar-vertical,"),
        ("gone.xml", seecr.RobotError, r"gone\.xml"),
        (
            [Case("none", PLANAR, PLANAR, None, "random", np.zeros((0, 7)))],
            seecr.InputError,
            r"^case none has no poses",
        ),
    ],
    ids=str,
)
def test_what_cannot_be_run_is_refused(given: Any, error: type[Exception], text: str) -> None:
    with pytest.raises(error, match=text):
        crosscheck.run_suite(given)


def test_a_robot_that_is_not_its_file_is_refused() -> None:
    robot = seecr.load_robot(PLANAR)
    with pytest.raises(
        seecr.InputError, match=r"has different numbers from .*planar_vertical\.xml"
    ):
        crosscheck.run_suite(replace(robot, gravity=0.5 * robot.gravity))
    with pytest.raises(seecr.InputError, match="was not read from a file"):
        crosscheck.run_suite(replace(robot, source=None))
