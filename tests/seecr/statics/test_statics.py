"""The batch calls on tables: what changes between tables, walks, slack, some rows."""

from __future__ import annotations

import numpy as np
import pytest
from effect_cases import experiment_of

from seecr import Commands, Experiment
from seecr.compiled.cable_law import lengths_at
from seecr.compiled.columns import COMPLIANCE, CONVERGED, EA, OF_THE_PAST, REST, SLACK, TENSION
from seecr.compiled.history import _solve_rows
from seecr.parallel import undivided
from seecr.statics import batch
from seecr.statics.tables import Tables, assemble, take

KINDS = ("demobot_cogiro", "demobot_parallel", "planar_vertical")


def solved(kind: str) -> tuple[Tables, batch.Evaluation]:
    tables = assemble(experiment_of(kind).setup([]))
    return tables, batch.descend(tables)


def test_a_row_that_cannot_be_evaluated_changes_nothing() -> None:
    tables, at = solved("demobot_cogiro")
    tables.cables[0, 3, REST] = np.nan
    plus = take(tables, np.arange(len(tables)))
    plus.cables[1:, 0, COMPLIANCE] = 1e-6
    # nan differs from itself: of the row that holds it, and of that alone, nothing is said
    force, tension = batch.change(plus, tables, at)
    assert np.all(force[0] == 0.0) and np.all(tension[0] == 0.0)
    assert np.all(np.isfinite(force)) and np.all(np.abs(force[1:]).max(axis=1) > 0.0)


@pytest.mark.parametrize("kind", KINDS)
def test_a_walk_of_cables_without_a_past_comes_to_rest_where_each_pose_does(kind: str) -> None:
    experiment = experiment_of(kind)
    path = experiment.path
    tables = assemble(experiment.setup([], path.commands))
    walked, alone = batch.walk(tables, path, 400), batch.descend(tables)
    assert np.all(walked.outcome == CONVERGED)
    assert walked.deviation == pytest.approx(alone.deviation, abs=1e-10)
    assert np.all(tables.cables[path.fresh][..., list(OF_THE_PAST[:2])] == 0.0)


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


def test_poses_that_may_not_be_written_to_have_nothing_compiled_again() -> None:
    """It would take half a minute; commands are often such."""
    experiment = experiment_of("demobot_cogiro")
    poses = experiment.commands.pose.copy()
    poses.flags.writeable = False
    setup = Experiment(experiment.robot, Commands(poses)).setup([])
    solved("demobot_cogiro")
    known = len(lengths_at.signatures), len(_solve_rows.signatures)
    batch.descend(assemble(setup))
    assert (len(lengths_at.signatures), len(_solve_rows.signatures)) == known


def test_slack_is_longer_than_its_way_or_pulls_no_more_than_rounding() -> None:
    tables, at = solved("demobot_cogiro")
    at.states[:, :, SLACK], at.states[:, :, TENSION] = 0.0, tables.scale[:, None]
    at.states[0, 2, SLACK] = 1.0  # hangs through and pulls by its weight
    at.states[1, 4, TENSION] = 1e-12 * tables.scale[1]
    assert np.argwhere(batch.is_slack(tables, at)).tolist() == [[0, 2], [1, 4]]


@pytest.mark.parametrize("rows", [3, 70])  # 70 are kept as what tells them apart
def test_some_rows_keep_what_was_written_to_all(rows: int) -> None:
    poses = np.tile(experiment_of("demobot_cogiro").robot.reference_pose, (rows, 1))
    poses[:, 2] += np.linspace(0.0, 0.01, rows)
    setup = Experiment(experiment_of("demobot_cogiro").robot, Commands(poses)).setup([])
    plain, tables, some = assemble(setup), assemble(setup), [rows - 1, 1]
    assert np.array_equal(take(plain, some).cables, assemble(setup).cables[some])
    tables.cables[:, 2, EA] = 7.0 + np.arange(rows)
    tables.load[:, 0] = np.arange(rows)
    there = take(tables, some)
    assert there.cables[:, 2, EA].tolist() == [6.0 + rows, 8.0]
    assert there.load[:, 0].tolist() == some
    for name in ("poses", "scale", "reach", "screws"):
        assert np.array_equal(getattr(there, name), getattr(tables, name)[some])
