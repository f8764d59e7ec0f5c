"""The suite's cases in both physics: agreement, stiffness, findings, limits, and processes."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mujoco_modes import mujocos_modes
from published import caspr_files, wirex_file

import seecr
from crosscheck import user_cases
from crosscheck.errors import CrosscheckError
from crosscheck.settle.settler import Settler, Settling, SettlingBatch, screw_motion
from crosscheck.suite import agreement, verdicts
from crosscheck.suite import run as suite
from crosscheck.suite.agreement import FindingLimits, gap, load_thresholds
from crosscheck.suite.cases import (
    Case,
    demobot_sweep,
    select,
    shipped_cases,
)
from crosscheck.suite.results import CaseResult, failure_lines, finding_lines, remarks
from crosscheck.suite.run import run_case, run_suite
from crosscheck.suite.verdicts import Outcome, Verdict
from seecr import correct
from seecr.description.mjcf import CABLES, model_path
from seecr.errors import ExecutorError
from seecr.importing.caspr import read_caspr
from seecr.importing.draft import Draft
from seecr.importing.wirex import read_wirex
from seecr.pose import pose_add, pose_difference, quat_from_rotvec, quat_multiply

PARALLEL, COGIRO = model_path("demobot_parallel"), model_path("demobot_cogiro")
# Near a corner of the frame two taut cables are left, and their line meets the centre of mass.
CORNER = np.array([0.13489155, 0.11259351, 0.07598101, 1.0, 0.0, 0.0, 0.0])


def case_of(model: Path, poses, *, mujoco_model: Path | None = None, cable="vectran") -> Case:
    return Case("small", model, mujoco_model or model, cable, "random", np.atleast_2d(poses))


def with_stiffer_cable(model: Path, folder: Path, factor: float, cable: int = 0) -> Path:
    """A copy of an MJCF with one stiffness changed."""
    import xml.etree.ElementTree as ET

    tree = ET.parse(model)
    tendon = tree.getroot().findall("tendon/spatial")[cable]
    tendon.set("stiffness", repr(float(tendon.get("stiffness")) * factor))
    path = folder / f"changed_{model.name}"
    tree.write(path)
    return path


def with_eigenvalue(settling: Settling, eigenvalue: float, residual: float = 1e-9) -> Settling:
    """A settling as if the robot were that soft [N/m], and so much were left unbalanced."""
    same = {"residual": residual, "settled_residual": residual}
    return replace(settling, smallest_eigenvalue=eigenvalue, **same)


@pytest.fixture(scope="module")
def ends() -> dict[tuple[str, float], CaseResult]:
    """Both ends of the parallel configuration's sweeps, on both cables."""
    thresholds = load_thresholds()
    return {
        (cable, z): run_case(case_of(PARALLEL, demobot_sweep(z, 2), cable=cable), thresholds)
        for cable in CABLES
        for z in (0.1, 0.2)
    }


# --- both physics --------------------------------------------------------------------------


@pytest.mark.parametrize("z", [0.1, 0.2])
@pytest.mark.parametrize("cable", list(CABLES))
def test_parallel_tilts_with_four_slack_cables_in_both_physics(ends, cable, z):
    result = ends[cable, z]
    expected = {0.1: 26.5, 0.2: 22.0}[z]
    # Vectran is the paper's stiffer cable; fishing line gives way a little more
    for pose in (result.solution.pose, result.settling.pose):
        tilt = np.rad2deg(2 * np.arccos(np.abs(pose[:, 3])))
        np.testing.assert_allclose(tilt, expected, atol=0.6 if cable == "fishing" else 0.3)
    assert np.all(result.solution.slack.sum(axis=1) == 4)
    assert np.all(result.settling.slack.sum(axis=1) == 4)
    assert list(result.verdict) == [Verdict.AGREES] * 2
    assert result.outcome is Outcome.AGREE


def test_agreement_leaves_room(ends):
    # far inside the thresholds: what is left is rounding, not luck
    for result in ends.values():
        assert all(worst.ratio < 0.05 for worst in result.worst.values())


# --- findings ------------------------------------------------------------------------------


