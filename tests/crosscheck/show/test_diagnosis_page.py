"""The page of a diagnosis: everything is on it, nothing is beside it, and the numbers are right."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import made_diagnoses as made
import numpy as np
import pytest
from made_data import term
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from written_pages import figures_of, text_of

from crosscheck.diagnosis.path import ModelPath, Stage
from crosscheck.diagnosis.result import Diagnosis, NotListed
from crosscheck.diagnosis.words import removed, within_words
from crosscheck.fit.algebra import basis, imitated
from crosscheck.fit.problem import KINDS
from crosscheck.fit.reasons import DiagnosisVerdict, Reason, Why
from crosscheck.inference.held_out import rms_by_block
from crosscheck.show.blocks import text_of as text_of_words
from crosscheck.show.diagnosis import checks
from crosscheck.show.effect_figures import cables_of, confusion_of, projection, waterfall
from crosscheck.show.error_figures import Wall, draw_wall, failure_map, length_changes, walls_of
from crosscheck.show.figures import WIDTH, collecting
from crosscheck.show.findings import (
    candidate_rows,
    in_brief,
    parameter_table,
    untried,
)
from crosscheck.show.pictures import render
from crosscheck.show.residuals import Misfit, views_of
from seecr import load_robot
from seecr.effects import Term, layout_of
from seecr.pose import transform_points
from seecr.show.colours import AFTER, BEFORE, CALM
from seecr.units import short, with_error

pytestmark = pytest.mark.slow

ALL = ("pulleys", "nothing", "unknown", "none", "position_only", "tensions_only", "one_angle")
EVIL = '<script>alert("1")</script>&$x$'


def diagnosis(name: str) -> Diagnosis:
    found: Diagnosis = getattr(made, name)()
    return found


def path_of(found: Diagnosis) -> ModelPath:
    assert found.path is not None
    return found.path


def ends_of(found: Diagnosis) -> tuple[Stage, Stage]:
    """The model as it stood, and the last one of listed effects."""
    return path_of(found).first, path_of(found).last


@pytest.fixture
def words_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Figures of a page are neither laid out nor drawn, which takes most of the time."""
    monkeypatch.setattr(ConstrainedLayoutEngine, "execute", lambda *_args: None)
    monkeypatch.setattr(Figure, "savefig", lambda *_args, **_named: None)


_pages: dict[str, str] = {}


def page(name: str) -> str:
    if name not in _pages:
        _pages[name] = render(diagnosis(name))
    return _pages[name]


@pytest.mark.parametrize(
    ("name", "verdict", "heading"),
    [
        ("pulleys", "effects_found", "Effects found"),
        ("nothing", "no_effect_missing", "No effect missing"),
        ("unknown", "unknown_effect", "Unknown effect"),
        ("none", "no_verdict", "No verdict"),
    ],
)
def test_each_verdict_has_its_page(name: str, verdict: str, heading: str) -> None:
    found = diagnosis(name)
    assert found.verdict == verdict
    seen = text_of(page(name))
    assert heading in seen
    assert found.reason in seen and "No verdict: " not in seen
    for line in (*found.notes, *found.measure_further):
        assert line in seen
    for effect in found.missing:  # once
        assert seen.count(effect.check) == 1 and effect.confirmation not in seen
    for row in found.candidates:
        assert re.search(rf"\b{row.effect}\b", seen)
        assert str(row.why_not) in seen


@pytest.mark.parametrize("name", ALL)
def test_the_page_needs_nothing_else(name: str) -> None:
    text = re.sub(r'"data:[^"]*"', '"data:"', page(name))
    figures = [re.sub(r"xmlns(:xlink)?=\S*|<!DOCTYPE.*?>", "", f, flags=re.S)
               for f in figures_of(page(name))]  # fmt: skip
    for part in (text, *figures):
        assert "http" not in part
        assert part.count("<script") == (part is text) and "<script src" not in part
        assert "<link" not in part
        assert "@import" not in part
        links = re.findall(r'(?:href|src)="([^"]*)"', part)
        assert all(link.startswith(("#", "data:")) for link in links), links
        assert all(u.startswith("#") for u in re.findall(r"url\(([^)]*)\)", part))


