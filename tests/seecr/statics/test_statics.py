"""The batch calls on tables: what changes between tables, walks, slack, some rows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from effect_cases import experiment_of, lengthened

from seecr.commands import Commands, Path
from seecr.compiled.cable_law import lengths_at
from seecr.compiled.columns import (
    COMPLIANCE,
    CONVERGED,
    EA,
    N_COLUMNS,
    OF_THE_PAST,
    REST,
    SLACK,
    TENSION,
    TOLERANCE,
)
from seecr.compiled.newton import solve_batch
from seecr.compiled.rates import change_at_rest, change_of_each_cable
from seecr.parallel import undivided
from seecr.prediction.experiment import Experiment
from seecr.statics import batch
from seecr.statics.tables import Tables, assemble, take

KINDS = ("demobot_cogiro", "demobot_parallel", "planar_vertical")


def solved(kind: str) -> tuple[Tables, batch.Evaluation]:
    tables = assemble(experiment_of(kind).setup([]))
    return tables, batch.descend(tables)


def edited(tables: Tables, by: float) -> Tables:
    """The same with another stiffness of one cable and more load."""
    other = take(tables, np.arange(len(tables)))
    other.cables[:, 1, EA] *= 1.0 + by
    other.load[:, :3] *= 1.0 + by
    return other


@pytest.mark.parametrize("kind", KINDS)
def test_a_change_is_the_difference_of_what_both_tables_say(kind: str) -> None:
    tables, at = solved(kind)
    plus, minus = edited(tables, 0.01), edited(tables, -0.01)
    force, tension = batch.change(plus, minus, at)
    ahead, behind = batch.evaluate(plus, at), batch.evaluate(minus, at)
    scale = tables.scale.max()
    assert force == pytest.approx(ahead.gradient - behind.gradient, abs=1e-12 * scale)
    both = (ahead.states - behind.states)[..., TENSION]
    assert tension == pytest.approx(both, abs=1e-12 * scale)
    assert np.abs(force).max() > 1e-3 * scale


@pytest.mark.parametrize("kind", KINDS)
def test_each_cables_own_change_adds_up_to_that_of_all(kind: str) -> None:
    tables, at = solved(kind)
    plus, minus = lengthened(tables, 1e-4), lengthened(tables, -1e-4)
    force, tension = batch.change(plus, minus, at)
    each, own = batch.change_by_cable(plus, minus, at)
    assert each.shape == (*force.shape, tables.cables.shape[1])
    assert each.sum(axis=-1) == pytest.approx(force, abs=1e-12 * tables.scale.max())
    assert own == pytest.approx(tension, abs=1e-12 * tables.scale.max())


def test_a_row_that_cannot_be_evaluated_changes_nothing() -> None:
    tables, at = solved("demobot_cogiro")
    tables.cables[0, 3, REST] = np.nan
    plus = take(tables, np.arange(len(tables)))
    plus.cables[1:, 0, COMPLIANCE] = 1e-6
    # nan differs from itself: of the row that holds it, and of that alone, nothing is said
    force, tension = batch.change(plus, tables, at)
    assert np.all(force[0] == 0.0) and np.all(tension[0] == 0.0)
    assert np.all(np.isfinite(force)) and np.all(np.abs(force[1:]).max(axis=1) > 0.0)


def test_of_no_rows_nothing_changes() -> None:
    tables, at = solved("demobot_cogiro")
    none = np.zeros(0, dtype=np.intp)
    some, there = take(tables, none), batch.take_evaluation(at, none)
    force, tension = batch.change_by_cable(some, some, there)
    assert force.shape == (0, 6, 8) and tension.shape == (0, 8)


@pytest.mark.parametrize("kind", KINDS)
def test_a_walk_of_cables_without_a_past_comes_to_rest_where_each_pose_does(kind: str) -> None:
    experiment = experiment_of(kind)
    path = experiment.path
    tables = assemble(experiment.setup([], path.commands))
    walked, alone = batch.walk(tables, path, 400), batch.descend(tables)
    assert np.all(walked.outcome == CONVERGED)
    assert walked.deviation == pytest.approx(alone.deviation, abs=1e-10)
    assert np.all(tables.cables[path.fresh][..., list(OF_THE_PAST[:2])] == 0.0)


def test_a_walk_goes_on_as_it_went_and_finds_rows_to_the_last_digits() -> None:
    """Each waypoint took four evaluations, to the last digits, from where the last had ended."""
    experiment = experiment_of("demobot_cogiro")
    path = experiment.path
    step = np.concatenate([np.arange(1 - b, k + 1) for k, b in _steps(path)])
    assert np.array_equal(path.onward, step >= 2) and path.onward.mean() > 0.5
    cables = assemble(experiment.setup([], path.commands))
    walked = batch.walk(cables, path, 400)
    standing = replace(path)
    standing.__dict__["onward"] = np.zeros_like(path.onward)
    each = batch.walk(cables, standing, 400)
    assert walked.deviation == pytest.approx(each.deviation, abs=1e-10)
    assert np.all(walked.count[~path.onward] == each.count[~path.onward])
    assert walked.count[path.onward].sum() < each.count[path.onward].sum()
    assert walked.count[path.onward].mean() < 3.0
    assert np.all(walked.residual <= TOLERANCE) and np.all(walked.residual[path.rows] < 1e-12)


def _steps(path: Path) -> list[tuple[int, int]]:
    """Of each row, the waypoints on its way, and whether the way begins with one of its own."""
    own = np.bincount(path.source) - path.steps
    return list(zip(path.steps.tolist(), own.tolist(), strict=True))


def test_a_walk_does_not_search_beyond_a_waypoint_that_it_lost() -> None:
    experiment = experiment_of("demobot_cogiro")
    path = experiment.path
    tables = assemble(experiment.setup([], path.commands))
    lost = int(np.flatnonzero(path.fresh)[1]) - 3
    tables.cables[lost, 3, REST] = np.nan
    walked = batch.walk(tables, path, 400)
    spoilt = np.isin(np.arange(len(tables)), range(lost, lost + 3))
    assert np.array_equal(walked.outcome != CONVERGED, spoilt)
    assert np.all(walked.count[~spoilt] > 0) and np.all(walked.count[lost + 1 : lost + 3] == 0)


@pytest.mark.parametrize(("row", "goes_on"), [(0, False), (1, True)])
def test_where_all_is_useless_without_a_row_no_other_run_is_begun(row: int, goes_on: bool) -> None:
    """A fit dropped a step because of one run in 760, after it had searched for all of them."""
    experiment = experiment_of("demobot_cogiro")
    path = experiment.path
    tables = assemble(experiment.setup([], path.commands))
    second = int(np.flatnonzero(path.fresh)[1])
    needed = np.ones(6, dtype=bool)
    needed[1:3] = False  # of the first run only row 0
    tables.cables[path.rows[row], 3, REST] = np.nan
    with undivided():  # another thread might have begun the second run
        walked = batch.walk(tables, path, 400, needed)
    assert np.all(walked.count[: path.rows[row]] > 0)
    assert np.all((walked.count[second:] > 0) == goes_on)
    assert np.all((walked.outcome[second:] == CONVERGED) == goes_on)
    every = batch.walk(tables, path, 400)
    assert np.all(every.outcome[second:] == CONVERGED)


def test_waypoints_on_the_way_to_rows_are_those_of_their_runs() -> None:
    path = experiment_of("demobot_cogiro").path
    rows = np.zeros(6, dtype=bool)
    rows[1] = True
    found = np.flatnonzero(path.on_the_way_to(rows))
    assert np.array_equal(found, np.arange(path.rows[1] + 1))
    rows[4] = True  # of the second run, which begins with row 3
    second = np.arange(np.flatnonzero(path.fresh)[1], path.rows[4] + 1)
    assert np.array_equal(np.flatnonzero(path.on_the_way_to(rows)), [*found, *second])
    assert not path.on_the_way_to(np.zeros(6, dtype=bool)).any()


def test_a_past_is_taken_over_and_nothing_else_is() -> None:
    tables, _at = solved("demobot_cogiro")
    other = take(tables, np.arange(len(tables)))
    other.cables[:] = 7.0
    mixed = tables.with_past(other)
    past = np.isin(np.arange(N_COLUMNS), OF_THE_PAST)
    assert np.all(mixed.cables[..., past] == 7.0)
    assert np.array_equal(mixed.cables[..., ~past], tables.cables[..., ~past])


def test_poses_that_may_not_be_written_to_have_nothing_compiled_again() -> None:
    """It would take half a minute; commands are often such."""
    experiment = experiment_of("demobot_cogiro")
    poses = experiment.commands.pose.copy()
    poses.flags.writeable = False
    setup = Experiment(experiment.robot, Commands(poses)).setup([])
    solved("demobot_cogiro")
    known = len(lengths_at.signatures), len(solve_batch.signatures)
    batch.descend(assemble(setup))
    assert (len(lengths_at.signatures), len(solve_batch.signatures)) == known


def test_slack_is_longer_than_its_way_or_pulls_no_more_than_rounding() -> None:
    tables, at = solved("demobot_cogiro")
    at.states[:, :, SLACK], at.states[:, :, TENSION] = 0.0, tables.scale[:, None]
    at.states[0, 2, SLACK] = 1.0  # hangs through and pulls by its weight
    at.states[1, 4, TENSION] = 1e-12 * tables.scale[1]
    assert np.argwhere(batch.is_slack(tables, at)).tolist() == [[0, 2], [1, 4]]


def test_compiled_functions_fill_what_they_are_given() -> None:
    """Whatever was in the arrays that the batch calls lend them."""
    tables, at = solved("demobot_cogiro")
    n, m = tables.cables.shape[:2]
    gradient, tension = np.full((n, 6), 3.0), np.full((n, m), 4.0)
    change_at_rest(
        tables.cables, tables.cables, tables.load, tables.load, tables.poses, tables.screws,
        at.deviation, at.values, tables.length, at.guess, gradient, tension,
    )  # fmt: skip
    assert np.all(gradient == 0.0) and np.all(tension == 0.0)
    each, own = np.full((n, m, 6), 3.0), np.full((n, m), 4.0)
    change_of_each_cable(
        tables.cables, tables.cables, tables.load, tables.poses, tables.screws, at.deviation,
        at.values, tables.length, at.guess, each, own,
    )  # fmt: skip
    assert np.all(each == 0.0) and np.all(own == 0.0)
