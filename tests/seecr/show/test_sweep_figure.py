"""What the figure of a sweep draws: where its lines break, and the bands about them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from calibrated import KEPT, MODEL, ROBOT, model_of
from click.testing import CliRunner
from kept_figures import keep_figures
from robots import slides

from seecr.cli import main
from seecr.description.mjcf import load_robot
from seecr.equilibrium.following import Jump
from seecr.equilibrium.solving import solve
from seecr.prediction.uncertainty import Spread, spread_of
from seecr.show.sweep_figure import sweep_figure
from seecr.statics.solution import Solution
from seecr.workspace.bars import bar_manifold, midline_points
from seecr.workspace.spans import slack_spans

pytestmark = pytest.mark.slow
Drawn = Callable[..., list[Any]]


@pytest.fixture(scope="module")
def sweep() -> Solution:
    poses = np.tile(ROBOT.reference_pose, (4, 1))
    poses[:, 0] = [0.3, 0.35, 0.4, 0.45]
    return solve(ROBOT, poses)


@pytest.fixture
def kept(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Figures that would be written, the last one last."""
    return keep_figures(monkeypatch)


@pytest.fixture
def drawn(kept: list[Any], tmp_path: Path) -> Drawn:
    """Axes of the figure of a sweep."""

    def axes(solution: Solution, **more: Any) -> list[Any]:
        sweep_figure(tmp_path / "sweep.png", solution, **more)
        return list(kept[-1].axes)

    return axes


@pytest.fixture
def command(kept: list[Any], tmp_path: Path) -> Drawn:
    """Axes of the figure that the command draws."""

    def axes(*words: str) -> list[Any]:
        out = ["--out", str(tmp_path / "out"), "--no-recording"]
        answer = CliRunner().invoke(main, ["sweep", "demobot_cogiro", *words, *out])
        assert answer.exit_code == 0, answer.output
        return list(kept[-1].axes)

    return axes


def breaks(ax: Any) -> list[int]:
    """Where the first line of a panel is no line."""
    return np.flatnonzero(np.isnan(ax.lines[0].get_ydata())).tolist()


def test_lines_break_where_a_grid_goes_back_to_its_beginning(
    sweep: Solution, drawn: Drawn, command: Drawn
) -> None:
    assert breaks(drawn(sweep)[0]) == []
    for ax in drawn(sweep, runs=["a", "a", "b", "b"]):
        assert breaks(ax) == [2]
    assert breaks(command("--grid", "0.3:0.5:3", "0.25", "0.1:0.2:2")[0]) == [2, 5]
    assert breaks(command("--grid", "0.3:0.5:3", "0.25", "0.1")[0]) == []


def test_lines_break_between_the_runs_of_a_file(tmp_path: Path, command: Drawn) -> None:
    path = tmp_path / "runs.csv"
    path.write_text("run,cmd_x_m,cmd_y_m,cmd_z_m\n1,0.3,0.25,0.1\n1,0.4,0.25,0.1\n2,0.3,0.2,0.1\n")
    assert breaks(command(str(path))[0]) == [2]


def test_bands_are_one_standard_deviation_wide(
    sweep: Solution, tmp_path: Path, drawn: Drawn, command: Drawn
) -> None:
    spread = spread_of(ROBOT, sweep.command, model_of(tmp_path, MODEL + KEPT))
    assert spread is not None
    panels = drawn(sweep, spread=spread)
    drop, along = panels[0].collections[2], sweep.command[:, 0] * 1e3
    low, high = band(drop, along)
    np.testing.assert_allclose((high - low) / 2, 1e3 * spread.position[:, 2])
    np.testing.assert_allclose((high + low) / 2, 1e3 * sweep.deviation[:, 2])
    assert all(ax.collections for ax in panels[:3]) and not panels[3].collections
    said = [text.get_text() for ax in panels if ax.get_legend() for text in ax.get_legend().texts]
    assert said.count("± one standard\ndeviation") == 1
    assert not any(ax.collections for ax in drawn(sweep))
    own = ("--line", "0.3", "0.25", "0.1", "0.5", "0.25", "0.1", "--count", "3")
    assert command(*own, "--model", str(tmp_path / "model.toml"))[0].collections


def test_bands_of_tensions_end_where_cables_would_push(sweep: Solution, drawn: Drawn) -> None:
    n = len(sweep)
    wide = np.full((n, 8), 1.2 * sweep.tensions.min())
    spread = Spread(np.zeros((n, 3)), np.zeros((n, 3)), wide, np.zeros((n, 6)))
    lows = [band(one, sweep.command[:, 0] * 1e3)[0].min()
            for one in drawn(sweep, spread=spread)[2].collections]  # fmt: skip
    assert min(lows) == 0.0


def test_curves_on_each_other_are_seen_where_their_bands_differ(
    sweep: Solution, drawn: Drawn
) -> None:
    n = len(sweep)
    level = replace(sweep, deviation=np.zeros((n, 6)))
    errors = np.tile([1e-3, 2e-3, 2e-3], (n, 1))
    spread = Spread(errors, errors, np.zeros((n, 8)), np.zeros((n, 6)))
    panel = drawn(level, spread=spread)[0]
    styles = {line.get_label(): line.get_linestyle() for line in panel.lines}
    assert styles == {"dx": "-", "dy, dz": "--"}


