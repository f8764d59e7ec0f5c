"""The search on linear residuals of known rank: what is there is found, and nothing else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from linear_toy import LinearToy, toy

from crosscheck.diagnosis.node import LEAST_GAIN, explored, node_of
from crosscheck.diagnosis.order import fitted_to_the_end, in_order, without_needless
from crosscheck.diagnosis.rivals import rivals_of
from crosscheck.diagnosis.search import Search, search
from crosscheck.diagnosis.small import share_of, small_effects_alone
from crosscheck.fit.effects.evidence import FALSE_ALARM
from crosscheck.fit.effects.gauss_newton import Fit
from crosscheck.fit.effects.possible import is_plausible
from crosscheck.fit.effects.starts import Starts
from crosscheck.fit.least_squares.problem import Problem
from crosscheck.fit.reasons import Why
from seecr.effects.base import Layout
from seecr.pose import Array
from seecr.processes import MOST

NAMES = (
    "cable_length_offset", "drum_gain", "stiffness", "centre_of_mass", "gravity_tilt",
    "tracker_frame", "tracker_scale",
)  # fmt: skip


def quiet(_text: str, _part: float) -> None:
    """No progress."""


def searched(made: LinearToy) -> Search:
    return search(made.trials, made.base)


def why(found: Search, name: str) -> Why | None:
    reason = next(c for c in found.steps[0].candidates if c.name == name).why_not
    return None if reason is None else reason.why


@pytest.mark.parametrize(
    "hidden",
    [
        {"tracker_scale": 0.7},
        {"drum_gain": 0.4},
        {"tracker_scale": 0.5, "centre_of_mass": 0.3},
        {"drum_gain": 0.3, "cable_length_offset": 0.4},
        {"drum_gain": 0.4, "stiffness": 0.5, "gravity_tilt": 0.8},
    ],
    ids=lambda hidden: "+".join(hidden),
)
def test_what_is_there_is_found_and_what_is_left_is_noise(hidden: dict[str, float]) -> None:
    found = searched(toy(hidden, NAMES))
    assert set(found.found) == set(hidden)
    assert found.last.whiteness.is_noise
    assert not found.steps[0].whiteness.is_noise
    logs = [step.evidence.log for step in found.steps]
    assert np.all(np.diff(logs) > LEAST_GAIN)
    for name, size in hidden.items():
        term = found.last.fit.terms[name]
        error = found.last.fit.stderr[found.last.fit.terms.part(name)] / term.layout.scale
        assert np.all(np.abs(term.sizes - size) < 4.5 * error)


def test_they_come_in_the_order_in_which_adding_them_pays() -> None:
    found = searched(toy({"tracker_scale": 0.3, "centre_of_mass": 1.0}, NAMES))
    assert found.found == ("centre_of_mass", "tracker_scale")
    falls = -np.diff([step.held_out.chi2.sum() for step in found.steps])
    assert falls[0] > falls[1] > 0


@pytest.mark.slow
def test_of_noise_alone_nothing_is_found() -> None:
    alarms = [seed for seed in range(40) if searched(toy({}, NAMES, seed=seed)).found]
    assert len(alarms) <= 1, "more than one false alarm in a hundred searches"
    assert FALSE_ALARM == 0.01
    found = searched(toy({}, NAMES))
    assert {why(found, name) for name in NAMES} <= {Why.CHANCE, Why.CHANCE_OVER_ALL}


def test_a_small_effect_is_not_taken_for_the_group_that_can_imitate_it() -> None:
    made = toy({"tracker_scale": 0.5}, NAMES)
    group = made.columns["cable_length_offset"].copy()
    group[..., 0] = made.columns["tracker_scale"][..., 0]
    made = toy({"tracker_scale": 0.5}, NAMES, columns={"cable_length_offset": group})
    assert searched(made).found == ("tracker_scale",)


def test_exact_equals_are_named_beside_the_one_that_is_listed() -> None:
    hidden, twin = "tracker_scale", "stiffness"
    made = toy({hidden: 0.5}, NAMES)
    made = toy({hidden: 0.5}, NAMES, columns={twin: 2.0 * made.columns[hidden]})
    found = searched(made)
    assert len(found.found) == 1
    rivals = rivals_of(found, found.found[0])
    assert [rival.name for rival in rivals] == [({hidden, twin} - set(found.found)).pop()]
    assert rivals[0].fit.chi2 == pytest.approx(found.last.fit.chi2, abs=0.1)
    assert rivals_of(searched(toy({hidden: 0.5}, NAMES)), hidden) == []


def test_evidence_alone_does_not_tell_apart_what_chi2_does() -> None:
    """A second parameter takes 9 off chi2, which may be chance: evidence pays 2.7 for it."""
    plain = toy({}, NAMES, seed=1)
    two = plain.columns["gravity_tilt"] * np.array([1.0, 0.17])
    columns = {"gravity_tilt": two, "stiffness": two[..., :1]}
    found = searched(toy({"gravity_tilt": 1.0}, NAMES, seed=1, columns=columns))
    assert found.found == ("gravity_tilt",)
    assert rivals_of(found, "gravity_tilt") == []
    (rival,) = rivals_of(found, "gravity_tilt", np.inf)
    assert rival.name == "stiffness" and 2.0 < rival.loss < 3.0
    assert rival.fit.chi2 > found.last.fit.chi2 + 9.0


def test_a_rival_is_told_with_what_it_contains() -> None:
    """Friction on a cable behind the exit point was told in place of a mass; not the cable."""
    found = searched(rubbing(0.01))
    assert found.found == ("tracker_scale",)
    loss = {rival.name: rival.loss for rival in rivals_of(found, "tracker_scale")}
    assert set(loss) == {CABLE, "exit_friction"}
    # the cable is too far off by itself; but with a parameter more it would not be
    assert 3.0 < loss[CABLE] < 6.0
    # the friction may be there or not: it moves nothing
    assert abs(loss["exit_friction"] - loss[CABLE]) < 0.5


def test_a_rival_whose_further_parameter_would_show_is_not_told() -> None:
    """Friction that would move readings by a hundred times their noise, and is not there."""
    assert rivals_of(searched(rubbing(100.0)), "tracker_scale") == []
    assert rivals_of(searched(rubbing(100.0, nearly=0.05)), "tracker_scale")[0].name == CABLE
    assert len(rivals_of(searched(rubbing(100.0, nearly=0.05)), "tracker_scale")) == 1


@pytest.mark.parametrize(("seen", "told"), [(1.0, True), (10.0, False)])
def test_friction_is_told_beside_its_cable_unless_these_data_exclude_it(
    seen: float, told: bool
) -> None:
    """With the cable hidden: friction that would show as much costs evidence, though it fits."""
    names = (*NAMES, CABLE, "exit_friction")
    plain = toy({}, names, seed=1).columns
    rubs = plain[CABLE] * [1.0, 0.0] + plain["exit_friction"] * [0.0, seen]
    found = searched(toy({CABLE: 0.5}, names, seed=1, columns={"exit_friction": rubs}))
    assert found.found == (CABLE,)
    assert ("exit_friction" in [r.name for r in rivals_of(found, CABLE)]) is told


CABLE = "winch_side_length"


def rubbing(seen: float, nearly: float = 0.2) -> LinearToy:
    """A cable behind the exit point does nearly what is hidden; friction beside it what it may."""
    hidden, names = "tracker_scale", (*NAMES, CABLE, "exit_friction")
    plain = toy({}, names, seed=1)
    as_cable = plain.columns[hidden] + nearly * plain.columns[CABLE]
    rubs = as_cable * [1.0, 0.0] + plain.columns["exit_friction"] * [0.0, seen]
    columns = {CABLE: as_cable, "exit_friction": rubs}
    return toy({hidden: 0.5}, names, seed=1, columns=columns)


def test_what_explains_far_less_is_not_fitted_to_the_end_to_see_that() -> None:
    """It does nearly what a listed effect does, and leaves of a large one far more than noise."""
    plain = toy({}, NAMES)
    nearly = plain.columns["stiffness"] + 0.2 * plain.columns["tracker_scale"]
    hidden = {"drum_gain": 0.4, "stiffness": 5.0}
    made = toy(hidden, NAMES, columns={"tracker_scale": nearly})
    found = searched(made)
    assert set(found.found) == set(hidden)
    made.fits.clear()
    assert rivals_of(found, "stiffness") == []
    assert made.fits.count(made.terms("drum_gain", "tracker_scale").names) == 1


def test_what_no_effect_explains_is_not_explained() -> None:
    """A wave through all readings: large groups take a part of it, and nobody is accused."""
    made = toy({}, NAMES)
    made.table[:] += 3.0 * np.sin(np.arange(len(made.table)) / 3.0)[:, None]
    found = searched(made)
    assert not found.last.whiteness.is_noise
    assert small_effects_alone(found, 3, (2.0 / 3.0, 1.0 / 3.0)) is None


def test_a_small_effect_beside_what_nobody_explains_is_seen_by_itself() -> None:
    made = toy({"tracker_scale": 3.0}, NAMES)
    made.table[:] += 0.8 * np.sin(np.arange(len(made.table)) / 3.0)[:, None]
    found = searched(made)
    assert not found.last.whiteness.is_noise
    way = small_effects_alone(found, 3, (2.0 / 3.0, 1.0 / 3.0))
    assert way is not None and way.found == ("tracker_scale",)
    assert share_of(way.steps[0], way.steps[1]) > 2.0 / 3.0
    assert is_plausible(way.last.fit.terms["tracker_scale"])
    # the search itself is as it was
    assert way.steps[0] is found.steps[0]


@pytest.mark.parametrize("processes", ["1", "2"])
def test_a_second_small_effect_is_sought_beside_the_first(
    monkeypatch: pytest.MonkeyPatch, processes: str
) -> None:
    made = toy({"tracker_scale": 6.0, "gravity_tilt": 3.0}, NAMES)
    made.table[:] += 0.8 * np.sin(np.arange(len(made.table)) / 3.0)[:, None]
    found = searched(made)
    monkeypatch.setenv(MOST, processes)
    way = small_effects_alone(found, 3, (0.5, 1.0 / 3.0))
    assert way is not None and set(way.found) == {"tracker_scale", "gravity_tilt"}
    beside = {c.name: c for c in way.steps[1].candidates}
    assert way.found[0] not in beside
    second = beside[way.found[1]].fit
    assert second is not None and set(second.terms.names) == set(way.found)


def test_what_is_needless_goes_and_what_the_model_had_stays() -> None:
    made = toy({"tracker_scale": 0.5, "centre_of_mass": 0.5}, NAMES)
    all_three = made.fit(made.problem, made.terms("tracker_scale", "centre_of_mass", "drum_gain"))
    node = node_of(made.trials, all_three)
    kept = without_needless(made.trials, node, ())
    assert kept.names == {"tracker_scale", "centre_of_mass"}
    assert without_needless(made.trials, node, ("drum_gain",)).names == node.names
    assert kept.evidence.log > node.evidence.log


def test_one_that_does_not_predict_runs_left_out_is_blamed() -> None:
    """Something in one run alone: fitted to the others it is not there."""
    made = toy({}, NAMES)
    only = made.problem.data.run_index == 2
    made.table[only] += 2.0 * made.columns["gravity_tilt"][only].sum(axis=-1)
    root = explored(made.trials, node_of(made.trials, made.base), True, quiet)
    best = fitted_to_the_end(
        made.trials, node_of(made.trials, made.fit(made.problem, made.terms("gravity_tilt")))
    )
    steps = in_order(made.trials, root, best, {root.names: root, best.names: best})
    assert [step.added for step in steps] == [""]
    reason = next(c.why_not for c in steps[0].candidates if c.name == "gravity_tilt")
    assert reason is not None and reason.why is Why.NOT_PREDICTIVE
    assert next(c.why_not for c in root.candidates if c.name == "gravity_tilt") is None


def test_exploring_leaves_the_node_as_it_was_and_gives_every_effect_a_place() -> None:
    made = toy({"drum_gain": 0.4}, NAMES)
    node = node_of(made.trials, made.base)
    after = explored(made.trials, node, True, quiet)
    assert node.candidates == ()
    assert {c.name for c in after.candidates} == set(NAMES)
    assert after.fit is node.fit
    chosen = [c.name for c in after.candidates if c.why_not is None]
    assert chosen == ["drum_gain"]


def test_beside_a_model_only_the_most_promising_are_fitted() -> None:
    names = (*NAMES, "platform_mass", "external_wrench", "exit_point_error", "anchor_point_error")
    made = toy({name: 0.3 for name in names}, names)
    node = node_of(made.trials, made.base)
    after = explored(made.trials, node, False, quiet)
    assert sum(c.fit is not None for c in after.candidates) == 7
    refused = [c.why_not for c in after.candidates if c.fit is None]
    assert {reason.why for reason in refused if reason is not None} == {Why.PROMISES_LESS}
    small = [c for c in after.candidates if c.fit is not None and len(c.layout) <= 3]
    assert len(small) >= 2


def test_progress_goes_from_nothing_to_the_whole() -> None:
    made = toy({"tracker_scale": 0.5, "drum_gain": 0.4}, NAMES)
    told: list[tuple[str, float]] = []
    search(made.trials, made.base, lambda text, part: told.append((text, part)))
    assert told[0] == (f"round 1: trying {NAMES[0]}", 0.0)
    assert all(0.0 <= part <= 1.0 for _text, part in told)
    assert any(text.startswith("round 2: fitting") for text, _part in told)


def test_what_chance_explains_over_all_that_were_tried_is_refused_whatever_its_evidence() -> None:
    """An effect of many shapes has as many chances."""
    made = toy({"tracker_scale": 0.3}, NAMES)
    node = node_of(made.trials, made.base)
    once = next(c for c in explored(made.trials, node, True, quiet).candidates if c.fit)
    assert once.name == "tracker_scale" and once.why_not is None

    def of_many_shapes(problem: Problem, base: Fit, layout: Layout, factor: Array) -> Starts:
        starts = made.starts(problem, base, layout, factor)
        return replace(starts, shapes=0.01 / once.p) if layout.name == once.name else starts

    trials = replace(made.trials, starts=of_many_shapes)
    again = next(c for c in explored(trials, node, True, quiet).candidates if c.fit)
    assert again.evidence is not None and again.evidence.log - node.evidence.log > LEAST_GAIN
    assert again.why_not is not None and again.why_not.why is Why.CHANCE_OVER_ALL
