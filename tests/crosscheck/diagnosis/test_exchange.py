"""What a search ended with gives way to what the probabilities prefer, if its fit is better."""

from __future__ import annotations

from dataclasses import replace

import pytest
from linear_toy import LinearToy, toy

from crosscheck.diagnosis.chances import Chances
from crosscheck.diagnosis.exchange import exchanged
from crosscheck.diagnosis.node import node_of
from crosscheck.diagnosis.order import in_order
from crosscheck.diagnosis.search import Search
from crosscheck.fit.candidates import Trials
from crosscheck.fit.gauss_newton import Fit
from crosscheck.fit.noise import Whiteness

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
