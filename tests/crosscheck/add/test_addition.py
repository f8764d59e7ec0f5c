"""What an addition is worth, and which of its effects is the added one."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from made_data import SIGMA, measured, term

from crosscheck.add import add_effect, add_effects, weigh
from crosscheck.add.weigh import Addition
from crosscheck.errors import UnsolvedError
from crosscheck.fit.residual_noise import Whiteness
from crosscheck.model.fitted import Fitted
from seecr.description.mjcf import load_robot
from seecr.effects import Term
from seecr.prediction.model import new_model

ROBOT = load_robot("demobot_cogiro")
WHITE = Whiteness(1.0, 1, 0.3, 1.0, 0.0, 0.0, 0.0, 0.0)


def fitted(name: str, **values: float) -> Fitted:
    term = Term.of(ROBOT, name, **values)
    size = len(term.layout)
    return Fitted(term, np.full(size, 1e-4), np.zeros(size, dtype=bool))


def addition(**changes: Any) -> Addition:
    effects = (fitted("pulley_radius", radius_m=0.01), fitted("stiffness", factor=1.2))
    rms: Any = {"position_m": 1e-3}
    given: dict[str, Any] = {
        "names": ("stiffness", "creep"), "fitted": effects, "before": rms, "after": rms,
        "held_out_before": rms, "held_out": rms, "fall": (1.0, 0.1), "p": 0.5, "predicts": True,
        "from_nothing": 9.0, "is_nothing": False, "whiteness": WHITE, "coloured": None,
        "warnings": ("odd",), "notes": ("said",), "model": new_model(ROBOT),
    }  # fmt: skip
    return Addition(**(given | changes))


@pytest.mark.parametrize("predicts", [False, True])
@pytest.mark.parametrize("is_nothing", [False, True])
def test_what_predicts_better_pays_unless_it_is_nothing(predicts: bool, is_nothing: bool) -> None:
    found = addition(predicts=predicts, is_nothing=is_nothing)
    assert found.pays == (predicts and not is_nothing)
    worth = "improves" if predicts else "does not improve"
    assert found.lines()[0].startswith(f"stiffness + creep {worth} the prediction of test runs")
    nothing = "stiffness + creep is 9 standard errors from null"
    assert (f"{nothing}: it is not worth adding" in found.lines()) == is_nothing
    assert found.why_not.startswith(nothing if is_nothing else "what stiffness + creep explains")


def test_several_values_are_nothing_where_noise_alone_may_bring_them() -> None:
    """Of 1.5 standard errors of eight values it said "no more than its standard errors"."""
    found = addition(names=("drum_gain",), is_nothing=True, from_nothing=1.54,
                     fitted=(fitted("drum_gain", gain_1=1e-4),))  # fmt: skip
    assert found.why_not == (
        "drum_gain is no further from null than noise alone may bring 8 values "
        "(1.5 standard errors, all together)"
    )


def test_a_fit_that_cannot_be_solved_adds_nothing() -> None:
    """Its chi2 is infinite, and the model written from it could not be read again."""
    data = measured(ROBOT, [term(ROBOT, "stiffness", factor=1.3)])
    huge = term(ROBOT, "external_wrench", force_z_N=1e9)
    with pytest.raises(UnsolvedError, match="external_wrench: some rows could not be solved at"):
        add_effects(ROBOT, data, [huge])


def test_the_added_effect_is_found_by_its_name_and_the_model_has_all() -> None:
    found = addition()
    assert found.own.term.name == "stiffness" and found.own.term.vector == [1.2]
    assert found.terms.names == ("pulley_radius", "stiffness")
    assert found.lines()[-2:] == ["warning: odd", "note: said"]
    assert found.as_json()["added"] == ["stiffness", "creep"]


def test_warnings_of_several_parameters_are_in_the_plural() -> None:
    """Once "gain_1, gain_2 is up to 9 times its expected size"."""
    gains = {f"gain_{i}": 0.1 for i in (1, 2)}
    one, two = (
        " ".join(weigh._warnings_of(ROBOT, fitted("drum_gain", **dict(list(gains.items())[:k]))))
        for k in (1, 2)
    )
    assert one.startswith("drum_gain: gain_1 is ")
    assert two.startswith("drum_gain: gain_1, gain_2 are up to ")
    assert "times its expected size: check it on" in one and "up to" not in one
    assert "times their expected sizes: check them on" in two
    known = Term.of(ROBOT, "drum_gain").measured(**dict.fromkeys(gains, (0.01, 1e-4)))
    known = known.with_vector(np.zeros(8))
    off = Fitted(known, np.full(8, 1e-4), np.zeros(8, dtype=bool))
    assert "gain_1, gain_2 are up to 100 standard errors from" in " ".join(
        weigh._warnings_of(ROBOT, off)
    )


def test_what_a_tracker_throws_far_off_is_left_out_neighbours_as_well() -> None:
    """From one row in twenty on all were kept: the model was "3.8 times the noise" off."""
    data = measured(ROBOT, [term(ROBOT, "stiffness", factor=1.3)])
    rng, off = np.random.default_rng(1), np.zeros(data.n_rows, dtype=bool)
    off[rng.choice(data.n_rows, data.n_rows // 16, replace=False)] = True
    off[20:22] = True
    assert data.position is not None and SIGMA.position_m is not None
    far = 15.0 * SIGMA.position_m * rng.standard_normal((data.n_rows, 3))
    far += np.sign(far) * 8.0 * SIGMA.position_m
    # and of three neighbours those that are seen without the one that is farthest off
    off[40:43], far[[40, 42]], far[41] = True, 9.0 * SIGMA.position_m, 60.0 * SIGMA.position_m
    thrown = replace(data, position=data.position + off[:, None] * far)
    found = add_effect(ROBOT, thrown, "stiffness")
    clean = add_effect(ROBOT, data, "stiffness")
    assert any("outliers, given little weight" in note for note in found.notes)
    own, other = found.own, clean.own
    assert own.term.vector == pytest.approx(other.term.vector, abs=2.0 * float(other.stderr[0]))
    assert own.stderr[0] < 2.0 * other.stderr[0] and found.whiteness.is_noise
