"""What a search finds does not depend on the order of anything, and agrees with enumeration."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import chain, combinations

import numpy as np
import pytest
from made_data import measured, term
from made_diagnoses import SIGMA, robot

from crosscheck.inference.catalogue import Catalogue, is_field, name_of, part_of
from crosscheck.inference.fit import Data, fit
from crosscheck.inference.hypothesis import scored
from crosscheck.inference.posterior import Posterior
from crosscheck.inference.search import Search
from crosscheck.inference.verdict import judged
from crosscheck.measurements.data import Measurements
from crosscheck.measurements.read import together
from crosscheck.preparation.prepare import prepare
from seecr.effects import ApartLayout, Terms

SOME = ("pulley_radius", "stiffness", "platform_mass", "length_scale", "centre_of_mass")
HIDDEN = ("pulley_radius", "stiffness")


def searched(data: Measurements, some: tuple[str, ...] = SOME) -> Search:
    """A finished search among a few effects."""
    ready = prepare(robot(), data, Terms(), frozenset(some))
    of = Data.of(ready.problem, ready.terms)
    search = Search(of, Catalogue.of(of, ready.terms))
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
