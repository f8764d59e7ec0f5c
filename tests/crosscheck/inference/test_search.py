"""What a search finds does not depend on the order of anything, and agrees with enumeration."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from itertools import chain, combinations
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from made_data import COGIRO, measured, term
from made_diagnoses import SIGMA, robot

from crosscheck.inference.catalogue import Catalogue, is_field, name_of, part_of
from crosscheck.inference.evidence import Linear, MemberColumns
from crosscheck.inference.fit import Data, fit
from crosscheck.inference.hypothesis import scored
from crosscheck.inference.noise import Noise
from crosscheck.inference.posterior import Posterior, odds_of_place
from crosscheck.inference.priors import LEFTOVER, SURE, WITHIN
from crosscheck.inference.scores import Scores
from crosscheck.inference.search import Search
from crosscheck.inference.verdict import is_beyond_fields, judged
from crosscheck.measurements.data import Measurements
from crosscheck.measurements.read import together
from crosscheck.preparation.prepare import prepare
from seecr.description.mjcf import load_robot
from seecr.description.robot import Robot
from seecr.effects import ApartLayout, Term, Terms, layout_of
from seecr.pose import Array

SOME = ("pulley_radius", "stiffness", "platform_mass", "length_scale", "centre_of_mass")
HIDDEN = ("pulley_radius", "stiffness")
LOUD_M = 9e-5


def begun(data: Measurements, some: tuple[str, ...] = SOME, of: Robot | None = None) -> Search:
    """A search among a few effects before anything is fitted."""
    ready = prepare(of or robot(), data, Terms(), frozenset(some))
    fitted = Data.of(ready.problem, ready.terms)
    return Search(fitted, Catalogue.of(fitted, ready.terms))


def searched(data: Measurements, some: tuple[str, ...] = SOME) -> Search:
    """A finished search among a few effects."""
    search = begun(data, some)
    search.run()
    return search


@cache
def readings() -> Measurements:
    hidden = [term(robot(), "pulley_radius", radius_m=0.01), term(robot(), "stiffness", factor=0.9)]
    return measured(robot(), hidden, points=4, sigma=SIGMA, tensions=True)


@cache
def found() -> Search:
    return searched(readings())


def test_the_posterior_is_that_of_all_sets_one_by_one() -> None:
    """Each of the 32 sets is fitted from nothing; the search has fitted a few of them."""
    search = found()
    every = chain.from_iterable(combinations(SOME, k) for k in range(len(SOME) + 1))
    scores = {}
    for names in map(frozenset, every):
        null = Terms(search.every.members[name].term for name in sorted(names))
        one = fit(search.data, search.data.state(null))
        hypothesis = scored(search.every, names, one, {})
        if hypothesis.possible:
            scores[names] = hypothesis.score
    total = np.logaddexp.reduce(list(scores.values()))
    posterior = Posterior.of(search)
    for name in SOME:
        exact = np.exp(np.logaddexp.reduce([s for k, s in scores.items() if name in k]) - total)
        assert posterior.known.member[name] == pytest.approx(exact, abs=0.1), name
    best = max(scores, key=lambda key: scores[key])
    assert best == search.best.key == frozenset(HIDDEN)


def test_of_two_effects_that_do_the_same_only_both_together_are_needed() -> None:
    hidden = [
        term(robot(), "platform_mass", added_kg=0.25 * robot().mass),
        term(robot(), "pulley_radius", radius_m=0.01),
    ]
    data = measured(robot(), hidden, points=6, sigma=SIGMA)
    search = begun(data, ("platform_mass", "stiffness", "pulley_radius", "length_scale"))
    search.begin()
    assert search.needed(["platform_mass"]) < WITHIN and search.needed(["stiffness"]) < WITHIN
    assert search.needed(["platform_mass", "stiffness"]) > WITHIN
    assert search.needed(["pulley_radius"]) > WITHIN and search.needed(["length_scale"]) < 0.0


@pytest.mark.parametrize(
    ("name", "size", "begun_with"),
    [("exit_point_error", 0.3, 0.01), ("drum_eccentricity", 0.1, 1.0)],
)
def test_a_fit_that_wants_other_prior_widths_is_made_again_with_them(
    name: str, size: float, begun_with: float
) -> None:
    """Of many values a wrong width costs so much that the effect would seem to be worth nothing."""
    cogiro = load_robot(COGIRO)
    layout = layout_of(name, cogiro)
    drawn = size * layout.scale * np.random.default_rng(1).standard_normal(len(layout))
    hidden = Term(layout, np.where(layout.shape, layout.null, layout.null + drawn))
    search = begun(measured(cogiro, [hidden], points=6), (name,), cogiro)
    none, key = search.begin(), frozenset([name])
    search.cache.clear()
    found = search.fit(search.scores_about(none), key, begun_with)
    assert found is not None and found.score > none.score + 50.0
    each = [
        scored(search.every, key, fit(search.data, found.fit.state, {name: w}), {name: w}).score
        for w in (0.03, 0.1, 0.3, 1.0)
    ]
    assert found.score > max(each) - 3.0


def test_a_search_begins_with_the_most_promising_effects_one_by_one() -> None:
    """Beside nothing, and beside a tracker that stands elsewhere, found by registration."""
    search = begun(readings())
    none = search.begin()
    assert search.cache.keys() >= {frozenset(), *(frozenset([k]) for k in promising(search))}
    assert max(map(len, search.cache)) == 1, "others that rows far off ask for are single, too"
    assert search.best.score > none.score + WITHIN
    hidden = {"tracker_frame": {"shift_x_m": 0.002}, "stiffness": {"factor": 0.8}}
    terms = [term(robot(), name, **values) for name, values in hidden.items()]
    moved = begun(measured(robot(), terms, points=4, sigma=SIGMA), tuple(hidden))
    moved.begin()
    assert {frozenset(["tracker_frame"]), frozenset(hidden)} <= moved.cache.keys()


def promising(search: Search) -> list[str]:
    """Four at most."""
    promises = search.none_about.promises
    return [k for k in sorted(promises, key=lambda k: -promises[k])[:4] if promises[k] >= 0.0]


def test_all_effects_together_predict_better_than_those_that_are_named() -> None:
    search = found()
    together = search.calibrated
    assert together.key == frozenset(SOME) and search.everything.key == frozenset(SOME)
    assert together.score >= search.everything.score
    assert together.fit.cost < search.best.fit.cost


def test_a_rival_that_is_far_worse_is_not_fitted() -> None:
    """Its loss is that of the linear model; one that is near would have been fitted."""
    search, some = found(), frozenset(["pulley_radius"])
    fits = len(search.cache)
    loss, scores = search.challenge(some), search.last
    rival = scores.climb(search.best.key - some, without=some)
    assert loss == pytest.approx(scores.score(search.best.key) - scores.score(rival))
    assert loss > WITHIN and len(search.cache) == fits


def hypothesis(key: frozenset[str], score: float, possible: bool = True, loud: bool = False) -> Any:
    noise = Noise(np.array([9.0 if loud else 1.0, 1.0, 1.0]), np.array([0.95, 0.0, 0.0]))
    field = next(filter(is_field, key), None)
    fit = SimpleNamespace(noise=noise)
    return SimpleNamespace(key=key, score=score, possible=possible, field=field, fit=fit)


def test_the_best_is_what_a_robot_can_have_and_it_is_open_where_it_leaves_more_than_noise() -> None:
    search = begun(readings())
    none, stiff, other = frozenset[str](), frozenset(["stiffness"]), frozenset(["pulley_radius"])
    search.cache = {none: hypothesis(none, 0.0), stiff: hypothesis(stiff, 5.0), other: None}
    assert search.best.key == stiff and not search.is_open
    search.cache[other] = hypothesis(other, 9.0, possible=False)
    assert search.best.key == stiff and set(search.fitted) == {none, stiff}
    search.cache[stiff] = hypothesis(stiff, 5.0, loud=True)
    assert search.is_open
    for key, is_open in (
        (stiff | {"~0"}, True), (frozenset("abcde"), False), (frozenset("abcdef"), True),
    ):  # fmt: skip
        search.cache[key] = hypothesis(key, 20.0)
        assert search.best.key == key and search.is_open is is_open
        del search.cache[key]


def test_the_fields_are_members_like_any_other() -> None:
    search = found()
    assert any(is_field(key) for key in search.last.about.linear.groups)
    assert Posterior.of(search).unknown < 0.05


def shuffled(data: Measurements, random: np.random.Generator) -> Measurements:
    """Its runs in another order."""
    runs = [np.flatnonzero(data.run_index == k) for k in range(len(data.runs))]
    order = np.concatenate([runs[k] for k in random.permutation(len(runs))])
    return data.rows(order)


@pytest.mark.slow
def test_the_winner_is_the_same_in_any_order_of_runs_and_effects() -> None:
    first = judged(found())
    for seed in range(20):
        random = np.random.default_rng(seed)
        some = tuple(random.permutation(SOME).tolist())
        other = judged(searched(shuffled(readings(), random), some))
        assert other.verdict is first.verdict and set(other.sure) == set(first.sure), seed
        assert other.posterior.unknown == pytest.approx(first.posterior.unknown, abs=1e-3)


def louder(data: Measurements, error: Array) -> Measurements:
    """Positions with another error (n, 3), three times as large as their noise."""
    return replace(data, position=data.position + LOUD_M * error / error.std())


def along_runs(data: Measurements) -> Array:
    """Errors of a sensor that keep 0.85 of themselves from row to row, anew in each run."""
    random, run = np.random.default_rng(3), data.run_index
    out = random.standard_normal((len(run), 3))
    for k in np.flatnonzero(run[1:] == run[:-1]) + 1:
        out[k] = 0.85 * out[k - 1] + np.sqrt(1.0 - 0.85**2) * out[k]
    return out


def over_places(data: Measurements) -> Array:
    """Errors that are a smooth function of the place."""
    assert data.command_pose is not None
    place = data.command_pose[:, :3]
    unit = (place - place.mean(axis=0)) / np.ptp(place, axis=0).max()
    return np.stack([np.sin(unit @ [6.0, 0.0, 5.0 * k] + k) for k in (-1.0, 0.5, 1.0)], axis=1)


@pytest.mark.parametrize(("error", "is_unknown"), [(along_runs, False), (over_places, True)])
def test_loud_noise_that_goes_by_the_place_is_none(
    error: Callable[[Measurements], Array], is_unknown: bool
) -> None:
    """Both go along from row to row; one of them also from run to run."""
    search = searched(louder(readings(), error(readings())), HIDDEN)
    unknown = Posterior.of(search).unknown
    assert unknown > 0.95 if is_unknown else unknown < 0.05
    search.cache = {k: h for k, h in search.cache.items() if not any(map(is_field, k))}
    odds = odds_of_place(search)
    assert odds > 20.0 if is_unknown else odds < 0.01


@cache
def days(moved_m: float) -> tuple[Measurements, ...]:
    """Two days between which the tracker was set up anew, each on runs of its own."""
    out = []
    for k, shift in enumerate((0.0, moved_m)):
        hidden = [term(robot(), "tracker_frame", shift_x_m=shift)] if shift else []
        data = measured(robot(), hidden, points=4, sigma=SIGMA, seed=k)
        out.append(replace(data, path=data.path.with_name(f"day{k}.csv")))
    return tuple(out)


@pytest.mark.parametrize("order", [1, -1])
def test_a_tracker_set_up_anew_is_found_as_such_in_any_order_of_files(order: int) -> None:
    data = together(days(0.002)[::order])
    search = searched(data, ("tracker_frame", "stiffness"))
    said = judged(search)
    assert said.sure == ("tracker_frame@file",)
    moved = search.best.fit.terms["tracker_frame"]
    assert isinstance(moved.layout, ApartLayout)
    names = [part.rpartition("/")[2] for part in moved.layout.parts]
    shift = dict(zip(names, moved.vector.reshape(2, -1)[:, 0], strict=True))
    assert shift["day1.csv"] - shift["day0.csv"] == pytest.approx(0.002, abs=2e-4)


def test_what_all_files_share_is_not_told_apart() -> None:
    hidden = [term(robot(), "stiffness", factor=0.8)]
    data = together([
        replace(one, path=one.path.with_name(f"{k}.csv"))
        for k, one in enumerate(
            measured(robot(), hidden, points=4, sigma=SIGMA, seed=s) for s in (0, 1)
        )
    ])  # fmt: skip
    said = judged(searched(data, ("tracker_frame", "stiffness")))
    assert said.sure == ("stiffness",)


def test_columns_of_a_form_are_those_of_the_effect_in_the_rows_of_each_part() -> None:
    data = together(days(0.002))
    search = searched(data, ("tracker_frame",))
    about = search.none_about
    whole, parts = about.columns["tracker_frame"], about.columns["tracker_frame@file"]
    file = data.file[search.data.problem.row_of]
    assert parts.shape[1] == 2 * whole.shape[1]
    assert parts.reshape(len(parts), 2, -1).sum(axis=1) == pytest.approx(whole)
    assert not parts[file == 1, : whole.shape[1]].any()
    assert [part_of(k) for k in ("tracker_frame@file", "stiffness")] == ["file", ""]
    assert name_of("tracker_frame@file") == "tracker_frame"


def test_sets_that_no_exchange_leads_to_are_met_in_two() -> None:
    """y = a + b = c + d: each exchange of one loses a little of it, and of both nothing."""
    a, b, c = np.linalg.qr(np.random.default_rng(0).normal(size=(60, 3)))[0].T
    x = np.stack([a, b, 0.5 * (a + b) + 0.2 * c, 0.5 * (a + b) - 0.2 * c], axis=1)
    groups = {
        name: MemberColumns(np.array([k]), np.array([100.0])) for k, name in enumerate("abcd")
    }
    every = SimpleNamespace(log_prior=lambda key: -3.0 * len(key), stood_keys=frozenset())
    about = SimpleNamespace(
        linear=Linear.of(x, 4.0 * (a + b), groups), every=every, prices={}
    )  # fmt: skip
    scores = Scores(about, SimpleNamespace(key=frozenset(), score=0.0))  # type: ignore[arg-type]
    best, other = frozenset("ab"), frozenset("cd")
    assert scores.score(best) > max(scores.score(frozenset(s)) for s in ("ac", "ad", "bc", "bd"))
    fresh = Scores(about, scores.centre)  # type: ignore[arg-type]
    fresh.neighbours(best)
    assert other not in fresh.seen
    fresh.widen(best)
    assert fresh.seen[other] == pytest.approx(scores.score(other), abs=1e-6)


@pytest.mark.parametrize("loud", [8.0, 20.0])
def test_a_member_beside_a_field_needs_its_odds_and_more_than_what_the_field_leaves(
    loud: float,
) -> None:
    """Columns at right angles, so that each gain has a closed form: of a, of the field, of both."""
    x = np.linalg.qr(np.random.default_rng(0).normal(size=(60, 3)))[0]
    width, cost = 100.0, 3.0
    groups = {
        "a": MemberColumns(np.array([0]), np.array([width])),
        "~place": MemberColumns(np.array([1, 2]), np.array([width])),
    }

    def gain(power: float, count: int) -> float:
        square = width**2
        return float(0.5 * power * square / (1.0 + square) - 0.5 * count * np.log1p(square))

    needed = max(np.log(SURE / (1.0 - SURE)) + cost, LEFTOVER * gain(loud**2, 2))
    found = []
    for part in (0.98, 1.02):
        power = 2.0 * (part * needed + 0.5 * np.log1p(width**2)) * (1.0 + width**-2)
        assert gain(power, 1) == pytest.approx(part * needed)
        y = np.sqrt(power) * x[:, 0] + loud * x[:, 1]
        found.append(a_is_beyond(Linear.of(x, y, groups), cost))
    assert found == [False, True]


def a_is_beyond(linear: Linear, cost: float) -> bool:
    every = SimpleNamespace(log_prior=lambda key: -cost * len(key), stood_keys=frozenset())
    about = SimpleNamespace(linear=linear, every=every, prices={})
    scores = Scores(about, SimpleNamespace(key=frozenset(), score=0.0))  # type: ignore[arg-type]
    return is_beyond_fields(SimpleNamespace(last=scores), frozenset("a"), "a")  # type: ignore[arg-type]


@pytest.mark.parametrize(("part", "is_beyond"), [(0.4, True), (0.6, False)])
def test_only_a_field_that_explains_half_of_what_the_best_does_may_stand_for_a_member(
    part: float, is_beyond: bool
) -> None:
    """The other field can do all that the member does, and explains such a part of the rest."""
    x = np.linalg.qr(np.random.default_rng(0).normal(size=(60, 3)))[0][:, [0, 1, 0, 2]]
    places = {"a": [0], "~place": [1], "~other": [2, 3]}
    groups = {k: MemberColumns(np.array(own), np.array([100.0])) for k, own in places.items()}
    best = 0.5 * 20.0**2 - 0.5 * np.log1p(1e4)
    other = np.sqrt(2.0 * part * best + np.log1p(1e4))
    y = x @ np.array([15.0, 20.0, 0.0, other])
    assert a_is_beyond(Linear.of(x, y, groups), 3.0) is is_beyond


@pytest.mark.parametrize("seed", [7, 9])
def test_all_effects_that_are_far_off_are_fitted_as_well_as_from_the_truth(seed: int) -> None:
    # of twice their expected sizes: cables go slack elsewhere, and noise could explain what is left
    cogiro, hidden = load_robot(COGIRO), list[Term]()
    draw = np.random.default_rng(seed)
    for name in ("exit_point_error", "anchor_point_error", "cable_length_offset", "drum_gain",
                 "cable_stiffness"):  # fmt: skip
        layout = layout_of(name, cogiro)
        values = layout.null + 2.0 * layout.scale * draw.standard_normal(len(layout))
        hidden.append(Term(layout, np.clip(values, layout.lower, layout.upper)))
    names = tuple(one.name for one in hidden)
    search = begun(measured(cogiro, hidden, points=3), names, cogiro)
    near = scored(
        search.every, frozenset(names), fit(search.data, search.data.state(Terms(hidden))),
        dict.fromkeys(names, 1.0),
    )  # fmt: skip
    assert search.everything.score > near.score - 1.0
