"""What a search ended with gives way to what the probabilities prefer, if its fit is better."""

from __future__ import annotations

from dataclasses import replace

import pytest
from linear_toy import LinearToy, toy

from crosscheck.diagnosis.chances import Chances
from crosscheck.diagnosis.exchanged_effects import exchanged, replaced
from crosscheck.diagnosis.node import node_of
from crosscheck.diagnosis.order import in_order
from crosscheck.diagnosis.rivals import Rival, rivals_of
from crosscheck.diagnosis.search import Search
from crosscheck.fit.effects.candidates import Trials
from crosscheck.fit.effects.gauss_newton import Fit
from crosscheck.fit.noise.whiteness import Whiteness

NAMES = ("tracker_scale", "cable_length_offset", "drum_gain")


@pytest.fixture(scope="module")
def made() -> LinearToy:
    """A scale is there; offsets of the lengths can do the same, and seven things more."""
    plain = toy({}, NAMES)
    group = plain.columns["cable_length_offset"].copy()
    group[..., 0] = plain.columns["tracker_scale"][..., 0]
    return toy({"tracker_scale": 0.7}, NAMES, columns={"cable_length_offset": group})


def ending_with(made: LinearToy, name: str) -> Search:
    """A search that took this effect."""
    last = node_of(made.trials, made.fit(made.problem, made.terms(name)))
    assert last.whiteness.is_noise
    return Search(made.trials, in_order(made.trials, node_of(made.trials, made.base), last, {}), {})


def chances(**each: float) -> Chances:
    return Chances(each, tuple(((name,), p) for name, p in each.items()), None, None)


def test_what_is_improbable_gives_way_to_what_is_sure(made: LinearToy) -> None:
    found = ending_with(made, "cable_length_offset")
    other = exchanged(found, chances(tracker_scale=0.99, cable_length_offset=0.01))
    assert found.found == ("cable_length_offset",) and other.found == ("tracker_scale",)
    assert other.last.evidence.log > found.last.evidence.log + 5.0


def test_nothing_changes_where_either_stays_in_doubt(made: LinearToy) -> None:
    found = ending_with(made, "cable_length_offset")
    assert exchanged(found, chances(tracker_scale=0.99, cable_length_offset=0.6)) is found
    assert exchanged(found, chances(tracker_scale=0.94, cable_length_offset=0.01)) is found


def test_a_fit_that_is_worse_takes_no_place(made: LinearToy) -> None:
    """Neither one that leaves more than noise, nor one that leaves noise at a higher price."""
    found = ending_with(made, "tracker_scale")
    assert exchanged(found, chances(drum_gain=0.99, tracker_scale=0.01)) is found
    dearer = chances(cable_length_offset=0.99, tracker_scale=0.01)
    assert exchanged(found, dearer) is found


def test_what_leaves_structure_takes_no_place(
    made: LinearToy, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = ending_with(made, "cable_length_offset")
    asked = chances(tracker_scale=0.99, cable_length_offset=0.01)
    true = Trials.whiteness

    def structured(trials: Trials, fit: Fit, parameters: int) -> Whiteness:
        return replace(true(trials, fit, parameters), lag_errors=99.0)

    monkeypatch.setattr(Trials, "whiteness", structured)
    assert exchanged(found, asked) is found


def test_an_effect_that_these_data_cannot_show_takes_no_place(made: LinearToy) -> None:
    found = ending_with(made, "cable_length_offset")
    blind = replace(found, trials=replace(found.trials, candidates=lambda _problem: []))
    assert exchanged(blind, chances(tracker_scale=0.99, cable_length_offset=0.01)) is blind


def the_scale(made: LinearToy, found: Search) -> Rival:
    """The scale in place of what a search found."""
    fit = made.fit(made.problem, made.terms("tracker_scale"))
    return Rival("tracker_scale", fit, found.last.evidence.log - made.trials.evidence(fit).log)


def test_what_explains_more_in_its_place_takes_it(made: LinearToy) -> None:
    """On a robot of six cables offsets were as good as a start off its place, until more came."""
    found = ending_with(made, "cable_length_offset")
    better = the_scale(made, found)
    other = replaced(found, [replace(better, name="none", loss=1.0), better])
    assert better.is_better and other.found == ("tracker_scale",) and len(other.steps) == 2
    assert other.last.evidence.log == pytest.approx(found.last.evidence.log - better.loss)


def test_what_explains_as_well_is_a_rival_and_takes_no_place(
    made: LinearToy, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = ending_with(made, "cable_length_offset")
    better = the_scale(made, found)
    alike = replace(better, loss=-2.9)
    assert replaced(found, []) is replaced(found, [alike]) is found
    monkeypatch.setattr("crosscheck.diagnosis.rivals.in_place_of", lambda *_: [better, alike])
    assert rivals_of(found, "cable_length_offset") == [alike]


def test_no_fit_takes_the_place_that_is_worse_or_impossible(
    made: LinearToy, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = ending_with(made, "cable_length_offset")
    scale = ending_with(made, "tracker_scale")
    assert replaced(scale, [Rival("cable_length_offset", found.last.fit, -5.0)]) is scale
    monkeypatch.setattr("crosscheck.diagnosis.exchanged_effects.can_be", lambda *_: False)
    assert replaced(found, [the_scale(made, found)]) is found
