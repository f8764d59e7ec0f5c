"""Predictions: warm starts, unsolved rows and readings."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from effect_cases import KINDS, experiment_of, random_effect

import seecr
from seecr import Commands, Term, correct, load_robot, placed, tracked
from seecr.cli import main
from seecr.compiled.columns import NO_LENGTH, STALLED
from seecr.description.joints import off_joints
from seecr.effects.base import unfed
from seecr.pose import pose_difference, quat_rotate
from seecr.prediction.sensitivity import length_sensitivities, readings_difference
from seecr.statics import batch

FAMILIES = [
    ("stiffness", "pulley_radius"),
    ("cable_weight", "tracker_frame"),
    ("anchor_point_error", "external_wrench", "drum_gain"),
]


@pytest.mark.parametrize("kind", KINDS)
def test_without_effects_it_is_the_papers_robot(kind: str) -> None:
    experiment = experiment_of(kind)
    found = experiment.predict()
    commands = experiment.commands
    own = seecr.solve(experiment.robot, commands.pose, rest_lengths=commands.lengths)
    assert np.all(found.solved) and not found.has_history
    assert np.array_equal(found.readings.position, own.pose[:, :3])
    assert np.array_equal(found.readings.tensions, own.tensions)
    assert np.array_equal(found.solution().pose, own.pose)


@pytest.mark.parametrize("kind", ["demobot_cogiro", "demobot_parallel", "jointed"])
@pytest.mark.parametrize("names", FAMILIES)
def test_a_warm_start_ends_where_a_cold_one_does(kind: str, names: tuple[str, ...]) -> None:
    experiment = experiment_of(kind, seed=5)
    effects = [random_effect(experiment, name) for name in names]
    near = experiment.predict([random_effect(experiment, name, part=0.2) for name in names])
    cold, warm = experiment.predict(effects), experiment.predict(effects, near)
    assert np.all(cold.solved) and np.all(warm.solved)
    assert np.abs(readings_difference(warm.readings, cold.readings)).max() < 1e-9
    assert warm.found.count.sum() < cold.found.count.sum()


def test_a_warm_start_from_a_lost_row_starts_that_row_afresh() -> None:
    experiment = experiment_of("demobot_cogiro")
    near = experiment.predict()
    near.found.deviation[2, :3] += 50.0
    again = experiment.predict([], near)
    assert np.all(again.solved)
    cold = experiment.predict()
    assert np.abs(readings_difference(again.readings, cold.readings)).max() < 1e-9


def test_a_prediction_with_history_is_no_start_for_one_without() -> None:
    experiment = experiment_of("demobot_cogiro")
    walked = experiment.predict([random_effect(experiment, "backlash")])
    assert walked.has_history
    cold, warm = experiment.predict(), experiment.predict([], walked)
    assert np.array_equal(warm.readings.position, cold.readings.position)


def weightless_lift() -> seecr.Robot:
    """A platform between two cables, one up and one down, and no gravity."""
    return seecr.Robot(
        "lift", np.array([[0.0, 0, 1], [0, 0, -1]]), np.zeros((2, 3)), np.full(2, 1000.0),
        np.full(2, 0.95), 2.0, gravity=np.zeros(3),
        joints=(seecr.Joint("slide", "z", np.array([0.0, 0, 1]), np.zeros(3)),),
    )  # fmt: skip


def test_rows_that_are_not_solved_are_flagged_and_the_others_stand() -> None:
    robot = weightless_lift()
    lengths = np.array([[0.95, 0.95], [1.5, 1.5], [0.9, 1.0]])  # the second: both slack
    experiment = seecr.Experiment(
        robot, seecr.Commands(np.tile(robot.reference_pose, (3, 1)), lengths=lengths)
    )
    found = experiment.predict()
    assert found.solved.tolist() == [True, False, True]
    assert found.singular.tolist() == [False, True, False]
    assert list(found.solution().status) == [
        seecr.Status.CONVERGED, seecr.Status.SINGULAR, seecr.Status.CONVERGED,
    ]  # fmt: skip
    # length l pulls with E S (L/l - 1): 0.9 (1 + z) = 1.0 (1 - z) at balance
    assert found.readings.position[:, 2][[0, 2]] == pytest.approx([0.0, 0.1 / 1.9], abs=1e-12)


def test_rows_of_a_prediction_are_exchanged_for_those_with_other_length_errors() -> None:
    plain = experiment_of("demobot_cogiro")
    random, rows = np.random.default_rng(0), np.arange(6) % 2 == 1
    one, two = 1e-3 * random.standard_normal((2, 6, plain.robot.n_cables))
    effects = [seecr.effect_named("pulley_radius")(radius=0.01)]
    first, second, mixed = (
        plain.with_length_errors(errors) for errors in (one, two, np.where(rows[:, None], two, one))
    )
    a, b, wanted = (e.predict(effects) for e in (first, second, mixed))
    length_sensitivities(a), length_sensitivities(b)
    got = a.with_rows(b, rows)
    assert got.readings.position == pytest.approx(wanted.readings.position, abs=1e-10)
    assert got.tensions == pytest.approx(wanted.tensions, abs=1e-5)
    assert got.pose == pytest.approx(wanted.pose, abs=1e-10)
    assert np.array_equal(got.tables.cables, wanted.tables.cables)
    assert np.array_equal(got.setup.rest_lengths(), wanted.setup.rest_lengths())
    # what was computed already goes with its row
    rates = length_sensitivities(wanted)
    assert length_sensitivities(got) == pytest.approx(
        rates, rel=1e-6, abs=1e-6 * np.abs(rates).max()
    )


def test_readings_belong_to_the_prediction_alone() -> None:
    experiment = experiment_of("demobot_cogiro")
    found = experiment.predict()
    before = found.pose.copy()
    found.readings.position[:] = 0.0
    found.readings.tensions[:] = 0.0
    assert np.array_equal(found.pose, before) and found.tensions.max() > 0.1


def test_a_row_without_lengths_is_named() -> None:
    given = experiment_of("demobot_cogiro").commands
    robot = seecr.load_robot("demobot_cogiro")
    lengths = robot.commanded_lengths(given.pose)
    lengths[1, 3] = np.inf
    with pytest.raises(
        seecr.InputError, match=r"^pose 1 of the commands: expected finite .* got inf; "
    ):
        seecr.predict(robot, seecr.Commands(given.pose, lengths, told=True))


def test_temperature_of_one_run_does_not_reach_another() -> None:
    experiment = experiment_of("demobot_cogiro")
    commands = experiment.commands
    assert commands.temperature is not None
    warm = seecr.effect_named("thermal_expansion")(expansion=1e-4, zero_temperature=20.0)
    whole = experiment.predict([warm]).readings.position
    one = seecr.Commands(commands.pose[3:], temperature=commands.temperature[3:])
    part = seecr.Experiment(experiment.robot, one).predict([warm]).readings.position
    assert part == pytest.approx(whole[3:], abs=1e-12)


def test_of_a_prediction_nearby_only_lengths_are_put_anew() -> None:
    """And of one with another model nothing is kept."""
    experiment = experiment_of("demobot_cogiro", seed=3)
    n, m = len(experiment.commands), experiment.robot.n_cables
    pulleys = seecr.effect_named("pulley_radius")(radius=0.01)
    at = experiment.predict([pulleys])
    errors = 1e-4 * np.random.default_rng(3).standard_normal((n, m))
    other = experiment.with_length_errors(errors)
    for effects in ([pulleys], [], [pulleys, seecr.effect_named("stiffness")(factor=1.2)]):
        near, afresh = other.predict(effects, at), other.predict(effects)
        for name in ("cables", "load", "poses", "scale", "reach"):
            assert np.array_equal(getattr(near.tables, name), getattr(afresh.tables, name)), name
        assert near.pose == pytest.approx(afresh.pose, abs=1e-9)
        assert not np.array_equal(near.tables.cables, at.tables.cables)


def test_where_nothing_holds_a_few_rows_are_tried_and_no_more() -> None:
    """Each would take the solver to its limit: a fit that went too far cost minutes."""
    robot = seecr.load_robot("demobot_cogiro")
    experiment = seecr.Experiment(robot, seecr.Commands(np.tile(robot.reference_pose, (60, 1))))
    near, pull = experiment.predict(), np.array([1e9, 0.0, 0.0])
    lost = experiment.predict([seecr.effect_named("external_wrench")(pull, 0.0 * pull)], near)
    tried = np.any(lost.found.deviation != near.found.deviation, axis=1)
    assert not lost.solved.any() and 0 < tried.sum() <= 4


def test_a_lost_waypoint_spoils_the_rows_after_it_in_its_run_alone(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """What a row remembers is worth nothing if the way to it is not known."""
    experiment = experiment_of("demobot_cogiro")
    path, walk = experiment.path, batch.walk

    def lose_one(*args: Any) -> batch.Evaluation:
        found = walk(*args)
        found.outcome[path.rows[1] - 1] = STALLED  # on the way to the second row
        return found

    monkeypatch.setattr(batch, "walk", lose_one)
    found = experiment.predict([seecr.effect_named("backlash")(gap=1e-3)])
    assert found.solved.tolist() == [True, False, False, True, True, True]


def test_what_leaves_a_cable_no_length_has_no_prediction():
    """The offset is shorter than the first two rows' cable, and longer than that of the others."""
    robot = seecr.load_robot("demobot_parallel")
    part = np.array([1.0, 1.0, 0.4, 0.4])[:, None]
    lengths = np.tile(robot.rest_lengths, (4, 1)) * part
    commands = seecr.Commands(np.tile(robot.reference_pose, (4, 1)), lengths=lengths)
    half = 0.5 * robot.rest_lengths[0]
    found = seecr.predict(
        robot, commands, [seecr.Term.of(robot, "cable_length_offset", offset_1_m=-half)]
    )
    assert found.solved.tolist() == [True, True, False, False]
    assert set(found.found.outcome[2:].tolist()) == {NO_LENGTH}


