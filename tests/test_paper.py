"""The page of the paper's figures: its numbers are those computed now, its figures are there."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import explain_figure_12
import make_paper
import numpy as np
import paper_control
import paper_search
import paper_stiffness
import pytest
from kept_figures import keep_figures

PAGES = (make_paper, explain_figure_12, paper_control)


@pytest.mark.slow
def test_the_tables_of_control_are_current() -> None:
    """But for the twins, which take minutes."""
    page = make_paper.PAGE.read_text(encoding="utf-8")
    for name, head, made in (
        ("control", paper_control.HEAD, paper_control.sweep_rows()),
        ("control errors", paper_control.ERROR_HEAD, paper_control.error_rows()),
    ):
        now = make_paper.with_table(page, name, head, made)
        assert now == page, "run: python scripts/paper_control.py"


@pytest.mark.slow
def test_the_numbers_of_the_page_are_current() -> None:
    page = make_paper.PAGE.read_text(encoding="utf-8")
    assert make_paper.with_table(page) == page, "run: python scripts/make_paper.py"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "z", "outer", "inner"),
    [("planar_vertical", 0.2, 2, 1), ("demobot_parallel", 0.1, 4, 2)],
)
def test_zones_are_as_wide_as_the_page_says(name: str, z: float, outer: int, inner: int) -> None:
    """A fifth of a millimetre inside of either edge of a zone, and as far outside."""
    first, second = (1e-3 * make_paper.width(name, z, count) for count in (outer, inner))
    robot = make_paper.robot(name)
    poses = np.tile(robot.reference_pose, (4, 1))
    edges = 0.17 + np.array([first, first + second])
    poses[:, 0], poses[:, 2] = (edges[:, None] + [-2e-4, 2e-4]).ravel(), z
    slack = make_paper.solve(robot, poses).slack.sum(axis=1)
    assert slack.tolist() == [outer, inner, inner, slack[3]] and slack[3] < inner


def test_every_figure_is_on_the_page() -> None:
    page = make_paper.PAGE.read_text(encoding="utf-8")
    for name in make_paper.FIGURES:
        assert f"pictures/paper/{name}.png" in page
        assert (make_paper.PICTURES / f"{name}.png").exists()
    # one command remakes them, with that of what would explain figure 12
    shown = set(re.findall(r"pictures/paper/([\w-]+)\.png", page))
    assert (
        shown == {*make_paper.FIGURES, "figure-12-explained", "control"} and "`make paper`" in page
    )
    recipe = (
        (make_paper.ROOT / "Makefile").read_text().partition("\npaper:")[2].partition("\n\n")[0]
    )
    assert all(f"scripts/{one.__name__}.py" in recipe for one in PAGES)


@pytest.fixture
def kept(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Figures that would be written."""
    return keep_figures(monkeypatch)


@pytest.mark.slow
def test_figure_3_says_which_end_of_a_drift_is_soft(kept: list[Any], tmp_path: Path) -> None:
    make_paper.figure_3(tmp_path / "3.png")
    (_limit, ax, *_bar) = kept[0].axes
    said = [text.get_text() for text in ax.get_legend().texts]
    assert said == ["commanded", "at rest, stiff: k_c = 100,000 N", "at rest, soft: k_c = 12 N"]
    at = {name: [line.get_xydata()[0] for line in ax.lines if line.get_label() == name]
          for name in said}  # fmt: skip
    assert [len(places) for places in at.values()] == [3, 3, 3]
    stiff, soft = (np.array(at[name]) for name in said[1:])
    assert np.all(soft[:, 1] < stiff[:, 1] - 0.1), "soft cables let it down"


@pytest.mark.slow
def test_figure_12_shows_what_was_measured_where_it_was(kept: list[Any], tmp_path: Path) -> None:
    """Lines across all x had said that it was so everywhere."""
    make_paper.figure_12(tmp_path / "12.png")
    for ax in kept[0].axes:
        pieces = [line.get_xydata() for line in ax.lines if "measured" in line.get_label()]
        assert len(pieces) == 2 and len(ax.lines) == 4 + 2
        for piece, end in zip(pieces, make_paper.ENDS, strict=True):
            assert piece[:, 0].mean() == pytest.approx(end) and np.ptp(piece[:, 0]) < 0.05
    assert sum(len(ax.get_legend().texts) for ax in kept[0].axes if ax.get_legend()) == 5


@pytest.mark.slow
def test_figure_9_shows_where_equal_tensions_of_a_pair_pull(
    kept: list[Any], tmp_path: Path
) -> None:
    """Their moment about the centre of mass is their lift at the distance that the title says."""
    make_paper.figure_9(tmp_path / "9.png")
    titles = []
    for ax, (name, x) in zip(kept[0].axes, make_paper.LEVEL, strict=True):
        one = make_paper.robot(name)
        arms = one.anchor_points[:, [0, 2]]
        ways = one.exit_points[:, [0, 2]] - arms - [x, 0.2]
        pull = np.repeat(ways.reshape(2, 2, 2).mean(axis=1), 2, axis=0)
        pull *= np.array([1.0, -pull[0, 0] / pull[2, 0]])[[0, 0, 1, 1], None]
        assert np.sum(pull[:, 0]) == pytest.approx(0.0, abs=1e-12)
        moment = np.sum(arms[:, 0] * pull[:, 1] - arms[:, 1] * pull[:, 0])
        (shown,) = (k.get_xydata() for k in ax.lines if k.get_label() == "where they meet")
        off = float(shown[0, 0]) - x
        assert off == pytest.approx(moment / np.sum(pull[:, 1]), abs=1e-12)
        titles.append(ax.get_title().partition(" the line")[0])
    assert titles == ["H on", "V on", "V 25 mm left of"]


