"""Errors planted on one side of the suite: for each of them it goes red and names the case.

SEECR's side is changed in the tables that its solver reads, in what it is asked and in what it
answers; MuJoCo's in the model that it settles. A few poses of five cases are enough for each.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from crosscheck.settle.physics import Physics
from crosscheck.settle.settler import Settler, Settling
from crosscheck.suite import effects as effects_suite
from crosscheck.suite import run as suite
from crosscheck.suite import verdicts
from crosscheck.suite.agreement import load_thresholds
from crosscheck.suite.cases import Case, shipped_cases
from crosscheck.suite.effects import EffectCase, run_effect
from crosscheck.suite.run import Run, run_suite, verdict_line
from crosscheck.suite.verdicts import Outcome
from crosscheck.suite.write import junit_xml
from seecr.compiled import columns
from seecr.description.mjcf import model_path
from seecr.effects import catalogue
from seecr.equilibrium import search
from seecr.pose import quat_conjugate, quat_from_rotvec, quat_multiply

pytestmark = pytest.mark.slow

CROSSED, TILTED, UNEVEN, OFF_CENTRE, PLANAR = (
    "cogiro-vectran-turned",
    "parallel-fishing-z0.10",
    "uneven-turned",
    "off-centre-turned",
    "planar-vertical-vectran-turned",
)
POSES = {
    CROSSED: [2, 13],
    TILTED: [0, 9],
    UNEVEN: [3, 17],
    OFF_CENTRE: [5, 20],
    PLANAR: [4],
}
THRESHOLDS = load_thresholds()

Patch = pytest.MonkeyPatch


@cache
def few_cases() -> tuple[Case, ...]:
    every = {case.name: case for case in shipped_cases(n_random=1)}
    return tuple(
        replace(every[name], poses=every[name].poses[rows]) for name, rows in POSES.items()
    )


def run_of_few(*names: str) -> Run:
    """The few, or those of these names."""
    return run_suite([c for c in few_cases() if not names or c.name in names], THRESHOLDS)


# --- ways to plant an error --------------------------------------------------------------------


Plant = Callable[[Patch], None]


def wrong(
    owner: Any, name: str, given: Callable[..., Any] | None = None,
    answer: Callable[[Any], Any] | None = None,
) -> Plant:  # fmt: skip
    """A function is given other arguments, or its answer is changed on its way."""

    def plant(patch: Patch) -> None:
        honest = getattr(owner, name)

        def changed(*arguments: Any, **options: Any) -> Any:
            found = honest(*(given(*arguments) if given else arguments), **options)
            return answer(found) if answer else found

        patch.setattr(owner, name, changed)

    return plant


def tables(edit: Callable[[Any], None]) -> Plant:
    """SEECR's solver reads other tables: ``cables`` (n, m, columns) and ``load`` (n, columns)."""

    def answer(table: Any) -> Any:
        edit(table)
        return table

    return wrong(search, "assemble", answer=answer)


def cable(column: int, factor: float, which: int | slice = 0, part: int = 0) -> Plant:
    """A number of one cable, or of all, times a factor."""

    def edit(table: Any) -> None:
        if isinstance(which, slice) or which < table.cables.shape[1]:
            table.cables[:, which, column + part] *= factor

    return tables(edit)


def load(column: int, factor: float, size: int = 3) -> Plant:
    def edit(table: Any) -> None:
        table.load[:, column : column + size] *= factor

    return tables(edit)


def asked(edit: Callable[[np.ndarray], np.ndarray]) -> Plant:
    """SEECR is asked for other poses."""
    return wrong(suite, "seecr_solve", given=lambda robot, poses: (robot, edit(poses)))


def answered(edit: Callable[[Any], Any]) -> Plant:
    """SEECR's answer is changed on its way to the comparison."""
    return wrong(suite, "seecr_solve", answer=edit)


def described(edit: Callable[[Any], Any]) -> Plant:
    """SEECR reads another robot than the one in the file."""
    return wrong(suite, "load_robot", answer=edit)


def model(name: str, factor: float) -> Plant:
    """MuJoCo's own model of the robot is another one."""

    def given(physics: Physics, own: Any, *rest: Any) -> Any:
        getattr(own, name).__imul__(factor)
        return physics, own, *rest

    return wrong(Physics, "__init__", given)


