"""Effects with values of their own for each file or run, solved part by part."""

from __future__ import annotations

import numpy as np
from made_data import soft_cogiro, term

from seecr import Commands, Experiment, Term, Terms, sensitivities
from seecr.effects import Own, apart
from seecr.prediction.parted import Parted, rates

ROBOT = soft_cogiro()
POSES = np.tile(ROBOT.reference_pose, (6, 1)) + np.linspace(-0.05, 0.05, 6)[:, None] * np.array(
    [1.0, 0.6, 0.2, 0, 0, 0, 0]
)
FILES = np.array(["a", "b", "a", "c", "b", "a"])


def commands(**options):
    run = np.unique(FILES, return_inverse=True)[1]
    return Commands(POSES, run=run, parts={"file": FILES}, **options)


def own(name, *, of=("a", "b"), **values):
    """An effect with a value in files a and b, and none anywhere else."""
    base = [term(ROBOT, name, **{k: v[i] for k, v in values.items()}) for i in range(len(of))]
    layout = apart(base[0].layout, "file", of, base[0].layout.null)
    return Term(layout, np.concatenate([one.vector for one in base]))


def both():
    return Terms(
        [
            own("tracker_frame", shift_x_m=[0.01, -0.02], rotation_z_rad=[0.1, 1.0]),
            own("initial_pose_error", position_x_m=[0.004, -0.003]),
            term(ROBOT, "pulley_radius", radius_m=0.008),
        ]
    )


def of_file(name):
    """The same model as plain effects, in one of the files."""
    place = {"a": 0, "b": 1}.get(name)
    out = [term(ROBOT, "pulley_radius", radius_m=0.008)]
    if place is not None:
        shift, turn, offset = [0.01, -0.02][place], [0.1, 1.0][place], [0.004, -0.003][place]
        out += [
            term(ROBOT, "tracker_frame", shift_x_m=shift, rotation_z_rad=turn),
            term(ROBOT, "initial_pose_error", position_x_m=offset),
        ]
    return Terms(out)