def test_a_platform_free_to_turn_is_a_finding():
    limits = FindingLimits(free_to_move=("small 0",))
    result = run_case(case_of(PARALLEL, CORNER), replace(load_thresholds(), findings=limits))
    assert result.solution.slack[0].sum() == 6
    assert result.difference.orientation_rad[0] > 1e-3  # each stops somewhere on the free turn
    assert list(result.verdict) == [Verdict.NEUTRAL]
    (finding,) = result.findings
    assert finding.mujoco_stays
    assert finding.seecr_stays
    assert math.isclose(finding.energy_seecr_J, finding.energy_mujoco_J, rel_tol=1e-12)
    assert finding.tension_N < 1e-9
    assert "free to move" in finding.text
    assert result.outcome is Outcome.AGREE
    assert result.worst == {}  # nothing that is determined was compared: it is not a pass


def test_a_platform_free_to_turn_does_not_hide_a_difference(tmp_path):
    changed = with_stiffer_cable(PARALLEL, tmp_path, 1.001, cable=0)
    case = case_of(PARALLEL, CORNER, mujoco_model=changed, cable=None)
    result = run_case(case, load_thresholds())
    assert result.solution.tensions[0, 0] > 1.0
    assert list(result.verdict) == [Verdict.DIFFERS]


@pytest.mark.parametrize(
    "position",
    [
        (0.20595110609282666, 0.37673559530147904, 0.17198490620527784),
        (0.6080615721734167, 0.38888280018700916, 0.20581767053691352),
    ],
)
def test_a_cable_on_the_border_of_slack_is_polished_and_holds_nothing(position):
    # On its free turn the platform stops where a third cable is about to pull: the polish must
    # balance the forces there, and not take that cable's rounding for stiffness.
    one, pose = Settler(PARALLEL, ea=1000.0), np.array([*position, 1.0, 0, 0, 0])
    settling = one.settle(pose, one.paid_out(pose[None])[0])
    assert settling.settled, settling.status.value
    assert settling.residual < 1e-11
    third = np.sort(settling.tensions)[-3]
    assert 0.0 <= third < 1e-9
    assert settling.free_to_move


SEESAW = """<mujoco>
  <option gravity="0 0 -9.81"/>
  <worldbody>
    <site name="A1" pos="-1 0 0"/><site name="A2" pos="1 0 0"/>
    <body name="platform">
      <joint name="tilt" type="hinge" axis="0 1 0"/>
      <inertial pos="0 0 0.2" mass="1" diaginertia="0.01 0.01 0.01"/>
      <site name="B1" pos="-0.1 0 0.2"/><site name="B2" pos="0.1 0 0.2"/>
    </body>
  </worldbody>
  <tendon>
    <spatial springlength="0 0.95" stiffness="100"><site site="A1"/><site site="B1"/></spatial>
    <spatial springlength="0 0.95" stiffness="100"><site site="A2"/><site site="B2"/></spatial>
  </tendon>
</mujoco>"""


@pytest.fixture
def seesaw(tmp_path) -> Path:
    """A mass on top of a hinge between two loose cables: it rests to the left or to the right."""
    path = tmp_path / "seesaw.xml"
    path.write_text(SEESAW)
    return path


def seesaw_answers(path: Path) -> verdicts.Answers:
    """SEECR to the one side, MuJoCo to the other, of the same command."""
    command = np.array([[0.0, 0, 0, 1, 0, 0, 0]])
    left, right = (np.r_[0.0, 0, 0, quat_from_rotvec(np.array([0, a, 0]))] for a in (-0.4, 0.4))
    robot, side = seecr.load_robot(path), Settler(path)
    solution = seecr.solve(robot, command, start=left[None])
    told = side.paid_out(command)
    settling = SettlingBatch([side.settle(right, told[0])])
    allowance = agreement.allowances(load_thresholds(), solution, settling)
    difference = agreement.differences_of(solution, settling, allowance.tension_N)
    return verdicts.Answers(side, told, solution, settling, difference, allowance)


def test_two_stable_equilibria_are_a_finding_with_both_energies(seesaw):
    answers = seesaw_answers(seesaw)
    assert answers.difference.orientation_rad[0] > 0.2
    verdict, (finding,) = verdicts.judge_poses(answers)
    assert list(verdict) == [Verdict.BRANCH]
    assert finding.mujoco_stays
    assert finding.seecr_stays
    # mirror images
    assert math.isclose(finding.energy_seecr_J, finding.energy_mujoco_J, rel_tol=1e-9)
    assert f"{finding.energy_mujoco_J:.9g} J" in finding.text