def spring(name: str, factor: float, where: Any) -> Plant:
    """MuJoCo's cables are other springs than those asked for."""

    def plant(patch: Patch) -> None:
        honest = Physics.set_cables

        def set_cables(self: Physics, *arguments: Any) -> None:
            honest(self, *arguments)
            getattr(self.model, name)[where] *= factor

        patch.setattr(Physics, "set_cables", set_cables)

    return plant


# --- the errors --------------------------------------------------------------------------------


def turn_back(poses: np.ndarray) -> np.ndarray:
    return np.concatenate([poses[:, :3], quat_conjugate(poses[:, 3:])], axis=1)


def unturned(poses: np.ndarray) -> np.ndarray:
    return np.concatenate([poses[:, :3], np.tile([1.0, 0, 0, 0], (len(poses), 1))], axis=1)


def rolled(poses: np.ndarray) -> np.ndarray:
    """On its head: the platform hangs in its cables there as well."""
    turn = quat_from_rotvec(np.deg2rad([145.0, 0.0, 0.0]))
    return np.concatenate([poses[:, :3], quat_multiply(turn, poses[:, 3:])], axis=1)


def swap_exits(table: Any) -> None:
    at = slice(columns.EXIT, columns.EXIT + 3)
    table.cables[:, [0, 1], at] = table.cables[:, [1, 0], at]


def mirror_anchor(table: Any) -> None:
    table.cables[:, 0, columns.ANCHOR + 1] *= -1.0
    table.cables[:, 0, columns.ANCHOR] *= -1.0


def base_frame_centre(table: Any) -> None:
    """The centre of mass is not turned with the commanded platform."""
    at = slice(columns.CENTRE_OF_MASS, columns.CENTRE_OF_MASS + 3)
    from seecr.pose import quat_rotate

    table.load[:, at] = quat_rotate(quat_conjugate(table.poses[:, 3:]), table.load[:, at])


def longer_cable(table: Any) -> None:
    more = 0.001 * table.cables[:, 1, columns.REST]
    table.cables[:, 1, columns.REST] += more
    table.cables[:, 1, columns.GAP] -= more


def stretch_over_length(table: Any) -> None:
    """Strain over the nominal instead of the paid-out length."""
    nominal = table.cables[..., columns.REST] + table.cables[..., columns.GAP]
    table.cables[..., columns.EA] *= 1.003 * table.cables[..., columns.REST] / nominal


def first_of_each_pair(values: np.ndarray) -> np.ndarray:
    return values.reshape(len(values), -1, 2)[:, :, [1, 0]].reshape(values.shape)


def wrong_branch(patch: Patch) -> None:
    """SEECR starts on the platform's head, and stays there."""
    honest = suite.seecr_solve

    def solve(robot: Any, poses: np.ndarray, **options: Any) -> Any:
        if robot.joints:
            return honest(robot, poses, **options)
        return honest(robot, poses, **{**options, "start": rolled(poses)})

    patch.setattr(suite, "seecr_solve", solve)


def other_start(side: Settler, starts: np.ndarray, rest: np.ndarray) -> Any:
    return side, rolled(starts) if side.physics.is_free else starts, rest


def everything_counts_as_free(patch: Patch) -> None:
    """No stiffness is enough to be one: whatever the poses, both physics would confirm it."""
    patch.setattr(Settling, "free_to_move", property(lambda settling: settling.settled))


def gravity(physics: Physics, _wrench: Any = None, _gravity: Any = None) -> Any:
    return physics, None, 1.001 * physics.reference_gravity


@dataclass(frozen=True)
class Fault:
    """What is wrong, how to plant it, and a case that has to go red."""

    name: str
    plant: Plant
    case: str = CROSSED
    exit_status: int = 1


WEIGHT, CENTRE = columns.FORCE_OF_WEIGHT, columns.CENTRE_OF_MASS
KGF = 1.0 / 9.80665

