"""Plans: sizes that show are found when they are there; the algebra of what is alike holds."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_data import SIGMA, measured, soft_cogiro, term
from scipy import stats

from crosscheck.fit.problem import Problem
from crosscheck.fit.state import evaluate
from crosscheck.measurements.data import Sigma
from crosscheck.measurements.read import together
from crosscheck.planning.design import choose_poses, make_plan
from crosscheck.planning.places import extensions, more_poses
from crosscheck.planning.planned import MORE_POSES, READ, Adding, Reads, near_slack, planned
from crosscheck.planning.proposer import NEEDED, chosen_poses, telling_apart
from crosscheck.planning.room import Room, usual_tension
from crosscheck.planning.visibility import (
    Wanted,
    needed,
    signal_left,
    signals,
    signals_like,
    signals_together,
)
from seecr.description.mjcf import load_robot, model_path
from seecr.effects import Terms
from seecr.equilibrium.solving import solve
from seecr.files import json_text
from seecr.pose import rotvec_from_quat
from seecr.workspace.margins import feasible

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def robot():
    return soft_cogiro()


@pytest.fixture(scope="module")
def commands(robot):
    return measured(robot)


@pytest.fixture(scope="module")
def few(robot):
    return measured(robot, points=3)


@pytest.fixture(scope="module")
def plan(robot, commands):
    return make_plan(robot, commands)


def effect(plan, name):
    return next(v for v in plan.effects if v.name == name)


@pytest.mark.parametrize(("directions", "signal"), [(1, 15.1), (2, 17.5), (3, 19.3), (6, 23.2),
                                                    (8, 25.2), (24, 36.1)])  # fmt: skip
def test_the_signal_needed_for_power_and_false_alarms(directions, signal):
    assert needed(directions, 21) == pytest.approx(signal, abs=0.06)
    limit = stats.chi2.isf(0.05 / 21, directions)
    power = stats.ncx2.sf(limit, directions, needed(directions, 21))
    assert power == pytest.approx(0.8, abs=1e-6)


def test_the_smallest_visible_size_leaves_the_signal_needed(robot, plan):
    """chi2 of the plain model on noiseless readings with the effect at that size."""
    found = effect(plan, "stiffness")
    layout = found.signal.layout
    vector = layout.null + found.factor * layout.scale
    quiet = measured(
        robot, [replace(term(robot, "stiffness"), vector=vector)],
        sigma=Sigma(1e-12, 1e-12),
    )  # fmt: skip
    problem = Problem(robot, replace(quiet, sigma=SIGMA), SIGMA, np.ones(quiet.n_rows, dtype=bool))
    base = evaluate(problem, Terms(), problem.noise(problem.experiment.predict()))
    assert base.chi2 == pytest.approx(found.needed, rel=0.05)


def test_what_is_alike_by_algebra_is_named(plan):
    assert {"platform_mass", "external_wrench", "cable_stiffness"} <= set(
        effect(plan, "stiffness").twins
    )
    assert "stiffness" in effect(plan, "platform_mass").twins
    assert effect(plan, "winch_side_length").twins == ("frame_compliance",)
    assert "external_wrench" in effect(plan, "gravity_tilt").twins
    # a force has more directions than a mass: it is no twin of it the other way round
    assert "platform_mass" not in effect(plan, "external_wrench").twins
    assert effect(plan, "pulley_radius").twins == ()


def test_the_confusion_map_is_of_parts(plan):
    names, table = plan.confusion
    assert np.all((table >= -1e-9) & (table <= 1 + 1e-9))
    assert np.all(np.diag(table) == 1)
    i, j = names.index("stiffness"), names.index("platform_mass")
    assert table[i, j] > 1 - 1e-6 and table[j, i] > 1 - 1e-6
    k = names.index("tracker_scale")
    assert table[i, k] < 0.9


def test_what_nobody_stated_is_assumed_and_said(robot, few):
    found = make_plan(robot, replace(few, sigma=Sigma()))
    assert any("noise of positions is not stated: 0.03" in note for note in found.notes)
    assert any("noise of angles is not stated: 0.02 deg" in note for note in found.notes)


def test_what_the_commands_lack_is_said(robot, few):
    found = make_plan(robot, replace(few, t_s=None).rows(slice(0, 10)))
    assert found.missing["creep"].words == "needs the time of each row, column t_s"
    assert found.missing["thermal_expansion"].words == "needs the temperature, column temperature_C"
    assert (
        found.missing["exit_point_error"].words
        == "has 24 parameters, but the data have only 10 rows"
    )


def test_a_payload_and_tensions_tell_mass_from_stiffness(plan):
    by_kind = {s.kind: s for s in plan.suggestions}
    for kind in ("payload", "tensions"):
        pairs = {(g.effect, g.other): g for g in by_kind[kind].reached}
        gain = pairs["platform_mass", "stiffness"]
        assert gain.now == 0.0 and gain.then > gain.needed
    # no reading of the pose alone parts elastic cable behind the exit points from the frame
    for suggestion in plan.suggestions:
        assert ("winch_side_length", "frame_compliance") not in {
            (g.effect, g.other) for g in suggestion.gains
        }


def test_poses_to_add_are_few_feasible_and_help(robot, commands):
    commands = commands.rows(np.arange(10))
    plan = make_plan(robot, commands)
    poses = next(s for s in plan.suggestions if s.kind == "poses")
    assert 0 < len(poses.poses) <= MORE_POSES
    assert len(np.unique(poses.poses, axis=0)) == len(poses.poses)
    assert np.all(feasible(robot, poses.poses))
    assert poses.reached
    assert np.abs(rotvec_from_quat(poses.poses[:, 3:])).max() < 1e-12  # as planned ones are
    for asked, data in ((0.1, commands), (0.0, tilted(commands, 0.1))):
        found = more_poses(make_plan(robot, data, tilt=asked).planned, Room.of(robot, tilt=asked))
        turned = np.linalg.norm(rotvec_from_quat(found.poses[:, 3:]), axis=1)
        assert turned.max() == pytest.approx(0.1)


def tilted(data, angle):
    """The same commands, the first one turned about x."""
    poses = data.command_pose.copy()
    poses[0, 3:] = np.cos(angle / 2.0), np.sin(angle / 2.0), 0.0, 0.0
    return replace(data, command_pose=poses)


def test_chosen_poses_beat_the_first_ones(plan):
    """The greedy choice against as many candidates in the order they come."""
    own, _ = signals(plan.planned)
    grid = more_poses(plan.planned)
    there, row_of = signals_like(grid.plan, own), grid.plan.problem.row_of
    pairs = [Wanted("centre_of_mass", "external_wrench", 1e-3, 19.0)]
    rows = chosen_poses(own, there, row_of, pairs, 4)
    assert len(rows) == 4

    def signal(chosen):
        some = np.isin(row_of, chosen)
        few = {n: replace(s, columns=s.columns[some]) for n, s in there.items()}
        both = signals_together(own, few)
        return signal_left(both["centre_of_mass"], both["external_wrench"])

    assert signal(rows) > 1.5 * signal(np.unique(row_of)[:4])


def test_the_way_back_shows_what_has_a_history(robot):
    there = measured(robot, sigma=Sigma(6e-4, 7e-3))
    found = make_plan(robot, there.rows(there.run == "along_low_fwd"))
    gains = next(s for s in found.suggestions if s.kind == "way_back").gains
    assert ("backlash", "cable_length_offset") in {(g.effect, g.other) for g in gains}
    # and nothing else: to measure a pose once more does not part what has no history
    history = {"hysteresis", "backlash", "exit_friction", "creep"}
    assert all({g.effect, g.other} & history for g in gains)


def test_poses_near_slack_are_flagged():
    parallel = load_robot(model_path("demobot_parallel"))
    commands = measured(parallel, points=4)
    found = make_plan(parallel, commands)
    states = found.planned.base.prediction
    assert found.slack
    tensions = states.tensions
    for (row, cable), (line, name) in zip(near_slack(found.planned), found.slack, strict=True):
        assert tensions[row, cable] < 0.1 * tensions[tensions > 0].mean()
        assert name == parallel.cable_names[cable] and line == commands.line[row]


def test_sizes_are_words_in_millimetres(plan):
    assert effect(plan, "pulley_radius").words(1.0).startswith("radius ")
    assert effect(plan, "pulley_radius").words(1.0).endswith(" mm")
    assert effect(plan, "stiffness").words(1.0) == "factor 1 ± 0.30"
    assert " deg each" in effect(plan, "tracker_frame").words(1.0)
    assert effect(plan, "hysteresis").words(1.0).endswith(" N")
    assert effect(plan, "stiffness").words(np.inf) == "none"


def test_a_planar_robot_and_commanded_lengths(robot, few):
    planar = load_robot(model_path("planar_vertical"))
    found = make_plan(planar, measured(planar, points=3))
    assert found.converged and effect(found, "stiffness").visible
    lengths = replace(
        few, command_pose=None, command_lengths=robot.commanded_lengths(few.command_pose),
    )  # fmt: skip
    found = make_plan(robot, lengths)
    assert "initial_pose_error" in found.missing and effect(found, "stiffness").visible


def test_constant_commands_and_slack_rows(robot, commands):
    still = make_plan(robot, commands.rows(np.zeros(12, dtype=int)))
    json_text(still.as_json())
    loose = replace(robot, gravity=np.zeros(3), rest_lengths=robot.rest_lengths + 1.0)
    found = make_plan(loose, commands)
    assert not found.converged and found.effects == ()
    assert any("left out" in note for note in found.notes)
    json_text(found.as_json())


def test_what_tells_two_effects_of_a_model_apart_is_proposed_by_the_same_means(robot, few):
    """Mass and stiffness move a robot alike: sensors or a load part them, poses never do."""
    model = Terms([term(robot, "stiffness", factor=1.4)])
    here = planned(robot, few, SIGMA, Reads.of_kinds(robot.n_cables), model)
    options = list(extensions(here))
    rival = term(robot, "platform_mass").layout
    found = telling_apart(here, options, "stiffness", rival)
    assert {s.kind for s in found} == {Adding.TENSIONS, Adding.PAYLOAD}
    for suggestion in found:
        (gain,) = suggestion.gains
        assert gain.now == 0.0 and gain.then > gain.needed == NEEDED
    # of a payload the words are those of a plan
    words = {s.kind: s.words for s in make_plan(robot, few).suggestions}
    payload = next(s for s in found if s.kind is Adding.PAYLOAD)
    assert payload.words == words[Adding.PAYLOAD]


def _later(robot, data):
    sigma = replace(SIGMA, tension_N=0.05)
    plan = planned(robot, data, sigma, Reads.of_kinds(robot.n_cables, READ))
    return next(e.plan for e in extensions(plan) if e.kind is Adding.LATER)


def test_an_hour_later_is_on_the_clock_of_each_file(robot, few):
    """What creeps in one file knows nothing of the other's hours."""
    days = [replace(few, path=Path(f"{day}.csv")) for day in ("monday", "tuesday")]
    both = _later(robot, together(days))
    assert both.problem.use.sum() == sum(day.n_rows for day in days)
    creep = signals(both)[0]["creep"].columns
    alone = np.concatenate([signals(_later(robot, day))[0]["creep"].columns for day in days])
    assert np.abs(creep).max() > 1e-3
    assert creep == pytest.approx(alone, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("name", ["demobot_cogiro", "planar_vertical"])
def test_poses_to_add_are_in_the_box(name):
    """They had been proposed below the floor."""
    robot = load_robot(model_path(name))
    poses = np.tile(robot.reference_pose, (6, 1))
    poses[:, 0] += np.linspace(-0.05, 0.05, 6)
    plan = make_plan(robot, poses, SIGMA).planned
    free, home = more_poses(plan).poses[:, :3], robot.reference_pose[:3]
    box = np.array([home - [0.03, 0.1, 0.0], home + np.array([0.06, 0.1, 0.05])])
    (one,) = (o for o in extensions(plan, Room.of(robot, box=box)) if o.kind is Adding.POSES)
    there = one.poses[:, :3]
    assert np.all((there >= box[0] - 1e-12) & (there <= box[1] + 1e-12)) and len(there) > 5
    assert np.any((free < box[0]) | (free > box[1]))


def test_beside_what_is_planned_the_whole_box_is_used():
    """The grid had been on one of its faces, each pose many times."""
    robot = load_robot(model_path("demobot_cogiro"))
    poses = np.tile(robot.reference_pose, (6, 1))
    poses[:, 0] += np.linspace(-0.02, 0.02, 6)
    home = robot.reference_pose[:3]
    box = home + np.array([[0.1, -0.05, -0.02], [0.2, 0.05, 0.03]])
    there = more_poses(make_plan(robot, poses, SIGMA).planned, Room.of(robot, box=box)).poses
    assert np.ptp(there[:, 0]) > 0.05 and len(np.unique(there, axis=0)) == len(there)


def test_poses_to_add_are_listed_where_they_are_said_to_be(robot, commands):
    plan = make_plan(robot, commands.rows(np.arange(10)), SIGMA)
    listed = [item for item in plan.suggestions if item.poses is not None and item.reached]
    for item in listed:
        lines = str(plan).splitlines()
        at = lines.index(f"add: {item.words}")
        assert "listed below" in item.words and len(item.places) == len(item.poses)
        assert [line.strip() for line in lines[at + 1 : at + 1 + len(item.places)]] == [
            *item.places
        ]
    assert listed


@pytest.mark.parametrize("name", ["planar_vertical", "demobot_cogiro"])
def test_where_cables_are_to_pull_no_chosen_or_proposed_pose_leaves_one_slack(name: str) -> None:
    """Half of them did: tensions could hold the platform there, commanded lengths did not."""
    robot = load_robot(model_path(name))
    chosen = choose_poses(robot, 20, limits=(0.01, np.inf))
    found = make_plan(robot, chosen.rows(np.arange(6)), limits=(0.01, np.inf))
    poses = next(s for s in found.suggestions if s.kind == "poses")
    assert poses.commands is not None
    for commands in (chosen, poses.commands):
        assert not solve(robot, commands.command_pose).slack.any()
    assert found.loose == () and set(poses.slack) == {()}
    assert not any("slack" in text for text in (*found.notes, *poses.places))


def test_where_cables_are_slack_is_said_if_there_are_no_other_poses() -> None:
    robot = load_robot(model_path("planar_vertical"))
    high = np.tile(robot.reference_pose, (8, 1))
    high[:, 0] += np.linspace(-0.1, 0.1, 8)
    high[4:, 2] = robot.exit_points[:, 2].max() - 0.03
    found = make_plan(robot, high)
    slack = solve(robot, high).slack
    names = np.array(robot.cable_names)
    rows = np.flatnonzero(slack.any(axis=1))
    assert 0 < len(rows) < 8
    lines = tuple((int(k) + 2, tuple(names[slack[k]].tolist())) for k in rows)
    assert found.loose == lines
    said = (
        f"cables are slack at {len(rows)} of 8 poses: line {lines[0][0]} ({' '.join(lines[0][1])})"
    )
    assert said in " ".join(found.notes)
    assert found.as_json()["slack"][0] == {"line": lines[0][0], "cables": list(lines[0][1])}
    loose, good = slack.any(axis=1), np.ones(8, dtype=bool)
    usual = usual_tension(found.planned)

    def may_run(limits: object, enough: int) -> list[bool]:
        room = Room.of(robot, limits=limits).around(found.planned.base.prediction.pose)
        return room.may_run(found.planned, good, usual, enough).tolist()

    # those with slack cables only where there are not enough others, or if they may be
    taut = solve(robot, high).tensions.min(axis=1) >= 0.1 * usual
    assert may_run((None, np.inf), int(taut.sum())) == taut.tolist() != (~loose).tolist()
    assert all(may_run((None, np.inf), 9)) and all(may_run((0.0, np.inf), 1))
    assert may_run((0.1, np.inf), 9) == (~loose).tolist()
