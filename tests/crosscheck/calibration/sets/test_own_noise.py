"""Noise that the fit of all effects follows is not taken for effects."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_data import COGIRO, measured, term
from score_chances import alike

from crosscheck.calibration import compared, search
from crosscheck.calibration.joint_fit.all_effects import Calibration, fit_all_effects
from crosscheck.calibration.noise.colour import Colour
from crosscheck.calibration.search import SetSearch, search_sets
from crosscheck.calibration.sets import own_noise
from crosscheck.calibration.sets.own_noise import OwnNoise
from crosscheck.calibration.sets.refits import ComparedSets
from crosscheck.calibration.unknown.beside import UnknownOdds
from crosscheck.fit.preparation.prepare import prepare
from crosscheck.given import considered
from crosscheck.measurements.data import Measurements, Sigma
from seecr.description.mjcf import load_robot
from seecr.effects import Terms

pytestmark = pytest.mark.slow

ROBOT = load_robot(COGIRO)
FEW = ("pulley_radius", "gravity_tilt", "drum_gain", "cable_length_offset", "tracker_target")
SIGMA = Sigma(position_m=1e-4)


def correlated() -> Measurements:
    """Positions of few rows, beside a pulley, with correlated noise of half the stated size."""
    quiet = Sigma(position_m=1e-12, orientation_rad=1e-12)
    data = measured(ROBOT, [term(ROBOT, "pulley_radius", radius_m=0.006)], points=8, sigma=quiet)
    noise = 0.5 * SIGMA.position_m * alike(np.random.default_rng(3), data.n_rows, 3, data.run)
    return replace(data, position=data.position + noise, quat_wxyz=None, sigma=SIGMA)


def sought(data: Measurements) -> SetSearch:
    ready = prepare(ROBOT, data, Terms(), considered(FEW))
    assert ready.refusal is None
    return search_sets(ready.problem, SIGMA)


def test_noise_that_all_effects_followed_is_found_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """The joint fit is made to believe that what it leaves is small and not correlated."""

    fits = list[Calibration]()  # of the same readings each time

    def followed(*args: object) -> Calibration:
        if not fits:
            fits.append(fit_all_effects(*args))  # type: ignore[arg-type]
        found = fits[0]
        small = Colour(np.array([0.25, 1.0, 1.0]), np.zeros(3))
        return replace(found, joint=replace(found.joint, colour=small))

    monkeypatch.setattr(compared, "fit_all_effects", followed)
    monkeypatch.setattr(compared, "is_not_noise", lambda _setting, _joint, _stated: False)
    for module in (compared, search):
        monkeypatch.setattr(
            module, "unknown_beside", lambda _setting, _joint, _stated: UnknownOdds(-5.0)
        )
    data = correlated()
    found = sought(data)
    assert found.found.best.names == {"pulley_radius"}
    noise = found.found.best.joint.colour
    assert noise.scale[0] == pytest.approx(0.5, rel=0.3) and noise.rho[0] > 0.6
    with monkeypatch.context() as louder:
        louder.setattr(compared, "_LOUDER", 0.3)  # as if that noise were larger than stated
        assert sought(data).found.best.names > {"pulley_radius"}
    with monkeypatch.context() as structure:
        # as if what the pulley alone leaves were no noise
        structure.setattr(
            compared,
            "is_not_noise",
            lambda _setting, fit, _kinds: fit.terms.names == ("pulley_radius",),
        )
        assert sought(data).found.best.names > {"pulley_radius"}
    monkeypatch.setattr(compared, "by_own_noise", lambda _setting, _found, _may_be: OwnNoise())
    assert sought(data).found.best.names > {"pulley_radius"}


def test_the_evidence_of_a_fit_is_greatest_with_the_noise_that_it_leaves() -> None:
    found = sought(correlated())
    setting, best = found.calibration.setting, found.found.best.joint
    by_size = [
        own_noise.evidence_by_own_noise(
            setting, found.found, replace(best, colour=best.colour.hotter(factor))
        )
        for factor in (0.7, 1.0, 1.4)
    ]
    assert by_size[1] > max(by_size[0], by_size[2]) + 3.0


@pytest.mark.parametrize("again", [False, True])
def test_what_may_be_noise_is_told_as_less_probable_unless_the_noise_is_still_another(
    monkeypatch: pytest.MonkeyPatch, again: bool
) -> None:
    noise = {frozenset[str](): 0.4, frozenset({"pulley_radius"}): 0.6}

    def own(_setting: object, found: ComparedSets, _may_be: object) -> OwnNoise:
        return OwnNoise(found.best.joint if again else None, noise)

    monkeypatch.setattr(compared, "by_own_noise", own)
    chance = sought(correlated()).classes.of("pulley_radius")
    assert chance > 0.99 if again else chance == pytest.approx(0.4)


def test_only_kinds_whose_noise_was_stated_can_be_louder_than_that() -> None:
    colour = Colour(np.array([2.0, 1.2, 1.0]), np.zeros(3))
    assert compared._louder(colour, ["position", "orientation"])
    assert not compared._louder(colour, ["orientation", "tension"])
    assert not compared._louder(colour, [])