def test_an_answer_that_mujoco_leaves_is_no_equilibrium(seesaw):
    answers = seesaw_answers(seesaw)
    # SEECR's answer, moved by a hundredth of a radian: it is stable for nobody
    wrong = pose_add(answers.solution.pose, np.array([[0, 0, 0, 0, 0.01, 0]]))
    answers = answers._replace(solution=replace(answers.solution, pose=wrong))
    verdict, (finding,) = verdicts.judge_poses(answers)
    assert list(verdict) == [Verdict.DIFFERS]
    assert finding.mujoco_stays is False
    assert "MuJoCo leaves" in finding.text


def test_mujoco_that_does_not_settle_is_unsolved(monkeypatch):
    settler = Case.settler

    def impatient(case):
        one = settler(case)
        one.max_steps = 5
        return one

    monkeypatch.setattr(Case, "settler", impatient)
    result = run_case(case_of(COGIRO, demobot_sweep(0.1, 2)), load_thresholds())
    assert list(result.verdict) == [Verdict.MUJOCO_UNSOLVED] * 2
    assert np.isnan(result.difference.position_m).all()
    assert result.outcome is Outcome.NOT_CONVERGED


# --- agreement -----------------------------------------------------------------------------


def test_thresholds_widen_only_where_residual_over_stiffness_is_more(ends):
    result = ends["vectran", 0.1]
    thresholds = load_thresholds()
    assert not result.allowance.widened.any()
    assert np.all(result.allowance.position_m == 1e-8)
    soft = SettlingBatch(
        with_eigenvalue(one, eigenvalue, residual=1e-9)
        for one, eigenvalue in zip(result.settling, (1e-2, 1e3), strict=True)
    )
    solution = result.solution
    wide = agreement.allowances(thresholds, solution, soft)
    force = solution.tables.scale * (solution.residual + 1e-9)
    np.testing.assert_allclose(wide.position_m, [force[0] / 1e-2, 1e-8])
    length = solution.robot.length
    np.testing.assert_allclose(wide.orientation_rad, [force[0] / 1e-2 / length, 1e-7])
    assert np.all(wide.tension_N == 1e-6)
    assert list(wide.widened) == [True, False]
    lost = replace(solution, residual=np.array([np.inf, np.nan]))
    assert not agreement.allowances(thresholds, lost, soft).widened.any()
    none = SettlingBatch(with_eigenvalue(one, 0.0) for one in soft)
    assert not agreement.allowances(thresholds, solution, none).widened.any()


def test_a_cable_slack_for_one_only_matters_when_the_other_pulls(ends):
    result = ends["vectran", 0.1]
    slack = int(np.argmax(result.solution.slack[0]))
    for tension, same in ((1e-9, True), (1e-3, False)):
        tensions, mask = result.solution.tensions.copy(), result.solution.slack.copy()
        tensions[0, slack], mask[0, slack] = tension, False
        changed = replace(result.solution, tensions=tensions, slack=mask)
        difference = agreement.differences_of(changed, result.settling, np.full(2, 1e-6))
        assert difference.slack_same[0] == same
        assert difference.tension_N[0] == pytest.approx(tension, rel=1e-3)
        # also where tensions may differ by that much
        generous = replace(result.allowance, tension_N=np.full(2, 1.0))
        assert agreement.within(difference, generous)[0] == same


# --- limits of findings --------------------------------------------------------------------


def finding(pose: int, verdict: Verdict) -> verdicts.PoseFinding:
    return verdicts.PoseFinding(pose, verdict, "found")


@pytest.fixture
def wide() -> Case:
    """A case of ten poses."""
    return case_of(PARALLEL, np.tile(CORNER, (10, 1)))


def beyond(limits: FindingLimits, case: Case, *found: verdicts.PoseFinding) -> list[int]:
    return [one.pose for one in verdicts.held_to(limits, case, found) if one.beyond_limits]