FAULTS = (
    # SEECR's tables
    Fault("stiffness of one cable 0.1 % off", cable(columns.EA, 1.001)),
    Fault("stiffness of all cables 0.1 % off", cable(columns.EA, 1.001, slice(None)), TILTED),
    Fault("stiffness of a soft cable 0.1 % off", cable(columns.EA, 1.001, 3), UNEVEN),
    Fault("strain over the wrong length", tables(stretch_over_length), TILTED),
    Fault("rest length of one cable 0.1 % off", tables(longer_cable), OFF_CENTRE),
    Fault("exit point 0.1 % off along x", cable(columns.EXIT, 1.001, 4), UNEVEN),
    Fault("exit point 0.1 % off along z", cable(columns.EXIT, 1.001, 2, 2), PLANAR),
    Fault("anchor point 0.1 % off", cable(columns.ANCHOR, 1.001), CROSSED),
    Fault("anchor point of the wrong sign", tables(mirror_anchor), TILTED),
    Fault("anchor points in millimetres", cable(columns.ANCHOR, 1e3, slice(None), 0), PLANAR),
    Fault("two cables confused", tables(swap_exits), CROSSED),
    Fault("a cable dropped", cable(columns.EA, 1e-9, 1), CROSSED),
    Fault("weight 0.1 % off", load(WEIGHT, 1.001), PLANAR),
    Fault("weight upwards", load(WEIGHT, -1.0), CROSSED),
    Fault("weight in kilograms", load(WEIGHT, KGF), TILTED),
    Fault("centre of mass ignored", load(CENTRE, 0.0), OFF_CENTRE),
    Fault("centre of mass of the wrong sign", load(CENTRE, -1.0), OFF_CENTRE),
    Fault("centre of mass 0.1 % off", load(CENTRE, 1.001), OFF_CENTRE),
    Fault("centre of mass in the base frame", tables(base_frame_centre), OFF_CENTRE),
    # the robot as SEECR reads it
    Fault("one stiffness for all cables",
          described(lambda r: replace(r, ea=np.full_like(r.ea, r.ea[0]))), UNEVEN),
    Fault("stiffnesses in another order",
          described(lambda r: replace(r, ea=r.ea[::-1].copy())), UNEVEN),
    Fault("pretension ignored at the reference",
          described(lambda r: replace(r, rest_lengths=0.999 * r.rest_lengths)), PLANAR),
    Fault("reference pose 0.1 mm off", described(
        lambda r: replace(r, reference_pose=r.reference_pose + 1e-4 * np.eye(7)[2])), CROSSED),
    # what SEECR is asked, and what it answers
    Fault("commanded turn ignored", asked(unturned), PLANAR),
    Fault("commanded rotation transposed", asked(turn_back), CROSSED),
    Fault("answered rotation transposed",
          answered(lambda s: replace(s, pose=turn_back(s.pose))), TILTED),
    Fault("answered deviation of the wrong sign", answered(
        lambda s: replace(s, pose=np.c_[2 * s.command[:, :3] - s.pose[:, :3], s.pose[:, 3:]]))),
    Fault("the command for an answer", answered(lambda s: replace(s, pose=s.command)), TILTED),
    Fault("tensions 0.1 % off", answered(lambda s: replace(s, tensions=1.001 * s.tensions))),
    Fault("tensions in kilograms", answered(lambda s: replace(s, tensions=KGF * s.tensions))),
    Fault("tensions of the neighbour",
          answered(lambda s: replace(s, tensions=first_of_each_pair(s.tensions))), TILTED),
    Fault("slack cables told taut", answered(
        lambda s: replace(s, slack=s.slack & False, tensions=s.tensions + 1e-3 * s.slack)), TILTED),
    Fault("SEECR in another equilibrium", wrong_branch, CROSSED),
    # MuJoCo's side
    Fault("MuJoCo's stiffness 0.1 % off", spring("tendon_stiffness", 1.001, slice(None)), PLANAR),
    Fault("MuJoCo's rest length 0.1 % off", spring("tendon_lengthspring", 1.001, (0, 1))),
    Fault("MuJoCo's cable dropped", spring("tendon_stiffness", 1e-9, 2), OFF_CENTRE),
    Fault("MuJoCo's gravity 0.1 % off", wrong(Physics, "set_load", gravity), UNEVEN),
    Fault("MuJoCo's mass 0.1 % off", model("body_mass", 1.001)),
    Fault("MuJoCo's centre of mass 0.1 % off", model("body_ipos", 1.001), OFF_CENTRE),
    Fault("MuJoCo's sites 0.1 % off", model("site_pos", 1.001), TILTED),
    Fault("MuJoCo's tensions 0.1 % off", wrong(Physics, "tensions", answer=lambda t: 1.001 * t)),
    Fault("MuJoCo told the lengths of another pose",
          wrong(Settler, "paid_out", answer=lambda rest: np.roll(rest, 1, axis=0)), UNEVEN),
    Fault("MuJoCo in another equilibrium", wrong(suite, "settle_batch", other_start), CROSSED),
    Fault("everything counts as free to move", everything_counts_as_free, CROSSED),
)  # fmt: skip