@pytest.mark.parametrize("name", ALL)
def test_figures_are_well_formed_and_say_what_they_show(name: str) -> None:
    figures = figures_of(page(name))
    assert len(figures) >= (0 if name == "none" else 3)
    for figure in figures:
        assert ElementTree.fromstring(figure).tag == "{http://www.w3.org/2000/svg}svg"
    words = re.findall(r'<img alt="([^"]*)"', page(name))
    assert len(words) == len(figures) and all(words)


def test_numbers_are_those_of_the_json() -> None:
    found = diagnosis("pulleys")
    document = found.as_json()
    seen = text_of(page("pulleys"))
    for kind in KINDS:
        before = document["before"][kind.key]
        held_out = document["missing"][0]["held_out"][kind.key]
        assert f"{short(before * kind.factor)} {kind.unit}" in seen
        assert f"{short(held_out * kind.factor)} {kind.unit}" in seen
        assert f"noise {short(document['noise_floor'][kind.key] * kind.factor)}" in seen
    radius = document["missing"][0]["parameters"]["radius_m"]
    value, error = with_error(1e3 * radius["value"], 1e3 * radius["stderr"])
    assert f"radius {value} ± {error} mm" in seen
    assert document["missing"][0]["check"] in seen
    assert f"Adding it {removed(document['missing'][0]['share_of_error_removed'])}; the" in seen


@pytest.mark.parametrize("name", ["nothing", "unknown"])
def test_nothing_is_called_missing_that_is_not_sure(name: str) -> None:
    assert "Missing effects, in the order" not in page(name)
    assert "the missing effect is" not in text_of(page("pulleys")).lower()


def test_unknown_shows_where_structure_is_left() -> None:
    found = diagnosis("unknown")
    seen = text_of(page("unknown"))
    assert found.where
    assert "What the unexplained error depends on" in seen
    for row in found.where:
        assert str(row.against) in seen
        assert row.bins[0].label in seen or len(row.bins) == 1
    assert "not explained" in seen
    # what was tried may be a part of the catalogue; inks are other ones on dark pages
    assert "tried explains: an unknown effect is missing." in found.sentence
    assert "Black:" not in seen and "Bracket: the range over these runs" in seen
    assert "not explained" not in text_of(page("pulleys"))


@pytest.mark.usefixtures("words_alone")
def test_beside_something_unknown_probabilities_say_so() -> None:
    found = diagnosis("pulleys")
    assert "beside something unknown" not in text_of(page("pulleys")).lower()
    unknown = replace(found, verdict=DiagnosisVerdict.UNKNOWN_EFFECT)
    seen = text_of(render(unknown))
    assert "Probability beside something unknown that it is missing: > 99 %" in seen
    assert within_words(unknown) in seen and "probability beside something unknown" in seen


def test_text_from_users_stays_text(monkeypatch: pytest.MonkeyPatch) -> None:
    found = diagnosis("pulleys")
    old = path_of(found).problem
    robot = replace(old.robot, name=EVIL, cable_names=tuple(f"{EVIL}{k}" for k in range(4)))
    data = replace(old.data, path=Path(EVIL.replace("/", "")))
    problem = replace(old, robot=robot, data=data)
    monkeypatch.setattr(ModelPath, "problem", property(lambda _self: problem))
    bad = NotListed(EVIL, EVIL, 0.0, Reason(Why.ALIKE, by=(EVIL,)))
    text = render(
        replace(
            found,
            sentence=EVIL,
            notes=(EVIL,),
            measure_next=(EVIL,),
            candidates=(bad, *found.candidates),
            missing=tuple(replace(f, check=EVIL) for f in found.missing),
        )
    )
    assert text.count("<script") == 1  # ours, which sorts
    seen = text_of(text)
    assert seen.count(EVIL) >= 4  # sentence, note, next, why not
    # a wall has 4 names, in lines of so many letters
    assert seen.count(EVIL[:12]) - seen.count(EVIL) >= 8


