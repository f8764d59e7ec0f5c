"""The recordings' parts and texts, each by itself."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import rerun.blueprint as rrb
from made_data import soft_cogiro
from recordings import Readback

from crosscheck.errors import CrosscheckError
from crosscheck.show import suite
from crosscheck.show.blocks import Bold, Code, Items, Line, TextTable, section
from crosscheck.show.error_recordings import draw_axes
from crosscheck.show.texts import markdown, pose_heading
from seecr.errors import InputFileError
from seecr.show import layout, plots
from seecr.show.map_recording import write_map_recording
from seecr.show.stream import opening, pose_index, recording_file, sweep_index
from seecr.workspace.maps import workspace_map


def blueprint() -> rrb.Blueprint:
    return layout.blueprint(layout.text("Now", "text/now"))


def test_a_recording_that_fails_leaves_nothing(tmp_path: Path) -> None:
    with (
        pytest.raises(CrosscheckError, match="half way"),
        recording_file(tmp_path / "a.rrd", "a", blueprint()) as recording,
    ):
        recording.scalars("plot/a", pose_index(1), [1.0])
        raise CrosscheckError("half way")
    assert list(tmp_path.iterdir()) == []
    with (
        pytest.raises(InputFileError, match="cannot write the recording: No such file"),
        recording_file(tmp_path / "gone" / "a.rrd", "a", blueprint()),
    ):
        raise AssertionError("nothing may be drawn into a folder that is not there")


def test_lanes_tell_apart_slack_differing_and_unknown() -> None:
    slack = np.array([[True, False], [True, False], [True, True]])
    differs = np.array([[False, False], [True, False], [True, True]])
    words = plots.lane_states(slack, differs, np.array([True, True, False]))
    assert words.tolist() == [
        [plots.SLACK, plots.TAUT], [plots.DIFFER, plots.TAUT], [plots.NONE, plots.NONE],
    ]  # fmt: skip


def test_axes_have_round_numbers_and_zero_has_no_sign(tmp_path: Path) -> None:
    with recording_file(tmp_path / "a.rrd", "a", blueprint()) as recording:
        draw_axes(recording, "map", np.array([[0.0, 0.0], [1.0, 2.0]]), "mm")
    labels = Readback(tmp_path / "a.rrd").static("/map/numbers", "Points2D:labels")
    assert "-0" not in labels and {"0", "0.5", "1"} <= set(labels)


def line(start: list[float], end: list[float], count: int) -> np.ndarray:
    places = np.linspace(start, end, count)
    return np.column_stack([places, np.tile([1.0, 0.0, 0.0, 0.0], (count, 1))])


@pytest.mark.parametrize(
    ("poses", "timeline", "places"),
    [
        (line([0.17, 0.25, 0.1], [0.63, 0.25, 0.1], 24), "x_mm", [170, 190]),
        (line([0.0, 0.0, 0.003], [0.0, 0.0, 0.001], 5), "z_um", [3000, 2500]),
        (line([0.0, 0.1, 0.0], [0.0, 0.2, 0.0], 8), "y_mm", [100, 114]),
        (line([0.0, 0.0, 0.0], [0.1, 0.1, 0.0], 5), "pose", [0, 1]),
        (line([0.1, 0.0, 0.0], [0.1, 0.0, 0.0], 3), "pose", [0, 1]),
        (line([0.1, 0.0, 0.0], [0.1, 0.0, 0.0], 1), "pose", [0]),
        (line([0.0, 0.0, 0.0], [0.1, 0.0, 0.0], 5)[[0, 1, 0, 2]], "pose", [0, 1]),
    ],
)
def test_a_line_along_an_axis_is_drawn_over_the_place(
    poses: np.ndarray, timeline: str, places: list[int]
) -> None:
    index = sweep_index(poses)
    name, step = opening(index)
    assert name == timeline and step == abs(places[-1] - places[0] or 1)
    assert index[0].timeline_name() == "pose"
    assert index[-1].as_arrow_array().to_pylist()[: len(places)] == places


def test_a_workspace_has_numbers_at_its_edges_and_the_scale_of_its_margins(tmp_path: Path) -> None:
    robot = soft_cogiro()
    found = workspace_map(robot, [0.3, 0.4], [0.2, 0.3], [0.1], elastic=False)
    write_map_recording(found, tmp_path / "map.rrd")
    back = Readback(tmp_path / "map.rrd")
    corner, *ends = back.static("/scene/axes", "Points3D:labels")
    assert corner.endswith(" m") and [word[0] for word in ends] == ["x", "y", "z"]
    places = np.array(back.static("/scene/axes", "Points3D:positions"))
    for k, word in enumerate(ends):
        assert float(word.split()[1]) == pytest.approx(places[k + 1, k], abs=1e-3)
    margins = found.margin[found.feasible]
    top = float(back.static("/legend/ticks", "Points2D:labels")[-1].removesuffix(" N"))
    assert np.quantile(margins, 0.95) <= top <= 2.0 * np.quantile(margins, 0.95)
    assert "inside their limits" in back.static("/legend/of", "Points2D:labels")[0]
    chance = np.array([0.5, 1.0, 0.0, 0.9], dtype=np.float32).reshape(2, 2, 1)
    write_map_recording(replace(found, chance=chance), tmp_path / "chance.rrd")
    back = Readback(tmp_path / "chance.rrd")
    assert "is not certain" in back.static("/legend/of", "Points2D:labels")[0]
    assert len(back.static("/scene/unsure", "Points3D:positions")) == 2


def test_a_table_has_heads_of_its_own_or_its_first_row() -> None:
    rows = [["a", "b"], ["1", "2"]]
    assert markdown([TextTable([], rows)]) == "| a | b |\n| --- | --- |\n| 1 | 2 |"
    assert markdown([TextTable(rows[0], rows[1:])]) == markdown([TextTable([], rows)])
    assert markdown([TextTable(["n"], [[None]])]).endswith("| – |")


def test_blocks_stand_below_their_title_and_what_users_wrote_means_nothing() -> None:
    text = markdown([Line((Bold("Look."), " at *x* in ", Code("a_b"))), Items(["one", "two"])], "T")
    assert text == "# T\n**Look.** at \\*x\\* in `a_b`\n\n- one\n- two"
    assert markdown([section("S", Line("x"))]) == "## S\nx"


def test_of_one_pose_it_is_not_said_which_of_how_many() -> None:
    assert pose_heading(0, 1) == "## Pose 0"
    assert pose_heading(2, 5) == "## Pose 2 (of 0 to 4)"


def test_an_instant_is_in_millimetres_and_degrees() -> None:
    text = suite.instant_text(0.25, 1e-3, np.array([0.002, np.pi / 180.0]), "cable1")
    assert text.splitlines()[0] == "## Settling, 0.250 s"
    assert [line.split(" | ")[1] for line in text.splitlines()[1:] if "---" not in line] == [
        "2 mm |", "1 ° |", "0.001 J |", "cable1 |",
    ]  # fmt: skip