def test_a_cable_shorter_than_any_is_no_cable():
    """Strains of 1e300 overflowed, and NumPy warned the user, which tests take for an error."""
    robot = seecr.load_robot("demobot_parallel")
    lengths = np.tile(robot.rest_lengths, (2, 1))
    lengths[0, 3], lengths[1] = 1e-300, 1e-300
    commands = seecr.Commands(np.tile(robot.reference_pose, (2, 1)), lengths=lengths)
    assert [s.name for s in seecr.solve(robot, commands).status] == ["NO_LENGTH"] * 2
    with pytest.raises(seecr.InputError, match=r"positive \[m\], and not below 1e-30 m"):
        seecr.solve(robot, rest_lengths=lengths)


# --- Effects that need times or temperatures which the commands do not have


ROBOT = seecr.load_robot("planar_vertical")
WARM = seecr.Term.of(ROBOT, "thermal_expansion", expansion_1_per_K=1e-4)
CREEP = seecr.Term.of(ROBOT, "creep", amount=0.1, time_s=10.0)


def test_what_is_left_out_is_told_with_what_it_needs() -> None:
    found = seecr.predict(ROBOT, ROBOT.reference_pose, [WARM, CREEP])
    assert [note.split(" is left out")[0] for note in found.notes] == ["thermal_expansion", "creep"]
    assert "column temperature_C" in found.notes[0] and "column t_s" in found.notes[1]
    assert found.as_json()["notes"] == found.notes and str(found).endswith(found.notes[1])