@pytest.fixture
def maps(monkeypatch: pytest.MonkeyPatch) -> Callable[..., tuple[Figure, float]]:
    """The map of poses spread so far, of both models or of the first alone, and its width [in]."""

    def of(spread: tuple[float, float, float], alone: bool) -> tuple[Figure, float]:
        before, after = ends_of(diagnosis("pulleys"))
        problem = path_of(diagnosis("pulleys")).problem
        place = np.random.default_rng(1).uniform(size=(problem.data.n_rows, 3)) * spread
        monkeypatch.setattr(Misfit, "place", property(lambda _self: place))
        with collecting() as drawn:
            markup = failure_map(problem, before, before if alone else after)
        (figure,) = drawn.values()
        part = re.search(r"--part: ([\d.]+)", markup)
        return figure, WIDTH * (float(part[1]) if part else 1.0)

    return of


@pytest.mark.parametrize("alone", [True, False])
@pytest.mark.parametrize(
    "spread", [(0.01, 0.01, 1.0), (1.0, 0.01, 0.01), (1.0, 0.01, 1.0), (2.0, 0.0, 1.0)]
)
def test_a_map_is_whole_with_its_colours_beside_it_and_nothing_empty(
    spread: tuple[float, float, float], alone: bool, maps: Callable[..., tuple[Figure, float]]
) -> None:
    """Of poses one above the other the title was beyond the edge; a quarter was empty of others."""
    figure, wide = maps(spread, alone)
    box = figure.get_tightbbox()
    assert 0.0 < wide - box.width < 0.3
    for axes in figure.axes:
        for text in (axes.xaxis.label, axes.yaxis.label, axes._left_title):
            own = text.get_window_extent()
            assert own.x0 >= 0.0 and own.y0 >= 0.0, text
            assert own.x1 <= figure.bbox.width and own.y1 <= figure.bbox.height, text
    *panels, bar = figure.axes
    gap = bar.get_position().x0 - max(panel.get_position().x1 for panel in panels)
    # a title that is wider than its panel keeps them apart
    assert 0.0 < gap * figure.get_figwidth() < (0.35 if spread[0] > 0.1 else 1.0)


def test_partial_data_show_what_they_have() -> None:
    position = text_of(page("position_only"))
    assert "rms position error [mm]" in position
    assert "orientation error" not in position
    assert "Errors of the readings" in position
    tension = text_of(page("tensions_only"))
    assert "Errors of tension [N]" in tension
    assert "position error" not in tension
    assert "Arrows" not in tension
    angle = text_of(page("one_angle"))
    assert "angle ry" in angle
    assert "Dots: the orientation error" in angle


def test_the_wall_overlays_what_the_effect_accounts_for() -> None:
    found = diagnosis("pulleys")
    before, after = ends_of(found)
    wall, tension = walls_of(path_of(found).problem, before, after)
    left = wall.measured - wall.predicted
    rms = np.sqrt(np.nanmean(left**2, axis=0))
    assert np.all(rms < 2.0 * wall.noise)
    assert np.all(np.sqrt(np.nanmean(wall.measured**2, axis=0)) > 20.0 * wall.noise)
    assert np.nanstd(tension.measured - tension.predicted) < 1.1 * 0.03
    nothing = diagnosis("nothing")
    first, last = ends_of(nothing)
    assert np.all(walls_of(path_of(nothing).problem, first, last)[0].predicted == 0.0)


def test_cables_whose_tension_was_not_read_have_no_panels() -> None:
    """Three of six rows were empty where three of six cables had load cells."""
    found = diagnosis("pulleys")
    problem, stages = path_of(found).problem, ends_of(found)
    tensions = problem.data.tensions.copy()
    tensions[:, 1::2] = np.nan
    some = replace(problem, data=replace(problem.data, tensions=tensions))
    whole, wall = walls_of(problem, *stages)[-1], walls_of(some, *stages)[-1]
    assert wall.names == list(problem.robot.cable_names)[::2]
    assert np.array_equal(wall.measured, whole.measured[:, ::2])
    assert np.array_equal(wall.abscissae[0][1], whole.abscissae[0][1][:, ::2])
    draw_wall(wall, BEFORE)


def test_paid_out_is_the_commanded_change_within_a_run() -> None:
    found = diagnosis("pulleys")
    problem = path_of(found).problem
    change = length_changes(problem, np.arange(problem.data.n_rows))
    lengths = problem.robot.nominal_lengths(problem.data.command_pose)
    assert np.isnan(change[0]).all()
    assert change[1] == pytest.approx(lengths[1] - lengths[0])
    starts = np.flatnonzero(problem.data.run_index[1:] != problem.data.run_index[:-1]) + 1
    assert np.isnan(change[starts]).all()