def band(filled: Any, along: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper edge of a band at some places."""
    corners = filled.get_paths()[0].vertices
    at = [corners[np.isclose(corners[:, 0], one), 1] for one in along]
    return np.array([y.min() for y in at]), np.array([y.max() for y in at])


def test_rotations_are_drawn_where_the_platform_turns(drawn: Drawn, sweep: Solution) -> None:
    labels = [ax.get_ylabel() for ax in drawn(sweep)]
    assert "rotation [°]" in labels and len(labels) == 4
    still = slides()
    labels = [ax.get_ylabel() for ax in drawn(solve(still, still.reference_pose))]
    assert "rotation [°]" not in labels and len(labels) == 3


def test_zones_are_shaded_to_their_edges_and_slack_cables_change_there(drawn: Drawn) -> None:
    """Also a zone between two poses, in which no pose is."""
    robot = load_robot("planar_vertical")
    poses = np.tile(robot.reference_pose, (4, 1))
    poses[:, 0], poses[:, 2] = [0.18, 0.28, 0.30, 0.40], 0.2
    solution = solve(robot, poses)
    zones = slack_spans(solution)
    assert [len(zone.slack or ()) for zone in zones] == [2, 1, 0]
    *_, tensions, slack, beside = drawn(solution, zones=zones)
    edges = [1e3 * zone.first[0] for zone in zones]
    for ax in (tensions, slack, beside):
        shades = [(p.get_x(), p.get_x() + p.get_width()) for p in ax.patches]
        assert shades == [pytest.approx(pair, abs=1e-9) for pair in pairwise(edges)]
    named = {text.get_text() for text in slack.get_legend().texts}
    assert named == {"1 cable slack", "more"}
    line = slack.lines[0]
    assert line.get_xdata() == pytest.approx(np.repeat([*edges, 400.0], 2)[1:-1], abs=1e-9)
    assert line.get_ydata().tolist() == [2, 2, 1, 1, 0, 0]
    met = midline_points(solution)
    assert met is not None and "point V" in beside.get_ylabel()
    np.testing.assert_allclose(beside.lines[0].get_ydata(), 1e3 * met.beside)


def test_slack_cables_break_between_runs_and_where_the_platform_does_not_rest(drawn: Drawn) -> None:
    robot = load_robot("planar_vertical")
    poses = np.tile(robot.reference_pose, (4, 1))
    solution = solve(robot, poses)
    (zone,) = slack_spans(solution)
    zones = [
        replace(zone, rows=(0.0, 1.0)), replace(zone, run=1, rows=(2.0, 2.5)),
        replace(zone, run=1, rows=(2.5, 3.0), slack=None),
    ]  # fmt: skip
    slack = drawn(solution, zones=zones, runs=[0, 0, 1, 1])[3]
    np.testing.assert_array_equal(slack.lines[0].get_xdata(), [0, 1, np.nan, 2, 2.5, 2.5, 3])
    np.testing.assert_array_equal(slack.lines[0].get_ydata(), [0, 0, np.nan, 0, 0, np.nan, np.nan])


def test_jumps_are_marked_where_they_are(drawn: Drawn, sweep: Solution) -> None:
    """They had been steep lines from row to row like any other."""
    at = sweep.command[1].copy()
    at[0] = 0.36
    jump = Jump(at, sweep.pose[1], sweep.pose[2], 1e-3, True)
    led = replace(sweep, jumps=((), (), (jump,), ()))
    for axes, place in (
        (drawn(led), 360.0),
        # on the way to the first row of a run there is nothing to the left of it
        (drawn(led, runs=[0, 0, 1, 1]), 400.0),
        (drawn(replace(led, line=np.array([2, 3, 5, 6])), commanded=False), 3.4),
    ):
        marks = [[one for one in ax.lines if len(one.get_xdata()) == 2] for ax in axes]
        assert [one.get_xdata() for (one,) in marks] == [pytest.approx([place] * 2)] * len(axes)
        assert [text.get_text() for text in axes[0].get_legend().texts].count("jump") == 1
    plain = drawn(sweep)[0].get_legend().texts
    assert "jump" not in [text.get_text() for text in plain]


def test_the_tilt_of_a_bar_is_drawn_beside_the_manifold(drawn: Drawn) -> None:
    robot = load_robot("planar_two_cable")
    poses = np.tile(robot.reference_pose, (3, 1))
    poses[:, 0] = [0.2, 0.4, 0.5]
    solution = solve(robot, poses)
    bar = bar_manifold(solution)
    assert bar is not None
    ax = drawn(solution, bar=bar)[-1]
    here, asked = ax.lines
    assert here.get_label() == "at rest, manifold there"
    np.testing.assert_allclose(here.get_ydata(), np.degrees(bar.tilt))
    np.testing.assert_allclose(asked.get_ydata(), np.degrees(bar.at_command))
