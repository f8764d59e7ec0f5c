"""Maps of robots in planes that are oblique to x, y and z: those of the same robot along axes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from kept_figures import keep_figures
from turned import turned

from seecr.description.mjcf import load_robot
from seecr.show.files import write_arrays
from seecr.show.map_figure import map_figure
from seecr.workspace.grid import Workspace
from seecr.workspace.maps import default_axes, workspace_map
from seecr.workspace.margins import boundary

PLANE = replace(load_robot("planar_vertical"), floor=None)
# About the vertical: the plane stays upright, so that w is z.
OBLIQUE, TURN = turned(PLANE, [0.0, 0.0, np.radians(30.0)])


@pytest.fixture(scope="module")
def maps() -> tuple[Workspace, Workspace]:
    """Along the axes, and turned."""
    plain = workspace_map(PLANE, *default_axes(PLANE, 9))
    return plain, workspace_map(OBLIQUE, *default_axes(OBLIQUE, 9))


def test_the_map_turns_along_with_the_robot(maps: tuple[Workspace, Workspace]) -> None:
    plain, oblique = maps
    assert oblique.places == pytest.approx(plain.places @ TURN.T, abs=1e-12)
    assert oblique.margin == pytest.approx(plain.margin, abs=1e-9)
    assert oblique.stiffness == pytest.approx(plain.stiffness, rel=1e-5)
    assert oblique.deviation == pytest.approx(plain.deviation @ TURN.T, abs=1e-6)
    assert plain.directions is None and oblique.directions == pytest.approx(TURN.T)


def test_rows_and_places_in_words_are_by_x_y_and_z(maps: tuple[Workspace, Workspace]) -> None:
    _, oblique = maps
    row, place = oblique.records()[-1], oblique.places[-1, -1, -1]
    assert [row["x_m"], row["y_m"], row["z_m"]] == pytest.approx(place)
    assert (
        oblique.place((8, 0, 8))
        == f"x y z {' '.join(f'{p:.7g}' for p in np.round(1e3 * place, 1))} mm"
    )
    told = oblique.as_json()
    at = oblique.softest_at
    assert at is not None and told["softest_where_feasible"]["pose_m"] == pytest.approx(
        oblique.places[at]
    )
    assert told["directions"] == pytest.approx(TURN.T)


def test_the_map_says_which_way_its_axes_go(maps: tuple[Workspace, Workspace]) -> None:
    plain, oblique = maps
    words = "grid: u along (0.866, 0.5, 0), v along (-0.5, 0.866, 0), w along (0, 0, 1) of x y z"
    assert oblique.lines()[0] == words and oblique.lines()[1:] == plain.lines()
    assert oblique.region.startswith("region: u 0.04 to 0.76 m, v 0 m, w ")


def test_the_edge_of_an_oblique_map_is_that_of_the_other(maps: tuple[Workspace, Workspace]) -> None:
    own, there = (
        boundary(one.robot, *one.crossings(one.feasible), tolerance=1e-5)[:, :3] for one in maps
    )
    assert len(own) > 5 and there == pytest.approx(own @ TURN.T, abs=2e-5)
    assert maps[1].along_axes(there) == pytest.approx(own, abs=2e-5)


def test_the_figure_names_u_and_w_and_has_the_edge_in_its_place(
    maps: tuple[Workspace, Workspace], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    kept = keep_figures(monkeypatch)
    for found in maps:
        edge = boundary(found.robot, *found.crossings(found.feasible), tolerance=1e-4)
        map_figure(tmp_path / "map.png", found, edge=edge)
    plain, oblique = kept
    assert oblique.axes[0].get_ylabel() == "w [mm]" and oblique.axes[0].get_title() == "v = 0 mm"
    assert "u [mm]" in [ax.get_xlabel() for ax in oblique.axes]
    title = oblique.get_suptitle().splitlines()
    for vector in ("(0.866, 0.5, 0)", "(-0.5, 0.866, 0)", "(0, 0, 1)"):
        assert any(vector in line.replace("\N{NO-BREAK SPACE}", " ") for line in title)
    own, there = (one.axes[0].lines[0].get_xydata() for one in (plain, oblique))
    assert len(own) > 5 and there == pytest.approx(own, abs=0.2)


def test_arrays_have_the_axes_and_their_directions(
    maps: tuple[Workspace, Workspace], tmp_path: Path
) -> None:
    write_arrays(tmp_path / "map.npz", maps[1])
    with np.load(tmp_path / "map.npz") as kept:
        assert "x_m" not in kept
        corner = np.array([kept[f"{name}_m"][-1] for name in "uvw"])
        assert corner @ kept["directions"] == pytest.approx(maps[1].places[-1, -1, -1])