def test_the_confusion_map_holds_containments() -> None:
    found = diagnosis("pulleys")
    confusion = confusion_of(found)
    assert confusion is not None
    assert confusion.names[: confusion.listed] == ("pulley_radius",)
    assert np.diag(confusion.part) == pytest.approx(1.0)
    a, b = (confusion.names.index(n) for n in ("pulley_radius", "exit_point_error"))
    assert confusion.part[a, b] > 0.9  # 12 points move cables as a sheave does
    assert confusion.part[b, a] < 0.9
    last = path_of(found).last.fit
    assert confusion.part[a, a] == pytest.approx(imitated(last.jacobian, basis(last.jacobian)))
    assert len(last.terms) == 1


def test_rivals_are_named_and_framed() -> None:
    found = diagnosis("pulleys")
    rival = layout_of("exit_point_error", made.robot())
    finding = replace(found.missing[0], rivals=(rival,))
    assert finding.indistinguishable == (rival.name,)
    assert {row["indistinguishable"] for row in finding.records()} == {rival.name}
    seen = text_of(render(replace(found, missing=(finding,))))
    assert "Indistinguishable on these data from exit_point_error" in seen
    assert seen.index("+ pulley_radius or exit_point_error") < seen.index("Missing effects")


def test_a_bound_and_a_blind_parameter_are_flagged() -> None:
    found = diagnosis("pulleys")
    finding = replace(found.missing[0], at_bound=np.array([True]), stderr=np.array([np.inf]))
    ((_name, value, error, _unit, flags),) = parameter_table(finding).rows
    assert flags.words == "at its bound, not determined by these data"
    assert error == "undetermined" and float(value) != 0.0  # its bound
    blind = replace(found.missing[0], stderr=np.array([np.inf]))
    ((_name, value, _error, _unit, flags),) = parameter_table(blind).rows
    assert flags.words == "not determined by these data" and value == ""
    assert "at its bound" not in text_of(page("pulleys"))


def test_checks_tell_noise_from_structure() -> None:
    good = {check.name: check.good for check in checks(diagnosis("pulleys"))}
    assert good["size of the noise"] is True
    assert good["something unknown"] is True
    assert good["neighbouring rows"] is True
    assert good["test runs"] is True
    bad = {check.name: check.good for check in checks(diagnosis("unknown"))}
    assert bad["something unknown"] is False
    assert checks(diagnosis("none")) == []


def test_candidates_say_what_they_would_need() -> None:
    rows = {row["effect"][0]: row for row in candidate_rows(diagnosis("pulleys"))}
    exit_points = rows["exit_point_error"]
    assert exit_points["explains by itself"].part > 0.5
    assert "mm" in exit_points["with a value of"]
    assert "thermal_expansion" not in rows
    assert any("thermal_expansion" in names for _why, names in untried(diagnosis("pulleys")))
    assert "alone it explains" not in text_of(page("nothing"))


