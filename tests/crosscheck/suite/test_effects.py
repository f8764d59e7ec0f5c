"""Effects as cases of a run: what stands against seecr's mathematics, and how they end."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from crosscheck.suite.effects import (
    LOADS,
    Counterpart,
    EffectCase,
    EffectResult,
    against_line,
    effect_cases,
    effect_cells,
    effects_line,
    shipped_effect_cases,
)
from crosscheck.suite.verdicts import Outcome
from crosscheck.twin.robot import TRUE_EFFECTS
from seecr.description.mjcf import model_path

PARALLEL = model_path("demobot_parallel")
ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture
def good() -> EffectResult:
    small = np.array([1e-12, 3e-12])
    case = EffectCase(PARALLEL, "backlash")
    return EffectResult(case, small, 2 * small, 3 * small, np.ones(2, dtype=bool), 1e-4, 0.5)


def test_every_effect_is_a_case_of_each_robot():
    cases = effect_cases(("demobot_parallel", PARALLEL), seed=3)
    assert [case.effect for case in cases] == 2 * [*TRUE_EFFECTS, LOADS]
    assert {case.seed for case in cases} == {3}
    assert cases[0].name == f"effect-demobot_parallel-{TRUE_EFFECTS[0]}"


def test_sag_is_run_where_it_is_large_and_tensions_go_with_the_weight(good):
    *_, last = shipped_effect_cases(seed=2)
    assert last.name == "effect-cogiro_large-cable_weight" and last.seed == 2
    assert good.limits[2] == pytest.approx(1e-6)
    heavy = replace(good, case=last)
    assert heavy.limits[2] == pytest.approx(1e-6 * 91.058 / 0.4)
    line = effects_line([good, good, heavy])
    assert "on 1 robot, cable_weight on cogiro_large against" in line
    bad = replace(good, position_m=np.array([1.0, 1.0]))
    assert ": 1 of 2 cases does not agree: " in effects_line([good, bad])
    assert ": 2 of 2 cases do not agree: " in effects_line([bad, bad])


def test_the_seed_draws_the_size():
    sizes = [EffectCase(PARALLEL, "platform_mass", seed).term.vector[0] for seed in (0, 0, 1)]
    assert sizes[0] == sizes[1] != sizes[2]
    # slow creep, which both sides see alike
    creep = EffectCase(PARALLEL, "creep").term
    assert dict(zip(creep.layout.names, creep.vector, strict=True))["time_s"] == 2000.0


def test_thirteen_effects_stand_against_our_own_mathematics():
    cases = effect_cases(("demobot_parallel",))
    ours = [case.effect for case in cases if case.against is Counterpart.OURS]
    assert len(ours) == 13 and len(TRUE_EFFECTS) == 27
    sensing = {name for name in TRUE_EFFECTS if name.startswith(("tracker", "tension"))}
    assert sensing <= set(ours)
    assert not {"pulley_radius", "cable_weight", "stiffness", "frame_compliance"} & set(ours)


def test_the_pages_say_how_many():
    for file, said in (
        ("CHANGELOG.md", "14 by MuJoCo's own means, 13 by our own mathematics written a second"),
        ("docs/architecture.md", "MuJoCo has means of its own for 14"),
        ("docs/architecture.md", "It has none for the other 13"),
    ):
        assert said in " ".join((ROOT / file).read_text(encoding="utf-8").split()), file


def test_results_and_summary_say_what_stood_against_an_effect(good):
    assert good.as_json()["against"] is Counterpart.OURS
    assert good.as_json()["poses"] == {"total": 2, "unsolved": 0}
    other = replace(good, case=EffectCase(PARALLEL, "pulley_radius"))
    line = against_line([good, other])
    assert line == (
        "Checked against our own mathematics, written a second time: backlash. "
        "Checked against MuJoCo's own means: pulley_radius."
    )
    assert effect_cells(other)[-1] == "MuJoCo's own means"


@pytest.mark.parametrize(
    ("change", "outcome"),
    [
        ({}, Outcome.AGREE),
        ({"position_m": np.array([0.0, 2e-8])}, Outcome.DIFFER),
        ({"orientation_rad": np.array([2e-7, 0.0])}, Outcome.DIFFER),
        ({"tension_N": np.array([2e-6, 0.0])}, Outcome.DIFFER),
        ({"compared": np.array([True, False])}, Outcome.NOT_CONVERGED),
        # what was not compared does not differ
        ({"compared": np.array([True, False]), "position_m": np.array([0.0, 1.0])},
         Outcome.NOT_CONVERGED),
        ({"compared": np.array([False, True]), "position_m": np.array([0.0, 1.0])}, Outcome.DIFFER),
    ],
)  # fmt: skip
def test_how_an_effect_ends(good, change, outcome):
    assert replace(good, **change).outcome is outcome


def test_a_difference_outweighs_a_solve_without_an_answer():
    every = [Outcome.AGREE, Outcome.NOT_CONVERGED, Outcome.DIFFER]
    assert Outcome.of_all(every) is Outcome.DIFFER
    assert Outcome.of_all(every[:2]) is Outcome.NOT_CONVERGED
    assert Outcome.of_all([]) is Outcome.NOT_CONVERGED
    assert [one.exit_status for one in every] == [0, 3, 1]