def test_without_an_error_the_few_agree():
    run = run_of_few()
    assert run.outcome is Outcome.AGREE
    assert not any(result.findings for result in run.results)


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name.replace(" ", "_"))
def test_a_planted_error_makes_the_suite_fail_and_name_the_case(fault, monkeypatch):
    fault.plant(monkeypatch)
    run = run_of_few(fault.case, PLANAR)  # beside the quickest
    assert run.outcome.exit_status == fault.exit_status
    tests = ET.fromstring(junit_xml(run)).iter("testcase")
    red = {test.get("name") for test in tests if {part.tag for part in test} & {"failure", "error"}}
    assert fault.case in red
    assert sorted(red)[0] in verdict_line(run)


def test_another_equilibrium_is_no_error_of_either_physics(monkeypatch):
    """Each confirms the other's answer: only the limit of branches tells."""
    wrong_branch(monkeypatch)
    result = next(r for r in run_of_few().results if r.case.name == CROSSED)
    assert verdicts.Verdict.DIFFERS not in result.verdict
    assert all(one.beyond_limits for one in result.findings)
    assert np.rad2deg(result.difference.orientation_rad).max() > 90.0


# --- effects -----------------------------------------------------------------------------------


EFFECT_FAULTS = {
    "platform_mass": lambda e: replace(e, added=1.001 * e.added),
    "centre_of_mass": lambda e: replace(e, shift=-e.shift),
    "gravity_tilt": lambda e: replace(e, tilt_x=e.tilt_y, tilt_y=e.tilt_x),
    "external_wrench": lambda e: replace(e, moment=0.0 * e.moment),
    "exit_point_error": lambda e: replace(e, error=1.001 * e.error),
    "cable_stiffness": lambda e: replace(e, factor=e.factor[::-1].copy()),
    "frame_compliance": lambda e: replace(e, sideways=1.001 * e.sideways),
    "pulley_radius": lambda e: replace(e, radius=1.001 * e.radius),
    "tracker_frame": lambda e: replace(e, rotation=-e.rotation),
    "tracker_scale": lambda e: replace(e, factor=1.0 / e.factor),
    "tension_scale": lambda e: replace(e, factor=1.001 * e.factor),
    "drum_gain": lambda e: replace(e, gain=0.0 * e.gain),
    "length_scale": lambda e: replace(e, factor=1.001 * e.factor),
    "cable_length_offset": lambda e: replace(e, offset=np.roll(e.offset, 1)),
    "initial_pose_error": lambda e: replace(e, position=-e.position),
    "drum_eccentricity": lambda e: replace(e, sine=e.cosine, cosine=e.sine),
    "backlash": lambda e: replace(e, gap=1.01 * e.gap),
    "thermal_expansion": lambda e: replace(e, zero_temperature=e.zero_temperature + 0.1),
    "stiffness": lambda e: replace(e, factor=1.001 * e.factor),
    "nonlinear_elasticity": lambda e: replace(e, cubic=0.0 * e.cubic),
    "winch_side_length": lambda e: replace(e, length=1.001 * e.length),
    "cable_weight": lambda e: replace(e, weight=1.001 * e.weight),
    "hysteresis": lambda e: replace(e, stretch=1.01 * e.stretch),
    "creep": lambda e: replace(e, time=1.01 * e.time),
    "exit_friction": lambda e: replace(e, friction=1.01 * e.friction),
    "anchor_point_error": lambda e: replace(e, error=np.roll(e.error, 3)),
    "tracker_target": lambda e: replace(e, shift=1.001 * e.shift),
}


def test_every_effect_has_a_planted_error() -> None:
    assert EFFECT_FAULTS.keys() == catalogue().keys()


@pytest.mark.parametrize("name", EFFECT_FAULTS)
def test_a_planted_error_of_an_effect_is_named(name, monkeypatch):
    # the robot in MuJoCo has another effect than seecr is told
    edit = EFFECT_FAULTS[name]
    wrong(effects_suite, "measure", lambda r, c, e: (r, c, [edit(e[0])]))(monkeypatch)
    case = EffectCase(model_path("demobot_parallel"), name)
    result = run_effect(case)
    assert result.outcome is Outcome.DIFFER
    run = Run([], THRESHOLDS, seed=0, jobs=1, wall_s=0.0, effects=[result])
    assert run.outcome.exit_status == 1
    assert case.name in verdict_line(run)