def test_nothing_is_told_of_what_acts_or_is_absent() -> None:
    poses = np.tile(ROBOT.reference_pose, (2, 1))
    fed = seecr.Commands(poses, time=np.array([0.0, 9.0]), temperature=np.array([20.0, 25.0]))
    assert unfed([WARM.effect(), CREEP.effect()], fed) == ()
    none = seecr.Term.of(ROBOT, "thermal_expansion", expansion_1_per_K=0.0)
    assert seecr.predict(ROBOT, poses, [none]).notes == ()


def test_commands_say_it_and_write_it(tmp_path: Path) -> None:
    model, at = tmp_path / "m.toml", [str(value) for value in ROBOT.reference_pose[:3]]
    text = 'format = 1\n[robot]\nname = "planar_vertical"\n[[effect]]\nname = "thermal_expansion"\n'
    values = "expansion_1_per_K = { value = 1e-4 }\nzero_temperature_C = { value = 20.0 }\n"
    model.write_text(f"{text}[effect.parameters]\n{values}", encoding="utf-8")
    with_it = ["planar_vertical", "--model", str(model), "--json"]
    pose = CliRunner().invoke(main, ["pose", *with_it, *at])
    out = ["--out", str(tmp_path / "s"), "--no-recording", "--figure", "none"]
    sweep = CliRunner().invoke(main, ["sweep", *with_it, "--line", *at, *at, *out])
    for result in (pose, sweep):
        assert result.exit_code == 0, result.output
        notes = json.loads(result.output)["notes"]
        assert any(note.startswith("thermal_expansion is left out") for note in notes)


# --- What a model's tracker reads, and where a platform has to be for it to read that