def test_each_file_is_predicted_as_if_alone():
    found = Parted(ROBOT, commands()).predict(both().effects)
    assert found.solved.all() and len(found.parts) == 3
    for name in "abc":
        rows = name == FILES
        alone = Experiment(ROBOT, Commands(POSES[rows])).predict(of_file(name).effects)
        np.testing.assert_allclose(
            found.readings.position[rows], alone.readings.position, atol=1e-12
        )
        np.testing.assert_allclose(found.tensions[rows], alone.tensions, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(found.pose[rows], alone.pose, atol=1e-12)


def test_a_tracker_reads_the_poses_of_each_file_in_its_own_frame():
    experiment, effects = Parted(ROBOT, commands()), both().effects
    found = experiment.predict(effects)
    read = experiment.readings_at(effects, found.pose)
    np.testing.assert_allclose(read.position, found.readings.position, atol=1e-15)
    np.testing.assert_allclose(read.quat_wxyz, found.readings.quat_wxyz, atol=1e-15)


def test_derivatives_are_those_of_each_file_alone_and_none_elsewhere():
    experiment, terms = Parted(ROBOT, commands()), both()
    found = rates(experiment, terms, experiment.predict(terms.effects))
    for name in "abc":
        rows, plain = name == FILES, of_file(name)
        alone = Experiment(ROBOT, Commands(POSES[rows]))
        expected = sensitivities(alone, plain, alone.predict(plain.effects))
        for term_of in terms:
            layout, mine = term_of.layout, found[rows][..., terms.part(term_of.name)]
            if term_of.name == "pulley_radius":
                np.testing.assert_allclose(
                    mine, expected[..., plain.part("pulley_radius")], rtol=1e-6
                )
                continue
            for part in layout.parts:
                here = mine[..., layout.part(part)]
                if part == name:
                    there = expected[..., plain.part(term_of.name)]
                    np.testing.assert_allclose(here, there, rtol=1e-6, atol=1e-9)
                else:
                    assert not here.any()


def test_some_columns_and_length_errors_and_warm_starts_go_by_part():
    errors = np.random.default_rng(1).normal(0.0, 1e-4, (6, 8))
    experiment, terms = Parted(ROBOT, commands()).with_length_errors(errors), both()
    cold = experiment.predict(terms.effects)
    warm = experiment.predict(terms.effects, cold)
    np.testing.assert_allclose(warm.pose, cold.pose, atol=1e-10)
    alone = Experiment(ROBOT, Commands(POSES[FILES == "b"]), errors[FILES == "b"])
    np.testing.assert_allclose(
        cold.pose[FILES == "b"], alone.predict(of_file("b").effects).pose, atol=1e-12
    )
    every = rates(experiment, terms, cold)
    np.testing.assert_array_equal(rates(experiment, terms, cold, [7, 2]), every[..., [7, 2]])


def test_what_was_found_of_other_parts_is_no_help_though_there_are_as_many():
    """Two files and two runs: the first row of a run is not that of the file."""
    run = np.array([0, 0, 0, 1, 1, 1])
    parts = {"file": np.where(run == 0, "a", "b"), "run": np.array(["1", "2", "1", "2", "1", "2"])}
    experiment = Parted(ROBOT, Commands(POSES, run=run, parts=parts))
    base = [term(ROBOT, "initial_pose_error", position_x_m=x) for x in (0.004, -0.003)]

    def placed(kind, names):
        layout = apart(base[0].layout, kind, names, base[0].layout.null)
        return Terms([Term(layout, np.concatenate([one.vector for one in base]))])

    by_file, by_run = placed("file", ("a", "b")), placed("run", ("1", "2"))
    other = experiment.predict(by_run.effects)
    wanted = experiment.predict(by_file.effects)
    got = experiment.predict(by_file.effects, other)
    np.testing.assert_allclose(got.pose, wanted.pose, atol=1e-12)
    np.testing.assert_allclose(
        rates(experiment, by_file, other), rates(experiment, by_file, wanted), atol=1e-9
    )


def test_rows_are_exchanged_in_each_part():
    plain, effects = Parted(ROBOT, commands()), both().effects
    errors, rows = 1e-4 * np.random.default_rng(1).standard_normal((2, 6, 8)), np.arange(6) > 2
    one, two = (plain.with_length_errors(e).predict(effects) for e in errors)
    mixed = plain.with_length_errors(np.where(rows[:, None], errors[1], errors[0]))
    got, wanted = one.with_rows(two, rows), mixed.predict(effects)
    np.testing.assert_allclose(got.readings.position, wanted.readings.position, atol=1e-10)
    for mine, theirs in zip(got.parts, wanted.parts, strict=True):
        np.testing.assert_allclose(mine.pose, theirs.pose, atol=1e-10)
        assert np.array_equal(mine.tables.cables, theirs.tables.cables)


def test_rows_that_nobody_takes_apart_have_what_is_usual():
    usual = term(ROBOT, "platform_mass", added_kg=0.1)
    layout = apart(usual.layout, "file", ("a",), usual.vector)
    here = Term(layout, 3.0 * usual.vector)
    plain = Experiment(ROBOT, Commands(POSES)).predict([usual.effect()])
    for experiment in (Experiment(ROBOT, commands()), Parted(ROBOT, Commands(POSES))):
        found = experiment.predict([here.effect()])
        np.testing.assert_allclose(found.pose, plain.pose, atol=1e-12)
    found = Parted(ROBOT, commands()).predict([here.effect()])
    other = FILES != "a"
    np.testing.assert_allclose(found.pose[other], plain.pose[other], atol=1e-12)
    assert np.all(found.pose[~other, 2] < plain.pose[~other, 2] - 1e-6)


def test_history_stays_within_its_file():
    friction = Terms(
        [term(ROBOT, "hysteresis", amplitude_N=0.05), own("tracker_frame", shift_x_m=[0.01, 0.02])]
    )
    found = Parted(ROBOT, commands()).predict(friction.effects)
    rows = FILES == "a"
    alone = Experiment(ROBOT, Commands(POSES[rows])).predict(friction.only(["hysteresis"]).effects)
    assert found.has_history
    needed = Parted(ROBOT, commands()).predict(friction.effects, needed=FILES != "c")
    np.testing.assert_array_equal(needed.pose, found.pose)
    np.testing.assert_allclose(found.pose[rows], alone.pose, atol=1e-12)


def test_a_term_says_where_its_values_come_from_and_what_is_impossible_is_seen():
    heavy = own("platform_mass", added_kg=[0.1, -5.0])
    assert not heavy.is_possible(ROBOT)
    assert own("platform_mass", added_kg=[0.1, 0.2]).is_possible(ROBOT)
    assert heavy.layout.names == ("a: added_kg", "b: added_kg")
    assert Term(heavy.layout, heavy.vector, own=Own("file", {})).with_vector(heavy.vector).own
