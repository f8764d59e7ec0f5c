"""Recordings of diagnoses and comparisons, read back: the errors drawn are those found."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import made_diagnoses as made
import numpy as np
import pytest
from recordings import Readback, headless_viewer

from crosscheck.comparison.residuals import Comparison, compare
from crosscheck.diagnosis.path import Stage
from crosscheck.diagnosis.result import Diagnosis
from crosscheck.diagnosis.words import removed
from crosscheck.fit.problem import KINDS, POSITION
from crosscheck.show import residuals
from crosscheck.show.error_figures import caption
from crosscheck.show.error_recordings import (
    states_of,
    write_comparison_recording,
    write_diagnosis_recording,
)
from crosscheck.show.residuals import Misfit, Standing, predicted_poses
from crosscheck.show.texts import escaped
from seecr.units import short

pytestmark = pytest.mark.slow

STEP = "model_step"


@pytest.fixture(scope="module")
def found() -> Diagnosis:
    return made.pulleys()


@pytest.fixture(scope="module")
def stages(found: Diagnosis) -> list[Stage]:
    assert found.path is not None
    return list(found.path.stages)


@pytest.fixture(scope="module")
def shown(found: Diagnosis, stages: list[Stage]) -> Misfit:
    assert found.path is not None
    return Misfit(found.path.problem, stages[0].state)


@pytest.fixture(scope="module")
def written(found: Diagnosis, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("diagnosis") / "diagnosis.rrd"
    write_diagnosis_recording(found, path)
    return path


@pytest.fixture(scope="module")
def back(written: Path) -> Readback:
    return Readback(written)


@pytest.fixture(scope="module")
def comparison() -> Comparison:
    return compare(made.robot(), made.readings(radius_m=0.01))


@pytest.fixture(scope="module")
def compared(comparison: Comparison, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("comparison") / "comparison.rrd"
    write_comparison_recording(comparison, path)
    return path


def test_timelines_are_models_from_the_one_as_it_stands_and_poses(back: Readback) -> None:
    assert back.timelines == {STEP, "pose"}
    assert back.column("/scene/errors", STEP, STEP) == [0, 1]


def test_arrows_are_the_errors_so_many_times_too_long(
    back: Readback, stages: list[Stage], shown: Misfit
) -> None:
    vectors = back.column("/scene/errors", "Arrows3D:vectors", STEP)
    origins = back.column("/scene/errors", "Arrows3D:origins", STEP)
    assert shown.magnify > 1.0
    for k, stage in enumerate(stages):
        drawn = np.array(vectors[k]) / shown.magnify
        assert drawn == pytest.approx(stage.state.raw[:, POSITION], abs=1e-8)
        assert np.array(origins[k]) == pytest.approx(shown.place, abs=1e-6)
    sizes = [np.linalg.norm(vectors[k], axis=1).mean() for k in (0, 1)]
    assert sizes[1] < 0.1 * sizes[0]
    text = back.static("/text/verdict", "TextDocument:text")[0]
    assert f"drawn **at {shown.magnify:g} times their length**" in text


def test_maps_dim_as_the_error_falls(back: Readback, shown: Misfit) -> None:
    for kind in shown.kinds:
        colours = back.column(f"/map/{kind.name}/errors", "Points2D:colors", STEP)
        before, after = (np.array(c) >> 16 & 255 for c in colours)  # viridis: green goes with size
        assert len(before) == shown.problem.data.n_rows
        sizes = kind.sizes(shown.problem, shown.first.raw)
        assert np.all(np.diff(before[np.argsort(sizes)]) >= 0)
        assert after.mean() < before.mean()


def test_bars_are_the_errors_on_runs_left_out(
    back: Readback, found: Diagnosis, stages: list[Stage], shown: Misfit
) -> None:
    document = found.as_json()
    for kind in shown.kinds:
        labels = back.static(f"/bars/{kind.name}/numbers", "Points2D:labels")
        held_out = document["missing"][0]["held_out"][kind.key]
        assert labels == [
            f"{short(kind.factor * document['before'][kind.key])} {kind.unit}",
            f"{short(kind.factor * held_out)} {kind.unit}",
        ]
        lit = back.column(f"/bars/{kind.name}/now", "LineStrips2D:strips", STEP)
        lengths = [strips[0][1][0] - strips[0][0][0] for strips in lit]
        assert lengths[0] > 1.2 * lengths[1] > 0.0
        noise = back.static(f"/bars/{kind.name}/noise", "LineStrips2D:strips")[0][0][0]
        assert lit[1][0][1][0] == pytest.approx(noise, abs=4.0)
        floor = document["noise_floor"][kind.key]
        sizes = np.log([document["before"][kind.key] / floor, held_out / floor])
        beyond = [strips[0][1][0] - noise for strips in lit]
        assert beyond[0] * sizes[1] == pytest.approx(beyond[1] * sizes[0], abs=1e-3)
    assert [s.label for s in stages] == back.static("/bars/position/names", "Points2D:labels")


def test_the_box_is_the_worst_pose(back: Readback, stages: list[Stage], shown: Misfit) -> None:
    worst = shown.worst_row
    table = np.zeros(shown.problem.measured.shape)
    table[shown.problem.row_of, shown.problem.column_of] = shown.first.white
    assert worst == np.argmax((table**2).sum(axis=1))
    turned = back.column("/scene/model/platform", "Boxes3D:quaternions", STEP)
    for k, stage in enumerate(stages):
        quat = predicted_poses(stage.state)[worst, 3:]
        assert np.roll(turned[k][0], 1) == pytest.approx(quat, abs=1e-6)
    measured = back.column("/scene/measured/platform", "Boxes3D:quaternions", STEP)
    assert np.roll(measured[0][0], 1) == pytest.approx(shown.measured[worst, 3:], abs=1e-6)
    assert f"line {shown.problem.data.line[worst]}" in _steps(back)[0]


def _steps(back: Readback) -> list[str]:
    return [row[0] for row in back.column("/text/now", "TextDocument:text", STEP)]


def test_texts_say_what_was_added(back: Readback, found: Diagnosis) -> None:
    first, second = _steps(back)
    assert first.startswith("## Step 0 of 1: plain SEECR")
    assert second.startswith("## Step 1 of 1: + pulley\\_radius")
    assert escaped(found.missing[0].check) in second
    assert f"It {removed(found.missing[0].share)}: {found.missing[0].title}." in second
    radius = 1e3 * found.missing[0].values[0]
    assert f"- radius = {radius:.3f}"[:16] in second
    verdict = back.static("/text/verdict", "TextDocument:text")[0]
    assert "# Effects found" in verdict
    assert escaped(found.sentence) in verdict


def test_plots_over_poses_are_each_models_errors(
    back: Readback, stages: list[Stage], shown: Misfit
) -> None:
    for kind in shown.kinds:
        for k, stage in enumerate(stages):
            sizes = kind.sizes(shown.problem, stage.state.raw) * kind.factor
            assert back.scalars(f"/plot/{kind.name}/model_{k}") == pytest.approx(sizes)
        rms = [s.held_out.rms[kind.key] * kind.factor for s in stages]  # type: ignore[operator]
        assert back.scalars(f"/plot/{kind.name}/left_out", STEP) == pytest.approx(rms)


def test_cables_are_those_of_the_last_model(
    back: Readback, stages: list[Stage], shown: Misfit
) -> None:
    states = states_of(stages[-1].state, slice(None))
    taut = back.column("/scene/model/cables/taut", "LineStrips3D:strips", "pose")
    pulls = (~states.slack).sum(axis=1)
    assert [len(strips) for strips in taut] == pulls.tolist()


@pytest.mark.slow
def test_unknown_is_said_and_drawn(tmp_path: Path) -> None:
    found = made.unknown()
    path = tmp_path / "unknown.rrd"
    write_diagnosis_recording(found, path)
    back = Readback(path)
    assert "# Unknown effect" in back.static("/text/verdict", "TextDocument:text")[0]
    assert found.path is not None
    assert len(back.column("/scene/errors", STEP, STEP)) == len(found.path.stages)


def test_no_verdict_is_words_alone(tmp_path: Path) -> None:
    path = tmp_path / "none.rrd"
    write_diagnosis_recording(made.none(), path)
    back = Readback(path)
    assert back.timelines == set()
    words = back.static("/text/verdict", "TextDocument:text")[0]
    assert words.startswith("# No verdict\nAll commands are the same")


@pytest.mark.parametrize("name", ["position_only", "tensions_only", "one_angle", "nothing"])
def test_partial_data_are_drawn_as_far_as_they_go(name: str, tmp_path: Path) -> None:
    path = tmp_path / "part.rrd"
    write_diagnosis_recording(getattr(made, name)(), path)
    back = Readback(path)
    maps = {e for e in back.entities(STEP) if e.startswith("/map/")}
    kinds = {e.split("/")[2] for e in maps}
    wanted = {"position_only": {"position"}, "tensions_only": {"tension"},
              "one_angle": {"orientation"},
              "nothing": {"position", "orientation", "tension"}}[name]  # fmt: skip
    assert kinds == wanted
    component = "Arrows3D:vectors" if "position" in wanted else "Points3D:positions"
    drawn = np.array(back.column("/scene/errors", component, STEP)[0])
    assert np.isfinite(drawn).all()


def test_users_text_means_nothing_to_markdown(found: Diagnosis, tmp_path: Path) -> None:
    path = tmp_path / "evil.rrd"
    write_diagnosis_recording(replace(found, sentence="**a** | [b](c) <i>", notes=()), path)
    text = Readback(path).static("/text/verdict", "TextDocument:text")[0]
    assert "\\*\\*a\\*\\* \\| \\[b\\](c) \\<i\\>" in text


def test_comparison_has_the_errors_of_each_pose(compared: Path, comparison: Comparison) -> None:
    back = Readback(compared)
    assert back.timelines == {"pose"}
    raw = comparison.state.raw
    for column, kind in ((0, KINDS[0]), (4, KINDS[1]), (7, KINDS[2])):
        k = column - kind.columns.start + 1
        values = back.scalars(f"/plot/{kind.name}/reading_{k}")
        assert values == pytest.approx(kind.factor * raw[:, column])
    texts = [row[0] for row in back.column("/text/now", "TextDocument:text")]
    assert f"| x | {short(1e3 * raw[3, 0])} | mm |" in texts[3]
    shown = Misfit(comparison.problem, comparison.state)
    drawn = np.array(back.column("/scene/errors", "Arrows3D:vectors")[0])
    assert drawn == pytest.approx(shown.magnify * raw[:, POSITION], abs=1e-7)


def test_comparison_names_the_worst_and_the_verdict(compared: Path, comparison: Comparison) -> None:
    text = Readback(compared).static("/text/verdict", "TextDocument:text")[0]
    assert escaped(comparison.sentence) in text
    assert "# The model is off" in text
    worst = comparison.worst[0]
    assert f"| {worst.row} | {worst.line} |" in text
    assert f"| {short(1e3 * comparison.rms['position_rms_m'])} | 0.0300 |" in text  # type: ignore[operator]


def test_of_too_many_rows_those_with_the_largest_errors_are_drawn_and_some_others(
    comparison: Comparison, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The recording says so, and keeps the poses' numbers, which are those of every other file."""
    monkeypatch.setattr(residuals, "_MOST_DRAWN", 20)
    write_comparison_recording(comparison, tmp_path / "thin.rrd")
    back, count = Readback(tmp_path / "thin.rrd"), len(comparison.problem.data)
    words = f"Drawn are 20 of {count} rows: the 10 with the largest errors in units of the noise"
    assert words in back.static("/text/verdict", "TextDocument:text")[0]
    texts = [row[0] for row in back.column("/text/now", "TextDocument:text")]
    drawn = [int(text.split()[2]) for text in texts]
    assert len(drawn) == 20 and drawn == sorted(set(drawn))
    assert {row.row for row in comparison.worst} < set(drawn)
    raw = comparison.state.raw[drawn, 0]
    assert back.scalars("/plot/position/reading_1") == pytest.approx(1e3 * raw)
    assert words in caption(comparison.problem, Standing("it", comparison.state))


