"""What to do next: by what the error goes with, and never by a word of it."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from made_data import soft_cogiro, term
from made_diagnoses import nothing

from crosscheck.comparison.associations import Association
from crosscheck.comparison.quantities import EVERYWHERE, QuantityKind
from crosscheck.diagnosis import advice as what_next
from crosscheck.diagnosis.advice import check_of, measure_next
from crosscheck.diagnosis.path import ModelPath
from crosscheck.fit.reasons import DiagnosisVerdict
from crosscheck.inference.fields import Varying
from crosscheck.planning.planned import Adding
from crosscheck.planning.proposer import Gain, Suggestion
from seecr.effects import Term, catalogue, layout_of


@pytest.fixture(scope="module")
def found() -> ModelPath:
    path = nothing().path
    assert path is not None
    return path


def advice(found: ModelPath, *where: Association) -> str:
    line, other = measure_next(found, [], DiagnosisVerdict.UNKNOWN_EFFECT, where)
    assert "crosscheck calibrate fits all effects at once" in other
    return line


def goes_with(kind: QuantityKind, words: str) -> Association:
    return Association(kind, words, "readings", 0.6, 1e-9, "x", "m", ())


@pytest.mark.parametrize(
    ("kind", "expected"),
    [
        (QuantityKind.PLACE, "measure more poses along it"),
        (QuantityKind.RUN, "zero the winches and check the tracker before each run"),
        (QuantityKind.TIME, "stay at one pose and read it"),
        (QuantityKind.TEMPERATURE, "stay at one pose and read it"),
        (QuantityKind.TENSION, "repeat the same poses forward, back and an hour later"),
        (QuantityKind.CABLE, "repeat the same poses forward, back and an hour later"),
    ],
)
def test_the_unknown_is_looked_for_where_it_goes(
    found: ModelPath, kind: QuantityKind, expected: str
) -> None:
    for words in ("commanded z", "the run", "time", "anything"):
        line = advice(found, goes_with(kind, words))
        assert line.startswith(f"the unexplained error depends on {words}: {expected}")


def test_beside_a_constant_offset_it_is_looked_for_where_the_rest_goes(found: ModelPath) -> None:
    """Once it was said to depend on nothing, where it also varied over the workspace."""
    offset = goes_with(QuantityKind.EVERYWHERE, EVERYWHERE)
    start = "a constant offset is 60 % of the mean square of the unexplained error; "
    line = advice(found, offset, goes_with(QuantityKind.PLACE, "commanded z"))
    assert line.startswith(f"{start}the rest depends on commanded z: measure more poses along it")
    assert advice(found, offset) == (
        f"{start}repeat the same poses forward, back and an hour later, to see what the error "
        "depends on"
    )


def test_what_tells_an_effect_from_several_others_is_said_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    signals = {
        "platform_mass": {"record the cable tensions": 90.0, "add a payload": 40.0},
        "cable_stiffness": {"record the cable tensions": 50.0, "add poses": 20.0},
        "external_wrench": {},
    }

    def ways(_plan: object, _options: object, name: str, rival: Any) -> list[Suggestion]:
        return [
            Suggestion(Adding.TENSIONS, words, (Gain(name, rival.name, 3.0, then, 15.0),))
            for words, then in signals[rival.name].items()
        ]

    monkeypatch.setattr(what_next, "telling_apart", ways)
    rivals = [SimpleNamespace(name=name) for name in signals]
    effect: Any = SimpleNamespace(effect="stiffness", rivals=rivals)
    nothing: Any = None
    mass, cables, wrench, each = what_next._to_separate(nothing, [], effect)
    assert mass == (
        "to tell stiffness from platform_mass: weigh the platform, or add a payload "
        "(signal that separates them: 3 now, 40 then, 15 needed)"
    )
    assert cables.endswith(
        "each cable, or add poses (signal that separates them: 3 now, 20 then, 15 needed)"
    )
    assert wrench.startswith("to tell stiffness from external_wrench: hang a known weight on a ")
    assert wrench.endswith(
        "none of the further poses, payloads and tensions tried here separates them"
    )
    assert each == (
        "to tell stiffness from platform_mass, cable_stiffness: record the cable tensions "
        "(signal that separates the closest of them: 3 now, 50 then, 15 needed)"
    )


def test_what_shows_as_a_hose_is_taken_off_first(found: ModelPath) -> None:
    unknown = DiagnosisVerdict.UNKNOWN_EFFECT
    first, *others = measure_next(found, [], unknown, (), seen=[Varying.SPRING])
    assert first == (
        "to find something that pulls the platform like a spring: take hoses and leads off the "
        "platform, or hang them elsewhere, and measure some poses again; an error that changes "
        "comes from their pull"
    )
    assert others == measure_next(found, [], unknown, (), seen=[Varying.READINGS])


def test_where_nothing_is_missing_the_plan_is_named(found: ModelPath) -> None:
    (line,) = measure_next(found, [], DiagnosisVerdict.NO_EFFECT_MISSING, ())
    assert "crosscheck plan" in line


@pytest.mark.parametrize(
    ("effect", "values", "expected"),
    [
        ("platform_mass", {"added_kg": 0.047}, "expect 0.447 kg, not 0.4"),
        ("stiffness", {"factor": 0.5}, "expect E S = {half:.4g} N, not {ea:.4g}"),
        ("cable_stiffness", {"factor_3": 0.5}, "E S = {half:.4g} N, not {ea:.4g}"),
        ("centre_of_mass", {"shift_z_m": 0.01}, "at (0, 0, {z:.1f}) mm of its frame, not"),
        ("cable_length_offset", {"offset_2_m": 0.01}, "(offset_2: {longer:.1f} mm paid out, not"),
        ("exit_point_error", {"error_1_x_m": 0.004}, "(error_1_x: {x:.1f} mm, not"),
        ("pulley_radius", {"radius_m": 0.0099}, "expect a radius of 9.9 mm"),
        ("cable_weight", {"weight_N_per_m": 0.02}, "expect 0.20 N"),
    ],
)
def test_checks_name_totals(effect: str, values: dict[str, float], expected: str) -> None:
    robot = soft_cogiro()
    ea = float(robot.ea[0])
    words = expected.format(
        ea=ea, half=0.5 * ea, z=1e3 * robot.centre_of_mass[2] + 10.0,
        longer=1e3 * robot.rest_lengths[1] + 10.0, x=1e3 * robot.exit_points[0, 0] + 4.0,
    )  # fmt: skip
    assert words in check_of(term(robot, effect, **values), robot)


@pytest.mark.parametrize(
    ("effect", "values", "error", "expected"),
    [
        ("pulley_radius", {"radius_m": 0.0099}, 2.3e-6, "a radius of 9.90 mm"),
        ("platform_mass", {"added_kg": 0.047}, 2e-4, "expect 0.4470 kg, not 0.4000"),
        ("stiffness", {"factor": 1.512}, 0.1, "expect E S = 450 N, not 300"),
        ("stiffness", {"factor": 6.0}, 6.0, "expect E S = 2000 N, not 300"),
        ("centre_of_mass", {"shift_z_m": -0.01}, 1.5e-3, "(0, 0, -10) mm of its frame"),
        ("cable_length_offset", {"offset_2_m": 0.01}, 1.5e-3, "the largest +10 mm (offset_2: "),
        ("pulley_radius", {"radius_m": 0.0099}, np.inf, "a radius of 9.9 mm"),
    ],
)
def test_checks_have_the_digits_that_errors_leave(
    effect: str, values: dict[str, float], error: float, expected: str
) -> None:
    robot = soft_cogiro()
    some = term(robot, effect, **values)
    assert expected in check_of(some, robot, np.full(len(some.vector), error))


def test_what_the_data_do_not_determine_is_not_what_to_expect() -> None:
    robot = soft_cogiro()
    some = term(robot, "exit_point_error", error_1_x_m=0.002, error_3_y_m=0.027)
    errors = np.full(len(some.vector), 1e-4)
    assert "error_3_y" in check_of(some, robot, errors)
    errors[some.layout.names.index("error_3_y_m")] = np.inf
    assert "+2 mm (error_1_x" in check_of(some, robot, errors).replace("2.0 mm", "2 mm")
    hangs = term(robot, "centre_of_mass", shift_x_m=0.003, shift_z_m=0.013)
    check = check_of(hangs, robot, np.array([1e-4, 1e-4, np.inf]))
    assert "at (3.00, 0, ?) mm of its frame, not (0, 0, 0)" in check
    upright = term(robot, "gravity_tilt", tilt_y_rad=0.01)
    assert "expect ? deg about x and 0.573 deg about y" in check_of(
        upright, robot, np.array([np.inf, 1e-4])
    )
    # a value on its bound is what it is
    firm = term(robot, "frame_compliance", sideways_m_per_N=8e-6)
    assert "expect 0.0080 mm per newton sideways, 0 mm upwards" in check_of(
        firm, robot, np.array([1e-7, np.inf])
    )
    # where nothing is determined the largest is as good as any
    assert "error_3_y" in check_of(some, robot, np.full(len(errors), np.inf))


@pytest.mark.parametrize(
    ("effect", "values"),
    [
        ("platform_mass", {"added_kg": -8.8}),
        ("platform_mass", {"added_kg": -0.4}),
        ("cable_weight", {"weight_N_per_m": 11.9}),
        ("pulley_radius", {"radius_m": 0.3}),
        ("cable_length_offset", {"offset_2_m": -2.0}),
        ("nonlinear_elasticity", {"quadratic": -1e6}),
        ("centre_of_mass", {"shift_x_m": 3.0}),
    ],
)
def test_nothing_impossible_is_ever_said(effect: str, values: dict[str, float]) -> None:
    robot = soft_cogiro()
    impossible = term(robot, effect, **values)
    words = check_of(impossible, robot)
    assert not impossible.is_possible(robot) and not any(c.isdigit() for c in words)
    assert "no robot can have the values that fit these data best" in words


def test_every_check_has_all_its_numbers() -> None:
    """What a text names is there, for every effect of the catalogue."""
    robot = soft_cogiro()
    for effect in catalogue().values():
        layout = layout_of(effect, robot)
        some = Term(layout, np.clip(layout.null + 0.5 * layout.scale, layout.lower, layout.upper))
        words = check_of(some, robot)
        assert some.is_possible(robot) and "{" not in words, words