def test_branches_are_counted(wide):
    two = finding(2, Verdict.BRANCH), finding(5, Verdict.BRANCH)
    assert beyond(FindingLimits(branches=0), wide, *two) == [2, 5]
    assert beyond(FindingLimits(branches=1), wide, *two) == [2, 5]
    assert beyond(FindingLimits(branches=2), wide, *two) == []
    # what fails by itself is no matter of limits
    assert beyond(FindingLimits(), wide, finding(1, Verdict.DIFFERS)) == []


def test_a_platform_may_be_free_to_move_where_that_is_named(wide):
    free = finding(3, Verdict.NEUTRAL), finding(4, Verdict.NEUTRAL)
    assert beyond(FindingLimits(free_to_move=("small 3",)), wide, *free) == [4]
    assert beyond(FindingLimits(free_to_move=("small *",)), wide, *free) == []
    assert beyond(FindingLimits(free_to_move=("other 3", "small 34")), wide, *free) == [3, 4]
    # names are for poses that everybody has
    assert beyond(FindingLimits(free_elsewhere=1.0), wide, *free) == [3, 4]


@pytest.mark.slow
def test_elsewhere_a_share_may_be_free_to_move(wide):
    drawn = replace(wide, has_names=False)
    free = [finding(i, Verdict.NEUTRAL) for i in range(3)]
    assert beyond(FindingLimits(free_elsewhere=0.3), drawn, *free) == []
    assert beyond(FindingLimits(free_elsewhere=0.2), drawn, *free) == [0, 1, 2]
    assert all(case.has_names for case in shipped_cases(0))
    drawn_too = {case.name for case in shipped_cases(1) if not case.has_names}
    assert drawn_too == {case.name for case in shipped_cases() if case.name.endswith("-random")}


def test_a_finding_beyond_the_limits_fails_its_case():
    """Both physics are right here, and still the run is not: nobody said it may be free to move."""
    allowed = replace(load_thresholds(), findings=FindingLimits(free_to_move=("small 0",)))
    assert run_case(case_of(PARALLEL, CORNER), allowed).outcome is Outcome.AGREE
    result = run_case(case_of(PARALLEL, CORNER), load_thresholds())
    assert list(result.verdict) == [Verdict.NEUTRAL]
    assert result.outcome is Outcome.DIFFER
    assert remarks(result) == "1 free to move (1 beyond limits)"
    (line,) = failure_lines(result)
    assert line.endswith("(beyond the limits in thresholds.toml)")
    assert finding_lines(result) == []


# --- running -------------------------------------------------------------------------------


@pytest.mark.slow
def test_processes_give_the_same_results_in_the_same_order():
    few = [
        replace(case, poses=case.poses[:3])
        for case in select(shipped_cases(), ["parallel-vectran-*", "planar-two-cable"])
    ]
    seen: list[str] = []
    alone = run_suite(few, load_thresholds(), progress=lambda r: seen.append(r.case.name)).results
    assert seen == [case.name for case in few]
    together = run_suite(few, load_thresholds(), jobs=2).results
    for one, two, case in zip(alone, together, few, strict=True):
        assert one.case.name == two.case.name == case.name
        assert np.array_equal(one.solution.pose, two.solution.pose)
        assert np.array_equal(one.settling.pose, two.settling.pose)
        assert np.array_equal(one.settling.tensions, two.settling.tensions)
        assert list(one.verdict) == list(two.verdict)


def test_a_process_that_was_killed_is_told_with_what_to_do(monkeypatch):
    def broken(*_args):
        raise ExecutorError("the executor ended before its work")

    monkeypatch.setattr(suite, "run_tasks", broken)
    words = r"one of 2 processes was killed, perhaps for lack of memory; try --jobs 1"
    with pytest.raises(CrosscheckError, match=words):
        run_suite(["planar-two-cable", "camera-sweep"], jobs=2)


AXIS = np.array([0.48, -0.6, 0.64])


def turned(angle: float) -> np.ndarray:
    """A pose turned by an angle about AXIS from one that is turned itself."""
    home = quat_from_rotvec(np.array([0.3, -1.1, 0.7]))
    return np.r_[1.0, 2.0, 3.0, quat_multiply(quat_from_rotvec(angle * AXIS), home)]


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-9, 1e-5, 0.1, 2.0, 3.0, np.pi - 1e-6])
def test_the_angle_is_that_of_the_turn(angle):
    distance, found = gap(turned(angle), turned(0.0))
    assert distance == 0.0
    assert found == pytest.approx(angle, rel=1e-7, abs=4e-16 if angle < 1 else 1e-9)


