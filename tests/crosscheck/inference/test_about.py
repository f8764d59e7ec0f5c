"""The linear model about a fit, against whole covariances and differences of the solved model."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from made_data import measured, term
from made_diagnoses import SIGMA, robot
from noise_covariance import covariance

from crosscheck.fit.problem import Problem
from crosscheck.inference.about import (
    About,
    AmplitudeColumns,
    inside,
    linear_of,
    log_shares,
    widths_for,
)
from crosscheck.inference.catalogue import Catalogue
from crosscheck.inference.evidence import averaged
from crosscheck.inference.fit import FLAT, Data, Fit, fit
from crosscheck.inference.priors import WIDTHS
from seecr.effects import Term, Terms, layout_of
from seecr.pose import Array

OWN, OTHERS = ("stiffness", "length_scale"), ("platform_mass", "cable_length_offset")


def at_null(*names: str) -> Terms:
    layouts = [layout_of(name, robot()) for name in names]
    return Terms(Term(one, one.null) for one in layouts)


@cache
def fitted() -> tuple[Catalogue, Fit]:
    hidden = [term(robot(), "stiffness", factor=0.9), term(robot(), "pulley_radius", radius_m=0.01)]
    data = measured(robot(), hidden, points=3, sigma=SIGMA, tensions=True)
    problem = Problem(robot(), data, SIGMA, np.ones(data.n_rows, bool))
    every = (*OWN, *OTHERS, "pulley_radius", "cable_weight", "winch_side_length")
    one = Data.of(problem.considering(frozenset(every)), Terms())
    return Catalogue.of(one, Terms()), fit(one, one.state(at_null(*OWN)))


def covariance_of(found: Fit) -> Array:
    own = found.jacobian * found.width
    return own @ own.T + covariance(found.data.chain, found.noise, found.weight)


def log_likelihood(y: Array, cov: Array) -> float:
    return float(-0.5 * (y @ np.linalg.solve(cov, y) + np.linalg.slogdet(cov)[1]))


def by_differences(found: Fit, layout: Any) -> Array:
    """(N, k) derivatives by the values of an effect at null, in expected sizes."""
    out = []
    for k in range(len(layout)):
        step = np.zeros(len(layout))
        step[k] = 1e-3 * layout.scale[k]
        ends = [
            found.data.state(found.terms.with_term(Term(layout, layout.null + by * step))).white
            for by in (-1, 1)
        ]
        out.append((ends[0] - ends[1]) / 2e-3)  # of the prediction, not of what is left
    return np.stack(out, axis=1)


@pytest.mark.parametrize("name", OTHERS)
def test_what_an_effect_promises_is_the_evidence_that_it_gains_by_itself(name: str) -> None:
    every, found = fitted()
    about = About(every, found)
    x = by_differences(found, every.members[name].layout)
    assert np.abs(about.columns[name] - x).max() < 1e-3 * np.abs(x).max()
    y, base = found.state.white + found.jacobian @ found.z, covariance_of(found)
    # about the fit, whose residual stands for what its own effects leave
    left = found.state.white
    gains = [
        log_likelihood(left, base + w**2 * x @ x.T) - log_likelihood(left, base) for w in WIDTHS
    ]
    assert about.promises[name] == pytest.approx(averaged(np.array(gains)), abs=0.02)
    gain, moves = about.moves(name)
    assert gain == about.promises[name]
    # where the values of the fit go if the other has its most probable values, of width 1
    both = np.hstack([found.jacobian, x])
    precise = np.linalg.inv(covariance(found.data.chain, found.noise, found.weight))
    prior = np.diag(np.append(found.width**-2.0, np.ones(x.shape[1])))
    together = np.linalg.solve(both.T @ precise @ both + prior, both.T @ precise @ y)
    own = found.jacobian
    alone = np.linalg.solve(own.T @ precise @ own + prior[:2, :2], own.T @ precise @ y)
    np.testing.assert_allclose(
        moves / found.terms.scale, together[:2] - alone, atol=0.05 * np.abs(alone).max()
    )
    assert not set(OWN) & set(about.promises)


def test_values_lie_part_of_the_way_to_those_of_the_linear_model() -> None:
    every, found = fitted()
    about = About(every, found)
    widths = dict.fromkeys((*OWN, "platform_mass"), 1.0)
    solved = about.solved(widths)
    assert set(solved.chosen) == set(widths) and about.solved({"unheard": 1.0}).chosen == {}
    at = {name: found.terms[name].vector[0] for name in OWN} | {"platform_mass": 0.0}
    whole, half = about.values(solved), about.values(solved, 0.5)
    for name in widths:
        layout = whole[name].layout
        wanted = layout.null[0] + solved.values[solved.place(name)][0] * layout.scale[0]
        assert whole[name].vector[0] == pytest.approx(wanted)
        assert half[name].vector[0] == pytest.approx(0.5 * (wanted + at[name]))
    pulled = about.solved({"pulley_radius": 1.0})
    start = about.values(pulled)["pulley_radius"].vector[0]
    layout = every.members["pulley_radius"].layout
    wanted = max(pulled.values[0] * layout.scale[0], 0.0)
    assert start == pytest.approx(wanted or 0.03 * layout.scale[0])


def test_the_linear_model_of_members_and_fields_has_their_evidence() -> None:
    _every, found = fitted()
    random = np.random.default_rng(3)
    field = random.normal(size=(len(found.state.white), 3))
    members = {
        t.name: AmplitudeColumns(t, np.array([True]), found.jacobian[:, [k]], found.z[[k]])
        for k, t in enumerate(found.terms)
    }
    linear, z = linear_of(found, members, {"~0": field})
    np.testing.assert_array_equal(z, np.append(found.z, np.zeros(3)))
    y = found.state.white + found.jacobian @ found.z
    noise = covariance(found.data.chain, found.noise, found.weight)
    none = linear.solved({}).log_evidence
    for chosen in ({"stiffness": 0.3}, {"length_scale": 1.0, "~0": 0.3}, {"~0": 3.0}):
        wide = sum(
            w**2 * x @ x.T for k, w in chosen.items()
            for x in [field if k == "~0" else members[k].columns]
        )  # fmt: skip
        gained = log_likelihood(y, noise + wide) - log_likelihood(y, noise)
        assert linear.solved(chosen).log_evidence - none == pytest.approx(gained, abs=1e-6)


def test_widths_are_closer_for_many_values_and_reach_far_for_a_tracker() -> None:
    small, many = layout_of("stiffness", robot()), layout_of("external_wrench", robot())
    assert widths_for(small).tolist() == list(WIDTHS) and len(many) <= 12
    assert widths_for(layout_of("exit_point_error", robot())).tolist() == list(WIDTHS)
    from made_data import COGIRO

    from seecr.description.mjcf import load_robot

    closer = widths_for(layout_of("exit_point_error", load_robot(COGIRO)))
    assert closer[::2].tolist() == list(WIDTHS)
    np.testing.assert_allclose(closer[1::2] ** 2, closer[:-2:2] * closer[2::2])
    tracker = layout_of("tracker_frame", robot())
    assert widths_for(tracker).tolist() == [*WIDTHS, 30.0, 100.0, 300.0]
    assert widths_for(tracker, ["tracker_frame"]).tolist() == [FLAT]


def test_a_start_is_moved_off_its_bound_and_off_no_other_value() -> None:
    bound, free = layout_of("exit_friction", robot()), layout_of("stiffness", robot())
    at = Term(bound, np.array([bound.null[0], bound.null[1] + bound.scale[1]]))
    np.testing.assert_allclose(
        inside(at).vector, [bound.null[0] + 0.1 * bound.scale[0], at.vector[1]]
    )
    np.testing.assert_allclose(inside(at, 0.3).vector[0], bound.null[0] + 0.3 * bound.scale[0])
    assert inside(Term(free, free.null)).vector.tolist() == free.null.tolist()
    shaped = layout_of("creep", robot())
    low = Term(shaped, shaped.lower.copy())
    moved = inside(low).vector != low.vector
    assert moved.tolist() == [True, False] and shaped.shape.tolist() == [False, True]


@pytest.mark.parametrize("part", [0.1, 1e3])
def test_a_shape_counts_by_the_share_of_its_prior_that_it_is_known_to(part: float) -> None:
    """sqrt(2 pi) of its error over the range of what may be, and at most all of it."""
    layout = layout_of("creep", robot())
    found = fitted()[1]
    setup = found.state.prediction.setup
    values = np.unique([layout.start(s)[1] for s in layout.effect.shapes(setup)])
    assert len(values) > 2 and layout.shape.tolist() == [False, True]
    k = len(values) // 2
    middle = 0.5 * (values[k - 1] + values[k])  # where starts are so far apart
    error = part * (values[k] - values[k - 1])
    one = Term(layout, np.array([1.0, middle]))
    terms = Terms([*at_null("stiffness"), one])
    spread = np.diag([1.0, 0.0, (error / layout.scale[1]) ** 2])
    fake: Any = SimpleNamespace(terms=terms, spread=spread, state=found.state)
    share = min(np.sqrt(2.0 * np.pi) * part / len(values), 1.0)
    assert log_shares(fake) == pytest.approx({"creep": np.log(share)})
    assert log_shares(found) == {}
    stays: Any = SimpleNamespace(terms=terms, spread=np.zeros((3, 3)), state=found.state)
    assert log_shares(stays) == {"creep": 0.0}


def test_what_moves_nothing_is_no_column() -> None:
    """An effect whose expected size moves each reading by less than a fiftieth of its noise."""
    every, found = fitted()
    about = About(every, found)
    quiet = replace(found, data=replace(found.data))
    assert "platform_mass" in about.columns
    size = np.abs(about.columns["platform_mass"]).max()
    for by, there in ((0.019, False), (0.021, True)):
        other = About(every, quiet)
        other.columns.clear()
        other._take(
            "platform_mass", about.starts["platform_mass"],
            about.columns["platform_mass"] * (by / size), np.zeros(1),
        )  # fmt: skip
        assert ("platform_mass" in other.columns) == there