NAME = "demobot_cogiro"


def text_of(*terms: Term) -> str:
    """A model's file."""
    lines = ["format = 1"]
    for term in terms:
        lines += ["[[effect]]", f'name = "{term.name}"', "[effect.parameters]"]
        values = zip(term.layout.names, term.vector, strict=True)
        lines += [f"{name} = {{ value = {float(value)!r} }}" for name, value in values]
    return "\n".join(lines) + "\n"


def test_a_platform_is_placed_where_its_tracker_reads_what_is_wanted() -> None:
    robot = load_robot(NAME)
    target = Term.of(robot, "tracker_target", shift_z_m=0.05)
    frame = Term.of(robot, "tracker_frame", shift_x_m=0.002, rotation_z_rad=0.01)
    wanted = Commands(np.tile(robot.reference_pose, (3, 1)) + 0.01 * np.eye(3, 7))
    alone = tracked(robot, wanted, [target])
    up = wanted.pose[:, :3] + quat_rotate(wanted.pose[:, 3:], np.array([0.0, 0.0, 0.05]))
    np.testing.assert_allclose(alone[:, :3], up, atol=1e-12)
    assert (tracked(robot, wanted.pose, [target]) == alone).all()  # poses alone will do
    at = placed(robot, wanted, [target, frame])
    np.testing.assert_allclose(tracked(robot, at, [target, frame]), wanted.pose, atol=1e-11)
    assert np.abs(at.pose - wanted.pose).max() > 0.04
    found = correct(robot, at, effects=[target, frame])
    read = tracked(robot, Commands(found.solution.pose), [target, frame])
    assert found.reached.all() and np.abs(read - wanted.pose).max() < 1e-9


def test_on_joints_readings_are_as_near_as_these_allow(tmp_path: Path) -> None:
    """A tracker that stands a little askew reads no planar robot in its plane: it was refused."""
    robot = load_robot("planar_vertical")
    frame = Term.of(robot, "tracker_frame", shift_x_m=0.002, rotation_x_rad=0.001)
    target = Term.of(robot, "tracker_target", shift_z_m=0.05)
    poses = np.tile(robot.reference_pose, (3, 1))
    poses[:, [0, 2]] += 0.01 * np.eye(3, 2)
    wanted = Commands(poses)
    at = placed(robot, wanted, [frame, target])
    assert off_joints(robot, at.pose) is None
    missed = pose_difference(wanted.pose, tracked(robot, at, [frame, target]))
    across = np.array([False, True, False, True, False, True])
    assert np.abs(missed[:, ~across]).max() < 1e-5 < np.abs(missed[:, across]).max() < 2e-3
    file, model = tmp_path / "wanted.csv", tmp_path / "model.toml"
    file.write_text("cmd_x_m,cmd_z_m\n0.4,0.15\n")
    model.write_text(text_of(frame, target))
    args = ["correct", "planar_vertical", str(file), "--out", str(tmp_path / "out"), "--as-read"]
    told = CliRunner().invoke(main, [*args, "--model", str(model)])
    assert told.exit_code == 0, told.output
    assert "the joints allow readings no nearer than 0.1" in told.output
    assert " mm and 0.0573 deg along single axes" in told.output


def test_the_command_tells_of_the_tracker(tmp_path: Path) -> None:
    poses, model = tmp_path / "wanted.csv", tmp_path / "model.toml"
    poses.write_text("cmd_x_m,cmd_y_m,cmd_z_m\n0.4,0.25,0.2\n0.45,0.25,0.2\n")
    robot = load_robot(NAME)
    frame = Term.of(robot, "tracker_frame", shift_x_m=0.002)
    model.write_text(text_of(frame, Term.of(robot, "tracker_target", shift_z_m=0.05)))
    args = ["correct", NAME, str(poses), "--out", str(tmp_path / "out")]
    told = CliRunner().invoke(main, [*args, "--model", str(model)])
    assert told.exit_code == 0, told.output
    assert "the model's tracker reads these poses up to 50 mm off" in told.output
    read = CliRunner().invoke(main, [*args, "--model", str(model), "--as-read", "--json"])
    rows = json.loads(read.stdout)["rows"]
    assert read.exit_code == 0 and rows[0]["wanted"][2] == pytest.approx(0.15, abs=1e-3)
    none = CliRunner().invoke(main, [*args, "--as-read"])
    assert none.exit_code == 2 and "expected --model M.toml" in none.output
