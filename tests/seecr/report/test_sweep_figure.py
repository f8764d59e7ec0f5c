"""What the figure of a sweep draws: where its lines break, and the bands about them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from calibrated import KEPT, MODEL, ROBOT, model_of
from click.testing import CliRunner
from matplotlib.figure import Figure
from slab import slides

from seecr.cli import main
from seecr.equilibrium.solving import solve
from seecr.prediction.uncertainty import Spread, spread_of
from seecr.report.sweep_panels import sweep_figure
from seecr.statics.solution import Solution

pytestmark = pytest.mark.slow
Drawn = Callable[..., list[Any]]


@pytest.fixture(scope="module")
def sweep() -> Solution:
    poses = np.tile(ROBOT.reference_pose, (4, 1))
    poses[:, 0] = [0.3, 0.35, 0.4, 0.45]
    return solve(ROBOT, poses)


@pytest.fixture
def kept(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Figures that are written, the last one last."""
    out: list[Any] = []
    write = Figure.savefig
    monkeypatch.setattr(Figure, "savefig", lambda f, *a, **b: (out.append(f), write(f, *a, **b)))
    return out


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