def test_friction_would_need_a_friction_and_not_the_length_that_it_is_looked_for_with(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    friction = term(made.robot(), "exit_friction", friction=0.2, length_m=100.0)
    monkeypatch.setattr(ModelPath, "alone", lambda _path, _name: (0.5, friction))
    tried = NotListed("exit_friction", "rubs", 1.0, Reason(Why.IMPROBABLE))
    (row,) = candidate_rows(replace(diagnosis("pulleys"), candidates=(tried,)))
    assert row["with a value of"] == "friction = 0.200"


def test_blocks_are_the_runs_left_out() -> None:
    found = diagnosis("pulleys")
    problem, last = path_of(found).problem, path_of(found).last
    runs = rms_by_block(problem, last.held_out, KINDS[0].key)
    assert len(runs) == len(problem.data.runs)
    count = np.array([(problem.data.run == name).sum() for name in problem.data.runs])
    whole = np.sqrt((count * runs**2).sum() / count.sum())
    assert whole == pytest.approx(last.held_out.rms["position_rms_m"])


def test_arrows_fit_the_region() -> None:
    found = diagnosis("pulleys")
    problem, before = path_of(found).problem, path_of(found).first
    factor = Misfit(problem, before.state).magnify
    longest = factor * np.percentile(np.linalg.norm(before.state.raw[:, :3], axis=1), 98)
    span = np.ptp(before.state.prediction.pose[:, :3], axis=0).max()
    assert 0.04 * span < longest <= 0.13 * span
    assert str(factor).rstrip("0").rstrip(".")[0] in "125"


@pytest.mark.parametrize(
    ("spans", "views"),
    [
        ((1.0, 0.6, 0.3), [(0, 1), (0, 2)]),
        ((1.0, 0.0, 0.3), [(0, 2)]),
        ((1.0, 0.5, 0.0), [(0, 1)]),
        ((0.0, 1.0, 0.5), [(1, 2)]),
        ((0.0, 0.0, 1.0), [(0, 2)]),
        ((0.0, 0.0, 0.0), [(0, 2)]),
    ],
)
def test_views_show_the_plane_of_a_flat_robot(
    spans: tuple[float, ...], views: list[tuple[int, int]]
) -> None:
    corners = np.array([[0.0, 0.0, 0.0], spans])
    assert views_of(corners) == views


def test_a_wall_of_many_cables_shows_the_worst() -> None:
    n, m = 5, 30
    values = np.full((n, m), 0.1)
    values[:, 17] = 9.0
    names = [f"rope{k:02d}" for k in range(m)]
    wall = Wall("many", names, values, 0.0 * values, np.ones(m), "mm", [("t", np.arange(n) * 1.0)])
    (text,) = figures_of(draw_wall(wall))
    assert text.count(">rope") == 12
    assert "rope17" in text


@pytest.mark.parametrize(("name", "models"), [("pulleys", 2), ("nothing", 1)])
def test_where_an_axis_has_no_zero_there_are_dots_and_no_bars(name: str, models: int) -> None:
    (figure,) = figures_of(waterfall(diagnosis(name)))
    logarithmic = text_of(figure).count("logarithmic")
    fills = rf'<path d="M [^"]*z\s*"[^>]*style="fill: (?:{BEFORE}|{CALM}|{AFTER})'
    bars = len(re.findall(fills, figure, re.IGNORECASE))
    assert bars == models * (3 - logarithmic)
    assert (logarithmic > 0) == (name == "pulleys")


def test_a_mechanic_reads_first_what_is_wrong_by_how_much_and_where() -> None:
    robot = made.robot()
    found = diagnosis("pulleys").missing[0]
    assert text_of_words(in_brief(found, robot.cable_names)).startswith(
        "Pulleys with a radius pulley_radius: radius 10.0005 ± 0.0075 mm. Independent check: "
    )
    drums = layout_of("drum_gain", robot)
    gain = np.zeros(len(drums))
    gain[[1, 2]] = 0.002, -0.0086
    errors = np.full(len(drums), 3e-5)
    own = {"stderr": errors, "at_bound": errors < 0.0, "check": "measure the drums"}
    finding = replace(found, term=Term(drums, gain), **own)
    said = text_of_words(in_brief(finding, robot.cable_names))
    assert f": largest at {robot.cable_names[2]}, -0.8600 ± 0.0030 %. Independent" in said
    assert cables_of(finding, robot.n_cables) == [2]
    assert cables_of(found, robot.n_cables) == [*range(robot.n_cables)]
    blind = replace(finding, stderr=np.full(len(drums), np.inf))
    assert "its values are not determined" in text_of_words(in_brief(blind, robot.cable_names))


@pytest.mark.parametrize("name", ["planar_vertical", "demobot_cogiro", "planar_two_cable"])
def test_a_robot_is_drawn_upright_and_to_one_scale(name: str) -> None:
    robot = load_robot(name)
    anchors = transform_points(robot.reference_pose[None], robot.anchor_points)[0]
    flat = projection(robot, np.concatenate([robot.exit_points, anchors]))
    assert np.allclose(flat @ flat.T, np.eye(2))
    right, up = flat @ robot.up
    assert abs(right) < 1e-12 and up > 0.5