@pytest.mark.slow
def test_the_papers_counts_are_those_of_fsolve() -> None:
    counts = {(name[8:], method): (calls, lost) for name, method, calls, _, lost in
              make_paper.counts(23)}  # fmt: skip
    assert min(counts["cogiro", "fsolve"][0]) in (13, 14)
    assert 200 < max(counts["parallel", "fsolve"][0]) < 500
    assert min(counts["cogiro", "least_squares"][0]) == 28
    assert counts["cogiro", "fsolve"][1] == counts["cogiro", "least_squares"][1] == 0
    # where the method that "provided more robust results" leaves poses unbalanced, ours leaves none
    assert counts["parallel", "least_squares"][1] > 0
    for name in ("cogiro", "parallel"):
        calls, lost = counts[name, "seecr"]
        assert max(calls) <= 15 and lost == 0
    page = make_paper.PAGE.read_text(encoding="utf-8")
    for name, method in counts:
        assert f"| demobot_{name} | {method} | {min(counts[name, method][0])} |" in page


def test_the_papers_search_as_printed_finds_what_ours_does() -> None:
    found = make_paper.sweep("demobot_cogiro", 0.1)
    unbalanced = paper_search.equations(found.robot, found.command[0])
    assert np.abs(unbalanced(found.deviation[0])).max() < 1e-8 * found.robot.weight


def test_what_the_paper_says_of_four_cables() -> None:
    vertical, level = (make_paper.sweep(f"planar_{n}", 0.2) for n in ("vertical", "horizontal"))
    counts = vertical.slack.sum(axis=1)
    assert {0, 1, 2} == set(counts.tolist()) and np.all(np.diff(counts[:46]) <= 0)
    np.testing.assert_allclose(level.deviation[:, 4], 0.0, atol=1e-9)
    pairs = level.tensions.reshape(-1, 2, 2)
    np.testing.assert_allclose(pairs[..., 0], pairs[..., 1], atol=1e-9)


def test_what_the_paper_says_of_eight_cables() -> None:
    parallel = make_paper.sweep("demobot_parallel", 0.1)
    assert make_paper.tilt(parallel)[0] == pytest.approx(26.43, abs=0.01)
    assert {0, 2, 4} == set(parallel.slack.sum(axis=1).tolist())
    assert np.abs(make_paper.tilt(make_paper.sweep("demobot_cogiro", 0.1))).max() < 0.02


def test_what_would_explain_figure_12() -> None:
    """The rows of the page: three of them, remade; all takes minutes."""
    plain = explain_figure_12.numbers([])
    np.testing.assert_allclose(plain, [24.11, -7.01], atol=0.01)
    low, placed, both = (
        explain_figure_12.explain(names)
        for names in (
            ("centre_of_mass",),
            ("initial_pose_error",),
            ("centre_of_mass", "tracker_target"),
        )
    )
    # less tilt and no sinking; sinking and no less tilt; both
    assert low.numbers[0] < 22.5 and low.numbers[1] == pytest.approx(plain[1], abs=0.1)
    assert placed.numbers[1] < -11 and placed.numbers[0] > plain[0]
    assert both.explains and not low.explains and not placed.explains
    page = make_paper.PAGE.read_text(encoding="utf-8")
    for one in (low, placed, both):
        assert "| " + " | ".join(one.row()) + " |" in page


def test_placing_each_run_by_hand_does_not_take_the_tilt_away() -> None:
    runs, alone = explain_figure_12.RUNS, ("initial_pose_error",)
    for words in ("both ends, z 0.1 m", "both ends, z 0.2 m"):
        one = explain_figure_12.explain(alone, runs[words])
        assert not one.explains and one.numbers[1] < -10
        assert one.numbers[0] > explain_figure_12.numbers([], runs[words])[0]
    far, near = (
        explain_figure_12.explain(alone, runs[f"left end, z {z} m"]) for z in ("0.1", "0.2")
    )
    assert near.explains and near.size < 1.5 and not far.explains and far.size > 3.0
    page = make_paper.PAGE.read_text(encoding="utf-8")
    for row in explain_figure_12.placed():
        assert "| " + " | ".join(row) + " |" in page


def test_a_size_that_is_no_use_stays_at_nothing() -> None:
    assert explain_figure_12.explain(("gravity_tilt",)).size == 0.0


@pytest.mark.slow
def test_the_chosen_stiffness_is_argued_with_what_it_gives() -> None:
    """The row of the choice is as computed now, and the worst search lies about the paper's 286."""
    page = make_paper.PAGE.read_text(encoding="utf-8")
    assert paper_stiffness.HEAD in page
    (row,) = paper_stiffness.stiffness_rows(make_paper.sweep, [3000.0])
    assert row[:5] == tuple(stated(page)["3000 N"][:5])
    softer, chosen = (int(stated(page)[f"{n} N"][5].split(",")[0]) for n in (2000, 3000))
    assert softer < 286 < chosen == int(row[5].split(",")[0])


def stated(page: str) -> dict[str, list[str]]:
    table = page.partition("<!-- stiffness -->")[2].partition("<!-- end")[0]
    cells = [[cell.strip() for cell in line.strip("| ").split("|")]
             for line in table.strip().splitlines()]  # fmt: skip
    return {row[0]: row for row in cells}
