"""Results draw themselves: what the commands write, by their own methods."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import made_diagnoses
import numpy as np
import pytest
from matplotlib.figure import Figure

import crosscheck
import seecr
from crosscheck.show.pictures import render

LINE = np.linspace([0.2, 0.25, 0.1, 1, 0, 0, 0], [0.6, 0.25, 0.1, 1, 0, 0, 0], 5)


def solution() -> seecr.Solution:
    return seecr.solve("demobot_cogiro", LINE)


def by_lengths() -> seecr.Solution:
    robot = seecr.load_robot("demobot_cogiro")
    lengths = robot.rest_lengths - np.outer([0.0, 0.001], np.ones(8))
    found = seecr.solve(robot, seecr.Commands(np.tile(robot.reference_pose, (2, 1)), lengths))
    labels = [axes.get_ylabel() for axes in found.plot().axes]
    assert not any("deviation" in label.lower() for label in labels)
    return found


def correction() -> seecr.Correction:
    return seecr.correct("demobot_cogiro", LINE)


def workspace() -> seecr.Workspace:
    axes = np.linspace(0.2, 0.6, 4), np.linspace(0.1, 0.4, 3), np.array([0.1])
    return seecr.workspace_map("demobot_cogiro", *axes)


def comparison() -> crosscheck.Comparison:
    return crosscheck.compare(made_diagnoses.robot(), made_diagnoses.readings(radius_m=0.01))


def plan() -> crosscheck.Plan:
    return crosscheck.make_plan("demobot_cogiro", LINE)


MADE: dict[str, tuple[Callable[[], Any], str]] = {
    "Solution": (solution, "figure recording"),
    "of lengths": (by_lengths, "figure recording"),
    "Correction": (correction, "figure recording"),
    "Workspace": (workspace, "figure recording"),
    "Comparison": (comparison, "figure page recording"),
    "Diagnosis": (made_diagnoses.pulleys, "figure page recording"),
    "Plan": (plan, "figure page"),
    "Model": (lambda: seecr.new_model("demobot_cogiro"), ""),
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", MADE)
def test_a_result_draws_what_its_command_writes(kind: str, tmp_path: Path) -> None:
    make, has = MADE[kind]
    found = make()
    name = type(found).__name__
    if "figure" in has:
        figure = found.plot()
        assert isinstance(figure, Figure) and any(axes.has_data() for axes in figure.axes)
        figure.savefig(tmp_path / "figure.png")
        assert (tmp_path / "figure.png").stat().st_size > 5_000
    else:
        with pytest.raises(seecr.InputError, match=f"^{name} has no figure$"):
            found.plot()
    if "page" in has:
        found.save_html(tmp_path / "page.html")
        assert (tmp_path / "page.html").read_text(encoding="utf-8") == render(found)
        with pytest.raises(seecr.InputError, match=r"no figure 'nothing'; there are \w+"):
            found.plot("nothing")
    else:
        with pytest.raises(seecr.InputError, match=f"^{name} has no page"):
            found.save_html(tmp_path / "page.html")
    if "recording" in has:
        found.save_recording(tmp_path / "made.rrd")
        assert (tmp_path / "made.rrd").read_bytes()[:3] == b"RRF"
    else:
        with pytest.raises(seecr.InputError, match=f"^{name} has no recording"):
            found.save_recording(tmp_path / "made.rrd")


def test_where_it_cannot_be_written_is_said(tmp_path: Path) -> None:
    found = solution()
    with pytest.raises(seecr.InputError, match=r"x\.mcap: expected a name that ends in \.rrd"):
        found.save_recording(tmp_path / "x.mcap")
    with pytest.raises(seecr.InputError, match=r"Solution has no page; it has a figure and a reco"):
        found.save_html(tmp_path / "x.html")
    (tmp_path / "file").write_text("")
    with pytest.raises(seecr.InputFileError, match=r"cannot write the recording"):
        found.save_recording(tmp_path / "file" / "x.rrd")
    with pytest.raises(seecr.InputError, match="expected"):
        found.save_recording(3)  # type: ignore[arg-type]
    page = plan()
    with pytest.raises(seecr.InputError, match=r"x\.pdf: expected a name that ends in \.html"):
        page.save_html(tmp_path / "x.pdf")
    with pytest.raises(seecr.InputFileError, match="cannot write the page"):
        page.save_html(tmp_path / "file" / "x.html")


@pytest.mark.slow
def test_a_run_of_one_case_is_its_recording(tmp_path: Path) -> None:
    robot = seecr.load_robot("planar_vertical")
    assert robot.source is not None
    case = crosscheck.Case(
        "two", robot.source, robot.source, None, "random", robot.reference_pose[None]
    )
    run = crosscheck.run_suite([case], jobs=1)
    run.save_recording(tmp_path / "run.rrd")
    assert (tmp_path / "run.rrd").read_bytes()[:3] == b"RRF"
    with pytest.raises(seecr.InputError, match=r"this run has 2 cases; run\.results"):
        crosscheck.Run([*run.results, *run.results], run.thresholds, 0, 1, 1.0).save_recording(
            tmp_path / "run.rrd"
        )