def test_cables_go_by_their_names(back: Readback, shown: Misfit) -> None:
    labels = back.static("/scene/cable_names", "Points3D:labels")
    assert shown.problem.robot.cable_names == ("cable1", "cable2", "cable3", "cable4")
    assert labels == ["cable1, 2", "cable3, 4"], "pairs that leave side by side"


def test_lines_do_not_join_runs(compared: Path, comparison: Comparison) -> None:
    lines = np.array(Readback(compared).column("/plot/position/reading_1", "Scalars:scalars"))
    runs = comparison.problem.data.run
    assert lines.shape == (len(runs), 2) and np.all(np.isnan(lines).sum(axis=1) == 1)
    joined = ~np.isnan(lines[1:, 0]) == ~np.isnan(lines[:-1, 0])
    np.testing.assert_array_equal(joined, runs[1:] == runs[:-1])


def test_maps_have_axes_and_the_scale_of_their_colours(back: Readback, shown: Misfit) -> None:
    for kind in shown.kinds:
        labels = back.static(f"/map/{kind.name}/numbers", "Points2D:labels")
        places = np.array(back.static(f"/map/{kind.name}/numbers", "Points2D:positions"))
        assert labels[-2:] == [f"{shown.top(kind):g} {kind.unit}", "0"]
        dots = np.array(back.column(f"/map/{kind.name}/errors", "Points2D:positions", STEP)[0])
        level = np.isclose(places[:-2, 1], places[0, 1])  # numbers under the first axis
        across = [float(word) for word, low in zip(labels, level, strict=False) if low]
        assert len(across) >= 2 and across == pytest.approx(places[:-2][level, 0])
        assert dots[:, 0].min() - 0.1 < across[0] and across[-1] < dots[:, 0].max() + 0.1
        bar = np.array(back.static(f"/map/{kind.name}/scale", "LineStrips2D:strips"))
        assert bar[..., 0].min() > dots[:, 0].max(), "beside the dots"


def test_the_viewer_has_nothing_to_complain_about(written: Path, compared: Path) -> None:
    with headless_viewer() as viewer:
        for path, timeline, views in ((written, STEP, 10), (compared, "pose", 9)):
            viewer.open(str(path))
            viewer.set_time(timeline, sequence=1, play_state="paused")
            assert viewer.take_screenshot().startswith(b"\x89PNG")
            state = viewer.get_state()
            assert len(state.views) == views
            assert [(view.name, view.reports) for view in state.views if view.reports] == []
