"""What changes with the place: as linear algebra has it, and as robots do it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_data import COGIRO, measured, term

from crosscheck.calibration.joint_fit.joint import JointFit, Setting, settle
from crosscheck.calibration.linear_evidence.priors import widths_of
from crosscheck.calibration.noise.colour import WHITE, chain_of
from crosscheck.calibration.unknown.varying import SMOOTH, Varying, varying, varying_in_time
from crosscheck.calibration.unknown.varying.anywhere import _by_others
from crosscheck.fit.least_squares.state import evaluate
from crosscheck.fit.preparation.prepare import prepare
from seecr.commands.loads import Loads
from seecr.description.mjcf import load_robot
from seecr.effects import Terms
from seecr.pose import Array

ROBOT = load_robot(COGIRO)
# What is moved so little moves linearly.
LITTLE = 1e-6


@pytest.fixture(scope="module")
def fit() -> tuple[Setting, JointFit]:
    some = [term(ROBOT, "tracker_scale", factor=1.002)]
    problem = prepare(ROBOT, measured(ROBOT, some, points=4), Terms()).problem
    factor = problem.noise(problem.experiment.predict(()))
    setting = Setting(problem, factor, chain_of(problem))
    state = evaluate(problem, Terms(some), factor)
    return setting, settle(setting, state, widths_of(Terms(some)), WHITE)


def moved(setting: Setting, joint: JointFit, **changed: object) -> Array:
    """(N,) by how much readings change, in units of their noise, where commands are others."""
    problem, terms = setting.problem, joint.terms
    other = replace(problem.experiment.commands, **changed)
    there = replace(problem.experiment, commands=other).predict(terms.effects)
    here = problem.experiment.predict(terms.effects)
    white = [problem.whiten(setting.factor, problem.residuals(p.readings)) for p in (there, here)]
    return np.asarray(white[1] - white[0])


def lengthened(setting: Setting, joint: JointFit, more: Array) -> Array:
    """(N,) by how much readings change, in units of their noise, with longer cables (n, m) [m]."""
    return moved(setting, joint, lengths=joint.state.prediction.setup.rest_lengths() + more)


def unexplained(columns: Array, signal: Array) -> float:
    """The part of a signal that columns cannot explain."""
    solved = np.linalg.lstsq(columns, signal, rcond=None)[0]
    return float(np.linalg.norm(signal - columns @ solved) / np.linalg.norm(signal))


def rough(setting: Setting, joint: JointFit) -> dict[Varying, Array]:
    """What may change, of each the first: cubics whose degrees are all as large."""
    return dict(reversed(varying(setting, joint)))


def test_a_spring_is_among_what_changes(fit: tuple[Setting, JointFit]) -> None:
    setting, joint = fit
    place = joint.state.prediction.pose[:, :3]
    pull = -LITTLE * ROBOT.weight / ROBOT.length * (place - np.array([0.1, 0.2, 0.3]))
    loads = Loads.of(len(place), wrench=np.hstack([pull, 0.0 * pull]))
    signal = moved(setting, joint, loads=loads)
    kinds = rough(setting, joint)
    assert unexplained(kinds[Varying.SPRING], signal) < 1e-3
    assert unexplained(kinds[Varying.FORCE], signal) < 1e-3
    assert unexplained(kinds[Varying.POSITION], signal) > 0.1
    # one that pulls along x only is a force, and no such spring
    pull[:, 1:] = 0.0
    loads = Loads.of(len(place), wrench=np.hstack([pull, 0.0 * pull]))
    signal = moved(setting, joint, loads=loads)
    assert unexplained(kinds[Varying.FORCE], signal) < 1e-3
    assert unexplained(kinds[Varying.SPRING], signal) > 0.05


def test_a_tracker_that_moves_shows_over_the_session(fit: tuple[Setting, JointFit]) -> None:
    setting, joint = fit
    problem = setting.problem
    walk = np.linspace(0.0, 1.0, problem.data.n_rows)

    def told(moved: Array, t_s: Array | None) -> tuple[dict[str, Array], Array]:
        """What may change, and a tracker that moved so far along y, in units of the noise."""
        read = np.zeros(problem.measured.shape)
        read[:, 1] = 1e-3 * moved
        timed = replace(problem, data=replace(problem.data, t_s=t_s))
        signal = problem.whiten(setting.factor, read)
        return rough(replace(setting, problem=timed), joint), signal

    rows, signal = told(walk**2, None)
    assert (
        unexplained(rows[Varying.SESSION], signal)
        < 1e-9
        < 0.05
        < unexplained(rows[Varying.POSITION], signal)
    )
    # a clock counts, if it goes on through all runs
    late, signal = told(walk**6, walk**2)
    assert (
        unexplained(late[Varying.SESSION], signal)
        < 1e-9
        < 1e-3
        < unexplained(rows[Varying.SESSION], signal)
    )
    again, _ = told(walk, walk[::-1])
    assert np.array_equal(again[Varying.SESSION], rows[Varying.SESSION])


def test_what_changes_from_run_to_run_is_an_offset_of_each() -> None:
    robot = load_robot(COGIRO)
    problem = prepare(robot, measured(robot, points=6), Terms()).problem
    setting = Setting(problem, problem.noise(problem.experiment.predict(())), chain_of(problem))
    terms = Terms([term(robot, "tracker_scale", factor=1.0)])
    joint = settle(setting, evaluate(problem, terms, setting.factor), widths_of(terms), WHITE)
    run = problem.data.run_index
    kinds = dict(varying_in_time(setting, joint))
    offsets = np.random.default_rng(0).standard_normal((run.max() + 1, robot.n_cables))
    signal = lengthened(setting, joint, LITTLE * offsets[run])
    assert unexplained(kinds[Varying.LENGTHS_BY_RUN], signal) < 1e-3
    assert unexplained(kinds[Varying.POSITION_BY_RUN], signal) > 0.1
    read = np.zeros(problem.measured.shape)
    read[:, :3] = 1e-3 * offsets[run][:, :3]
    signal = problem.whiten(setting.factor, read)
    assert unexplained(kinds[Varying.POSITION_BY_RUN], signal) < 1e-9
    assert unexplained(kinds[Varying.LENGTHS_BY_RUN], signal) > 0.1


def test_no_reading_lags_behind_another_run(fit: tuple[Setting, JointFit]) -> None:
    setting, joint = fit
    lag = rough(setting, joint)[Varying.LAG][:, 0]
    run = setting.problem.data.run_index
    first = np.append(True, run[1:] != run[:-1])[setting.problem.row_of]
    assert first.any() and np.all(lag[first] == 0.0)
    assert np.mean(lag[~first] != 0.0) > 0.5


def test_short_runs_and_many_have_no_offsets_of_their_own() -> None:
    robot = load_robot(COGIRO)
    problem = prepare(robot, measured(robot, points=18), Terms()).problem
    terms = Terms([term(robot, "tracker_scale", factor=1.0)])
    setting = Setting(problem, problem.noise(problem.experiment.predict(())), chain_of(problem))
    joint = settle(setting, evaluate(problem, terms, setting.factor), widths_of(terms), WHITE)
    by_run = {Varying.POSITION_BY_RUN, Varying.LENGTHS_BY_RUN}

    def told(rows_a_run: int) -> bool:
        run = np.array([f"{k // rows_a_run}" for k in range(problem.data.n_rows)])
        anew = replace(problem, data=replace(problem.data, run=run))
        return by_run <= dict(varying_in_time(replace(setting, problem=anew), joint)).keys()

    # 144 rows: 18 runs, 24 runs, and one
    assert problem.data.n_rows == 144
    assert told(8) and not told(6) and not told(144)


def test_exit_points_that_move_move_the_platform_as_they_do_at_each_place(
    fit: tuple[Setting, JointFit],
) -> None:
    setting, joint = fit
    problem, effects = setting.problem, joint.terms.effects
    assert problem.data.t_s is not None
    time = problem.data.t_s / problem.data.t_s.max()
    there = term(ROBOT, "exit_point_error", **{"error_2_z_m": LITTLE}).effect()
    far = problem.experiment.predict([*effects, there])
    here = problem.experiment.predict(effects)
    # so little that a row's reading goes with its own part of the way
    full = problem.residuals(here.readings) - problem.residuals(far.readings)
    signal = problem.whiten(setting.factor, full * time[:, None])
    kinds = rough(setting, joint)
    # beside exit points that are where they are all the time
    always = problem.whiten(setting.factor, full)[:, None]
    assert unexplained(np.hstack([kinds[Varying.EXIT_POINTS_MOVE], always]), signal) < 1e-3
    assert unexplained(kinds[Varying.SESSION], signal) > 0.05


def test_all_are_in_units_of_the_noise(fit: tuple[Setting, JointFit]) -> None:
    kinds = rough(*fit)
    # its runs are too short to have offsets of their own
    by_run = {Varying.POSITION_BY_RUN, Varying.LENGTHS_BY_RUN}
    assert set(kinds) == set(Varying) - {Varying.TENSION} - by_run
    for columns in kinds.values():
        size = np.sqrt(np.mean(np.sum(columns**2, axis=1)))
        assert 0.5 < size < 5.0


def test_all_but_what_is_everywhere_say_what_to_look_at() -> None:
    assert [what for what in Varying if not what.advice] == [Varying.READINGS]
    assert (
        len({what.advice for what in Varying}) == len(Varying) - 2
    )  # hoses; the tracker's picture


def test_rope_in_layers_shows_over_the_turns_of_the_winches(fit: tuple[Setting, JointFit]) -> None:
    setting, joint = fit
    change = joint.state.prediction.setup.commanded_change
    layers = LITTLE * (change**2 - 2.0 * change**3)
    alike, each = [c for what, c in varying(setting, joint) if what is Varying.WINCHES]
    assert alike.shape[1] == 3 and each.shape[1] == 3 * ROBOT.n_cables
    signal = lengthened(setting, joint, layers)
    assert unexplained(alike, signal) < 1e-3 and unexplained(each, signal) < 1e-3
    # of one winch alone
    signal = lengthened(setting, joint, layers * (np.arange(ROBOT.n_cables) == 2))
    assert unexplained(each, signal) < 1e-3 < 0.1 < unexplained(alike, signal)
    # or by how far another one turned
    signal = lengthened(setting, joint, layers[:, ::-1])
    assert unexplained(each, signal) > 0.05


def test_winches_that_turn_with_their_neighbours(fit: tuple[Setting, JointFit]) -> None:
    setting, joint = fit
    change = joint.state.prediction.setup.commanded_change
    alike, each = [c for what, c in varying(setting, joint) if what is Varying.COUPLED]
    assert alike.shape[1] == 2 and each.shape[1] == ROBOT.n_cables * (ROBOT.n_cables - 1)
    signal = lengthened(setting, joint, LITTLE * np.roll(change, 1, axis=1))
    assert unexplained(alike, signal) < 1e-3 and unexplained(each, signal) < 1e-3
    # with one that is no neighbour
    signal = lengthened(setting, joint, LITTLE * change[:, ::-1])
    assert unexplained(each, signal) < 1e-3 < 0.1 < unexplained(alike, signal)
    # by their own turning: drums that are all of another size
    assert unexplained(alike, lengthened(setting, joint, LITTLE * change)) > 0.05


@pytest.mark.parametrize(("cables", "neighbours"), [(1, 0), (2, 1), (3, 2), (8, 2)])
def test_a_winch_has_no_neighbour_twice(cables: int, neighbours: int) -> None:
    lengths, turned = np.random.default_rng(0).normal(size=(2, 80, cables))
    every = list(_by_others(lengths, turned))
    assert len(every) == (2 if neighbours else 0)
    for columns, count in zip(every, (neighbours, cables * (cables - 1)), strict=False):
        assert columns.shape[1] == np.linalg.matrix_rank(columns) == count


def test_a_cable_that_touches_an_edge_is_too_short_somewhere(fit: tuple[Setting, JointFit]) -> None:
    setting, joint = fit
    place = joint.state.prediction.pose[:, 0]
    by_cable = [c for what, c in varying(setting, joint) if what is Varying.ONE_CABLE]
    assert len(by_cable) == ROBOT.n_cables
    bent = np.zeros((len(place), ROBOT.n_cables))
    bent[:, 2] = LITTLE * np.maximum(place - np.median(place), 0.0) ** 2
    left = [unexplained(columns, lengthened(setting, joint, bent)) for columns in by_cable]
    assert left[2] < 0.25 and min(left[:2] + left[3:]) > 0.5
    # too short everywhere, it is a known offset
    bent[:, 2] = LITTLE
    assert unexplained(by_cable[2], lengthened(setting, joint, bent)) > 0.3


def test_a_lens_is_said_with_few_numbers(fit: tuple[Setting, JointFit]) -> None:
    """Wherever its middle is, if the picture widens little from there to here."""
    setting, joint = fit
    place = joint.state.prediction.pose[:, :3]
    ((what, few),) = (
        one
        for one in varying(setting, joint)
        if one[1].shape[1] == 16 and one[0] is Varying.POSITION
    )
    assert what is Varying.POSITION
    problem = setting.problem
    for aside in ([0.0, 0.0, 0.0], [0.7, -0.2, 1.5]):
        off = place - place.mean(axis=0) - aside
        bent = np.zeros(problem.measured.shape)
        bent[:, :3] = off * np.sum(off**2, axis=1, keepdims=True)
        assert unexplained(few, problem.whiten(setting.factor, bent)) < 1e-9
    # but no picture that is bent otherwise
    bent[:, :3] = off * off[:, :1] ** 2
    assert unexplained(few, problem.whiten(setting.factor, bent)) > 0.01


def test_smooth_fields_have_smaller_columns_the_higher_their_degree(
    fit: tuple[Setting, JointFit],
) -> None:
    kinds = varying(*fit)
    first, smooth = (
        np.linalg.norm(columns, axis=0).reshape(3, -1)
        for what, columns in kinds
        if what is Varying.POSITION and columns.shape[1] == 60
    )
    # constant, three linear, six quadratic and ten cubic monomials of each channel
    degree = np.repeat([0, 1, 2, 3], [1, 3, 6, 10])
    assert smooth == pytest.approx(first * SMOOTH**degree)
    # what changes all readings smoothly may be anything
    assert [what for what, _ in kinds].count(Varying.READINGS) == 1


def test_of_the_only_kind_that_was_read_smoothness_tells_nothing() -> None:
    robot = load_robot(COGIRO)
    data = replace(measured(robot, points=4), quat_wxyz=None)
    problem = prepare(robot, data, Terms()).problem
    factor = problem.noise(problem.experiment.predict(()))
    setting = Setting(problem, factor, chain_of(problem))
    terms = Terms([term(robot, "tracker_scale", factor=1.0)])
    joint = settle(setting, evaluate(problem, terms, factor), widths_of(terms), WHITE)
    kinds = [what for what, _ in varying(setting, joint)]
    # one cubic, and a lens
    assert kinds.count(Varying.POSITION) == 2 and Varying.READINGS not in kinds
