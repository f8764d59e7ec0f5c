"""The elastic map in a recording, read back: what is drawn is what the map holds."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from recordings import Readback, headless_viewer
from robots import slides

from seecr.description.mjcf import load_robot
from seecr.show import map_recording
from seecr.show.colours import scale_colours
from seecr.show.map_recording import Elastic, write_map_recording
from seecr.statics.solution import Status
from seecr.workspace.grid import NEVER, Workspace, colour_end, evenly_picked
from seecr.workspace.maps import workspace_map

PARALLEL = load_robot("demobot_parallel")
VERTICAL = load_robot("planar_vertical")
X, Y, Z = np.linspace(0.1, 0.7, 7), np.linspace(0.1, 0.4, 4), np.array([0.05, 0.1, 0.2])


@pytest.fixture(scope="module")
def found() -> Workspace:
    return workspace_map(PARALLEL, X, Y, Z)


@pytest.fixture(scope="module")
def back(found: Workspace, tmp_path_factory: pytest.TempPathFactory) -> Readback:
    path = tmp_path_factory.mktemp("map") / "map.rrd"
    write_map_recording(found, path)
    return Readback(path)


def large(n: int) -> Workspace:
    """A made-up map of n^3 poses, all held; it rests at nine of ten, above the lowest."""
    shape, random = (n, n, n), np.random.default_rng(0)
    axes = tuple(np.linspace(0.0, 0.001 * (n - 1), n) for _ in range(3))
    slack = random.integers(0, 9, shape).astype(np.int8)
    slack[:, :, :10] = NEVER
    vectors = random.normal(size=(*shape, 3)).astype(np.float32)
    vectors[slack == NEVER] = np.nan
    return Workspace(
        PARALLEL, axes, np.array([1.0, 0, 0, 0]), np.ones(shape), 1e-3 * vectors, 1e-2 * vectors,
        slack, np.ones(shape, np.float32), np.concatenate([vectors, vectors], axis=-1),
    )  # fmt: skip


def colours_of(back: Readback, name: str, timeline: str | None = "z_mm") -> list[np.ndarray]:
    """Colours (k, 4) of each row of points."""
    rows = back.column(f"/scene/elastic/{name}/points", "Points3D:colors", timeline)
    return [np.array([[c >> s & 255 for s in (24, 16, 8, 0)] for c in row]) for row in rows]


@pytest.mark.parametrize("name", ["away", "turn", "slack"])
def test_each_slice_has_the_maps_values_as_colours(
    found: Workspace, back: Readback, name: str
) -> None:
    values = {
        "away": 1e3 * np.linalg.norm(found.deviation, axis=-1),
        "turn": np.degrees(np.linalg.norm(found.rotation, axis=-1)),
        "slack": found.slack.astype(float),
    }[name]
    top = float(PARALLEL.n_cables) if name == "slack" else colour_end(found, values.astype(float))
    assert back.column(f"/scene/elastic/{name}/points", "z_mm", "z_mm") == [50, 100, 200]
    places = back.column(f"/scene/elastic/{name}/points", "Points3D:positions", "z_mm")
    drawn = colours_of(back, name)
    assert 0 < found.rests.sum() < found.rests.size
    for k, (row, shades) in enumerate(zip(places, drawn, strict=True)):
        rests = found.rests[:, :, k]
        grid = np.stack(np.meshgrid(X, Y, Z[[k]], indexing="ij"), axis=-1)[:, :, 0]
        np.testing.assert_allclose(row, grid[rests], atol=1e-7)
        np.testing.assert_array_equal(shades, scale_colours(values[:, :, k][rests], top))


def test_legends_have_the_figures_ends_and_units(found: Workspace, back: Readback) -> None:
    away = colour_end(found, 1e3 * np.linalg.norm(found.deviation, axis=-1))
    turn = colour_end(found, np.degrees(np.linalg.norm(found.rotation, axis=-1)))
    for name, unit, top in (("away", "mm", away), ("turn", "°", turn)):
        ticks = back.static(f"/legend_{name}/ticks", "Points2D:labels")
        assert ticks[0] == f"0 {unit}" and ticks[-1] == f"{top:.4g} {unit}"
        (words,) = back.static(f"/legend_{name}/of", "Points2D:labels")
        assert words.endswith("; the last colour: or more")
    assert back.static("/legend_slack/ticks", "Points2D:labels") == [str(k) for k in range(9)]
    assert len(back.static("/legend_slack/scale", "LineStrips2D:strips")) == 9
    shades = back.static("/legend_slack/scale", "LineStrips2D:colors")
    assert len(set(shades)) == 9
    ours = scale_colours(np.arange(9.0), 8.0)
    assert shades == [int.from_bytes(bytes(row), "big") for row in ours.tolist()]
    (said,) = (back.static("/shown", "TextDocument:text"),)
    text = str(said)
    assert "Slices normal to z: 3 of 3 values of z. The timeline goes from slice to slice." in text
    lost = int(np.sum(~found.rests))
    assert f"Without a point: {lost} commands where it is free to move." in text
    assert f"Colours end at {away:.4g} mm and {turn:.4g}°, as in the figure" in text


def test_commands_without_a_point_are_told_by_their_reasons(found: Workspace) -> None:
    assert found.status is not None
    status = found.status.copy()
    fallen = tuple(np.argwhere(found.free)[0])
    status[fallen] = list(Status).index(Status.FALLING)
    text = " ".join(Elastic(replace(found, status=status)).sentences())
    free = int(found.free.sum()) - 1
    said = f"1 command where it does not come to rest and {free} commands where it is free to move"
    assert f"Without a point: {said}." in text


def test_arrows_lead_to_where_it_rests_and_along_the_softest_direction(
    found: Workspace, back: Readback
) -> None:
    def vectors(entity: str) -> list[Any]:
        return back.column(f"/scene/elastic/{entity}", "Arrows3D:vectors", "z_mm")

    step, length = 0.1, PARALLEL.length
    for k, (away, moves, turns) in enumerate(zip(
        vectors("away/arrows"), vectors("softest/moves"), vectors("softest/turns"), strict=True
    )):  # fmt: skip
        rests = found.rests[:, :, k]
        np.testing.assert_allclose(away, found.deviation[:, :, k][rests], atol=1e-7)
        soft = found.softest[:, :, k][rests]
        np.testing.assert_allclose(moves, 0.9 * step * soft[:, :3], atol=1e-6)
        np.testing.assert_allclose(turns, 0.9 * step * length * soft[:, 3:], atol=1e-6)
        whole = np.linalg.norm(np.hstack([moves, turns]), axis=1)
        np.testing.assert_allclose(whole, 0.9 * step, rtol=1e-4)


def test_a_single_slice_is_always_there_and_hinges_turn_about_their_axes(tmp_path: Path) -> None:
    found = workspace_map(VERTICAL, X, 0.0, Z)
    write_map_recording(found, tmp_path / "map.rrd")
    back = Readback(tmp_path / "map.rrd")
    assert back.timelines == set()
    (row,) = colours_of(back, "slack", None)
    np.testing.assert_array_equal(
        row, scale_colours(found.slack[:, 0][found.rests[:, 0]].astype(float), 4.0)
    )
    assert "One slice, at y = 0 mm." in str(back.static("/shown", "TextDocument:text"))
    turns = np.array(back.static("/scene/elastic/softest/turns", "Arrows3D:vectors"))
    assert np.abs(turns[:, [0, 2]]).max() < 1e-9 < np.abs(turns[:, 1]).max()
    moves = np.array(back.static("/scene/elastic/softest/moves", "Arrows3D:vectors"))
    assert np.abs(moves[:, 1]).max() < 1e-9


def test_of_a_million_poses_so_many_slices_are_kept_as_a_viewer_turns(tmp_path: Path) -> None:
    found = large(100)
    write_map_recording(found, tmp_path / "map.rrd")
    back = Readback(tmp_path / "map.rrd")
    places = back.column("/scene/elastic/away/points", "Points3D:positions", "z_mm")
    own = Elastic(found)
    assert len(places) == len(own.picked[0]) == 6 and sum(map(len, places)) <= 60_000
    assert {len(row) for row in places} == {0, 10_000}  # the first slice rests nowhere
    z = [row[0][2] for row in places if row]
    np.testing.assert_allclose(z, 1e-3 * own.picked[0][1:], atol=1e-9)
    assert own.picked[0][0] == 0 and own.picked[0][-1] == 99
    arrows = back.column("/scene/elastic/softest/turns", "Arrows3D:vectors", "z_mm")
    assert {len(row) for row in arrows} == {0, 2_500}
    text = str(back.static("/shown", "TextDocument:text"))
    assert "Slices normal to z: 6 of 100 values of z." in text
    assert "A slice has at most 2500 arrows of each kind, evenly spread." in text
    assert (tmp_path / "map.rrd").stat().st_size < 12e6


def test_a_slice_of_too_many_poses_is_thinned_and_says_so(
    found: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(map_recording, "_MOST", 10)
    own = Elastic(found)
    assert len(own.picked[0]) == 1 and len(own.picked[1]) == 10 and own.index is None
    assert "Of each slice 10 of 28 poses, evenly spread." in list(own.sentences())
    assert own.opening == ("pose", 1.0)
    for count, most in ((5, 9), (9, 5), (1, 4), (100, 6)):
        some = evenly_picked(count, most)
        assert len(some) == min(count, most) and np.all(np.diff(some) > 0)
        assert some[0] == 0 and some[-1] in (count - 1, 0)


def test_slices_between_micrometres_are_numbered(found: Workspace) -> None:
    odd = replace(found, axes=(X, Y, np.array([0.1, 0.1 + 1e-6 / 3, 0.1 + 2e-6 / 3])))
    index = Elastic(odd).index
    assert index is not None and index.timeline_name() == "slice_z"
    fine = replace(found, axes=(X, Y, np.array([0.1, 0.1001, 0.1002])))
    index = Elastic(fine).index
    assert index is not None and index.timeline_name() == "z_um"


def test_without_an_elastic_map_there_is_none(tmp_path: Path) -> None:
    write_map_recording(workspace_map(PARALLEL, X, Y, Z, elastic=False), tmp_path / "map.rrd")
    back = Readback(tmp_path / "map.rrd")
    entities = {entity for entity, _, _ in back.chunks}
    assert "/scene/held" in entities
    assert not any("elastic" in entity or "legend_" in entity for entity in entities)


def test_the_viewer_has_nothing_to_complain_about(found: Workspace, tmp_path: Path) -> None:
    path = tmp_path / "map.rrd"
    write_map_recording(found, path)
    with headless_viewer() as viewer:
        viewer.open(str(path))
        viewer.set_time("z_mm", sequence=100, play_state="paused")
        assert viewer.take_screenshot().startswith(b"\x89PNG")
        state = viewer.get_state()
        names = {view.name for view in state.views}
        assert {"Off the command [mm]", "Turned [°]", "Slack cables", "Shown"} <= names
        assert [(view.name, view.reports) for view in state.views if view.reports] == []
        # a view with two places in the layout was dropped, and said so here alone
        assert not any("broken references" in str(line) for line in viewer.get_logs())


def test_a_platform_that_cannot_turn_has_no_view_of_rotations(tmp_path: Path) -> None:
    titles = {"Off the command [mm]", "Turned [°]", "Slack cables"}
    for robot, left in ((VERTICAL, titles), (slides(), titles - {"Turned [°]"})):
        found = workspace_map(robot, X, np.array([0.0]), np.linspace(0.1, 0.3, 3))
        assert np.any(found.rests)
        write_map_recording(found, tmp_path / "map.rrd")
        back = Readback(tmp_path / "map.rrd")
        assert back.views & titles == left
        turns = "Turned [°]" in left
        soft = "Softest direction, a grid step long. Blue: moves along"
        assert soft + (", orange: turns about" if turns else "") in back.views
        drawn = {entity for entity, _, _ in back.chunks}
        assert any("/softest/turns" in one or "/turn/" in one for one in drawn) == turns
        shown = back.static("/shown", "TextDocument:text")[0]
        assert ("°" in shown) == turns