def test_both_rotations_of_two_random_poses_say_the_same():
    random = np.random.default_rng(2)
    a, b = random.normal(size=(2, 50, 7))
    a[:, 3:] /= np.linalg.norm(a[:, 3:], axis=1, keepdims=True)
    b[:, 3:] /= np.linalg.norm(b[:, 3:], axis=1, keepdims=True)
    distance, angle = gap(a, b)
    change = pose_difference(a, b)
    np.testing.assert_allclose(distance, np.linalg.norm(change[:, :3], axis=1), rtol=1e-14)
    np.testing.assert_allclose(angle, np.linalg.norm(change[:, 3:], axis=1), rtol=1e-7)


def draft_of(folder: Path, name: str) -> Draft:
    if name == "hrpcables":
        return read_wirex(wirex_file(folder, name))
    return read_caspr(*caspr_files(folder, name), None).with_options(ea="1e5N")


@pytest.mark.slow
@pytest.mark.parametrize("name", ["cogiro", "kntu_planar", "example_spherical", "hrpcables"])
def test_a_published_robot_agrees_with_mujoco(name: str, tmp_path: Path) -> None:
    robot, _notes = draft_of(tmp_path, name).robot()
    if robot.joints:  # nothing loads these at home
        tight = correct(robot, robot.reference_pose[None], lowest=10.0).commands.lengths
        assert tight is not None
        robot = replace(robot, rest_lengths=tight[0])
    path = tmp_path / f"{name}.xml"
    robot.save(path)
    run = run_suite(user_cases(path, n_random=6))
    assert run.outcome is Outcome.AGREE
    assert all(result.compared.all() for result in run.results)


NAMES = (
    "cogiro-vectran-turned", "parallel-fishing-turned", "parallel-vectran-tilted", "uneven-turned",
    "off-centre-turned", "planar-two-cable-inverted", "planar-vertical-vectran-turned",
    "planar-horizontal-fishing-turned", "cogiro-large-sweep", "ipanema-sweep", "camera-sweep",
)  # fmt: skip


@pytest.fixture(scope="module")
def shipped():
    return {case.name: case for case in shipped_cases(n_random=1)}


@pytest.mark.parametrize("name", NAMES)
def test_stiffness_and_frequencies_at_rest_are_mujocos(name, shipped):
    result = run_case(shipped[name], load_thresholds())
    solution, mujoco = result.solution, result.case.settler()
    np.testing.assert_allclose(
        solution.smallest_eigenvalue, result.settling.smallest_eigenvalue, rtol=1e-5
    )
    scale = np.where(solution.robot.hinges, solution.robot.length, 1.0)
    for i in range(0, len(result), 5):
        command, pose = solution.command[i], result.settling.pose[i]
        stiffness, frequencies = mujocos_modes(mujoco, pose, command)
        own = np.linalg.eigvalsh(solution.stiffness[i] / np.outer(scale, scale))
        np.testing.assert_allclose(own, stiffness, rtol=1e-5, atol=1e-6 * stiffness[-1])
        np.testing.assert_allclose(solution.frequencies[i], frequencies, rtol=1e-5)


def test_a_screw_keeps_to_a_fixed_axis():
    random = np.random.default_rng(7)
    point, axis = random.normal(size=3), np.array([0.6, 0.0, 0.8])
    start = np.r_[random.normal(size=3), quat_from_rotvec(random.normal(size=3))]

    def turned(angle):
        from seecr.pose import quat_multiply, quat_rotate

        q = quat_from_rotvec(angle * axis)
        return np.r_[point + quat_rotate(q, start[:3] - point), quat_multiply(q, start[3:])]

    path = screw_motion(start, turned(1.2), 5)
    for pose, angle in zip(path, (0, 0.3, 0.6, 0.9, 1.2), strict=True):
        assert np.abs(pose_difference(pose, turned(angle))).max() < 1e-14
    shift = screw_motion(start, pose_add(start, np.array([1.0, 2, 3, 0, 0, 0])), 3)
    np.testing.assert_allclose(shift[1, :3], start[:3] + np.array([0.5, 1, 1.5]), atol=1e-14)
