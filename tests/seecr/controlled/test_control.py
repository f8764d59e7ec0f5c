"""Schemes of control: what they feed forward, the command, and what is refused."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from called import BARE, as_json, ran, refused_in_a_line
from passive_files import FOLDER, KINDS
from recordings import Readback
from scipy.linalg import null_space
from shown import Page

import crosscheck
import seecr
from crosscheck.show.control import write_timed_recording
from seecr.controlled.belief import Belief, TensionLimits
from seecr.controlled.stiffest import stiffest_tensions
from seecr.pose import Array
from seecr.show.control import control_figure, schemes_json, write_control_recording

COGIRO = seecr.load_robot("demobot_cogiro")
POSES = np.array([[x, 0.25, 0.15, 1, 0, 0, 0] for x in (0.2, 0.4, 0.6)])
TEXT = "cmd_x_m,cmd_y_m,cmd_z_m\n0.2,0.25,0.15\n0.4,0.25,0.15\n"


@pytest.fixture(autouse=True)
def in_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("poses.csv").write_text(TEXT)
    Path("true.toml").write_text('[[effect]]\nname = "stiffness"\nparameters = { factor = 0.8 }\n')


@pytest.mark.parametrize("name", [*seecr.model_names(), *(f"{kind}.xml" for kind in KINDS)])
def test_open_loop_is_what_sweep_and_correct_say(name: str) -> None:
    """To rounding, on every shipped robot, whatever the truth is; passive lines are left alone."""
    from crosscheck.suite.cases import robot_sweep

    robot = seecr.load_robot(FOLDER / name if name.endswith("xml") else seecr.model_path(name))
    poses = robot_sweep(robot, 4)
    true = [seecr.Term.of(robot, "stiffness", factor=0.9)]
    believed = [seecr.Term.of(robot, "platform_mass", added_kg=0.01 * robot.mass)]
    found = seecr.control(
        robot, poses, scheme=["geometric", "elastic"], true=true, believes=believed
    )
    swept = seecr.solve(robot, poses, effects=true)
    corrected = seecr.correct(robot, poses, effects=believed)
    known = corrected.found
    there = seecr.solve(robot, corrected.commands.rows(np.flatnonzero(known)), effects=true)
    for mine, other in (
        (found["geometric"].solution, swept),
        (found["elastic"].solution.rows(known), there),
    ):
        assert mine.pose == pytest.approx(other.pose, abs=1e-12)
        assert mine.tensions == pytest.approx(other.tensions, abs=1e-9 * robot.usual_load)
    assert np.array_equal(found["elastic"].told[known], corrected.lengths[known])
    assert np.isnan(found["elastic"].solution.pose[~known]).all()
    still = [found[one].told[:, ~robot.driven] for one in ("geometric", "elastic")]
    assert np.nanmax(np.abs(still - robot.rest_lengths[~robot.driven]), initial=0.0) == 0.0


@pytest.mark.parametrize("scheme", ["stiffness", "elastic+pose_feedback", "tension_feedback"])
def test_a_block_and_tackle_is_as_many_ropes_with_a_part_of_the_tension_each(scheme: str) -> None:
    """With limits of its line it is told, step by step, what a plain cable of all falls is."""
    falls = np.array([1.0, 2.0, 4.0, 1.0, 0.5, 2.0, 3.0, 1.0])
    true = [seecr.Term.of(COGIRO, "stiffness", factor=0.8)]
    plain, reeved = (
        seecr.control(
            robot, POSES, scheme=scheme, true=true, lowest=0.3 / robot.falls,
            highest=20.0 / robot.falls,
        )[scheme]
        for robot in (COGIRO, replace(COGIRO, falls=falls))
    )  # fmt: skip
    assert reeved.told == pytest.approx(plain.told, abs=1e-12)
    assert reeved.travel == pytest.approx(plain.travel * falls, abs=1e-12)
    assert reeved.solution.tensions == pytest.approx(plain.solution.tensions / falls, abs=1e-9)
    for name in ("within", "steps", "settled"):
        assert np.array_equal(getattr(reeved, name), getattr(plain, name))


def stiffness_of(robot: seecr.Robot, tensions: Array) -> Array:
    """K (6, 6) of a free robot at its reference pose, rotations times its length, in closed form:
    minus the derivative of sum (u, b x u) tau, with tensions that follow each cable's law.
    """
    arm = robot.anchor_points  # its reference orientation is none
    span = robot.exit_points - robot.reference_pose[:3] - arm
    length = np.linalg.norm(span, axis=1)
    pull = span / length[:, None]
    out = np.zeros((6, 6))
    for k, (b, u) in enumerate(zip(arm, pull, strict=True)):
        column = np.concatenate([u, np.cross(b, u)])
        # EA/l0 = (EA + tau)/l of a linear cable
        out += (robot.ea[k] + tensions[k]) / length[k] * np.outer(column, column)
        cross = np.array([[0, -b[2], b[1]], [b[2], 0, -b[0]], [-b[1], b[0], 0]])
        moves = np.hstack([np.eye(3), -cross])  # of the anchor point
        across = np.eye(3) - np.outer(u, u)
        out += tensions[k] / length[k] * moves.T @ across @ moves
        # the arm turns with the platform: symmetric, as the energy's second derivative is
        turned = 0.5 * (np.outer(b, u) + np.outer(u, b)) - (b @ u) * np.eye(3)
        out[3:, 3:] -= tensions[k] * turned
    size = np.repeat([1.0, 1.0 / robot.length], 3)
    return out * np.outer(size, size)


@pytest.mark.parametrize("passive", [(), ("cable3",)])
@pytest.mark.parametrize("along", ["least", "z", "rx"])
def test_no_tensions_within_the_limits_are_stiffer(along: str, passive: tuple[str, ...]) -> None:
    """Of all on a fine grid of what balances, and it is the stiffness that solving says.

    A passive line pulls with what its stretch makes of it: 0.1 %, since it is wound no more.
    """
    robot = seecr.load_robot(seecr.model_path("ipanema"), passive)
    robot = replace(robot, rest_lengths=robot.rest_lengths / np.where(robot.driven, 1.0, 1.001))
    driven, pulled = robot.driven, robot.ea * (robot.reference_lengths / robot.rest_lengths - 1.0)
    low, high = 100.0, 1000.0
    belief = Belief(
        robot, [], seecr.Commands(robot.reference_pose[None]), TensionLimits(low, high, stiff=along)
    )
    best = np.where(driven, 0.0, pulled)
    best[driven] = stiffest_tensions(belief)[0]
    arm = robot.anchor_points
    pull = robot.exit_points - robot.reference_pose[:3] - arm
    pull /= np.linalg.norm(pull, axis=1, keepdims=True)
    matrix = np.vstack([pull.T, np.cross(arm, pull).T])
    load = np.array([0, 0, robot.weight, *np.cross(robot.centre_of_mass, [0, 0, robot.weight])])
    assert matrix @ best == pytest.approx(load, abs=1e-6 * high)

    def size(tensions: Array) -> float:
        matrix = stiffness_of(robot, tensions)
        if along == "least":
            return float(np.linalg.eigvalsh(matrix)[0])
        k = ("x", "y", "z", "rx", "ry", "rz").index(along)
        return 1.0 / float(np.linalg.inv(matrix)[k, k])

    spare = np.zeros((robot.n_cables, robot.n_driven - 6))
    spare[driven] = null_space(matrix[:, driven])
    grid = np.linspace(-1200.0, 1200.0, 41 if spare.shape[1] == 2 else 1601)
    steps = np.stack(np.meshgrid(*spare.shape[1] * [grid]), axis=-1).reshape(-1, spare.shape[1])
    others = best + steps @ spare.T
    kept = np.all(((others >= low) & (others <= high))[:, driven], axis=1)
    sizes = [size(one) for one in others[kept]]
    assert len(sizes) > 30 and size(best) >= max(sizes) * (1.0 - 1e-9)
    found = seecr.control(
        robot, robot.reference_pose[None], scheme=["elastic", "stiffness"],
        lowest=low, highest=high, stiff=along,
    )  # fmt: skip
    there = found["stiffness"].solution
    assert there.tensions[0] == pytest.approx(best, abs=1e-3)
    if along == "least":
        assert there.smallest_eigenvalue[0] == pytest.approx(size(best), rel=1e-5)
        assert there.smallest_eigenvalue[0] > found["elastic"].solution.smallest_eigenvalue[0]


def test_a_scheme_of_ones_own() -> None:
    class Higher(seecr.FeedForward):
        """A little above."""

        name = "higher"

        def commands(self, belief: Any) -> Any:
            up = belief.commands.pose + np.array([0, 0, 1e-3, 0, 0, 0, 0])
            return seecr.Commands(up), np.ones(len(up), dtype=bool)

    found = seecr.control(COGIRO, POSES, scheme=[seecr.Scheme("higher", Higher()), "geometric"])
    higher, plain = (found[name].solution.pose[:, 2] for name in ("higher", "geometric"))
    assert higher - plain == pytest.approx(np.full(3, 1e-3), rel=1e-2)
    assert found["higher"].solution.command == pytest.approx(POSES)


def test_poses_without_a_command_have_no_answer() -> None:
    class Picky(seecr.FeedForward):
        """Knows the first pose alone."""

        name = "picky"

        def commands(self, belief: Any) -> Any:
            return belief.commands, np.arange(len(belief.commands)) == 0

    feedback = seecr.Scheme.named("pose_feedback").feedbacks
    for loops in ((), feedback):
        for true in ([], [seecr.Term.of(COGIRO, "hysteresis", amplitude_N=0.01, stretch_m=1e-3)]):
            scheme = seecr.Scheme("picky", Picky(), loops)
            found = seecr.control(COGIRO, POSES, scheme=scheme, true=true)
            one = found["picky"]
            assert one.rests.tolist() == one.settled.tolist() == [True, False, False]
            for values in (one.solution.pose, one.solution.tensions, one.told, one.believed):
                assert np.isfinite(values[0]).all() and np.isnan(values[1:]).all()
            assert "the platform does not come to rest at 2 of 3: poses 1, 2" in str(one)
            rows = schemes_json(found)["picky"]["rows"]
            words = [getattr(row["status"], "name", row["status"]) for row in rows]
            assert words == ["CONVERGED", "no_command", "no_command"]


def test_the_command_writes_what_python_gives() -> None:
    said = ran("seecr control demobot_cogiro poses.csv --is true.toml --gain 0.8 --out out", 0)
    document = json.loads(Path("out/control.json").read_text())
    assert {"control.csv", "control.json", "control.png", "control.rrd"} == {
        file.name for file in Path("out").glob("[!.]*")
    }
    swept = as_json("seecr sweep demobot_cogiro poses.csv --model true.toml --out s")["rows"]
    schemes = document["schemes"]
    assert list(schemes) == ["geometric", "elastic", "pose_feedback"]
    for mine, other in zip(schemes["geometric"]["rows"], swept, strict=True):
        assert set(other) <= set(mine) and mine["command"] == other["command"]
        for key in ("pose", "deviation_m", "rotation_rad", "tensions_N", "smallest_eigenvalue"):
            assert mine[key] == pytest.approx(other[key], rel=1e-9, abs=1e-12)
        assert (mine["slack"], mine["status"]) == (other["slack"], other["status"])
    found = seecr.control(
        COGIRO, POSES[:2], scheme="pose_feedback", gain=0.8,
        true=[seecr.Term.of(COGIRO, "stiffness", factor=0.8)],
    )["pose_feedback"]  # fmt: skip
    head = schemes["pose_feedback"]
    assert head["position_rms_m"] == pytest.approx(found.position_rms)
    assert head["spectral_radius"] == pytest.approx(found.radius) and len(found.radius) == 2
    assert schemes["geometric"]["spectral_radius"] is None
    assert head["orientation_rms_rad"] == pytest.approx(found.orientation_rms)
    rows = Path("out/control.csv").read_text().splitlines()
    assert len(rows) == 1 + 3 * 2 and rows[0].startswith("scheme,want_x_m,")
    assert "each step leaves 0.2" in said.stdout and "gains below 2 hold" in said.stdout
    assert "next: " in said.stdout and "crosscheck control demobot_cogiro" in said.stdout


def test_poses_that_nothing_holds_are_said() -> None:
    Path("far.csv").write_text("cmd_x_m,cmd_y_m,cmd_z_m\n0.17,0.25,0.1\n0.4,0.25,0.1\n")
    said = ran(
        "seecr control demobot_parallel far.csv --scheme pose_feedback --steps 30 "
        "--no-recording", 0,
    ).stdout  # fmt: skip
    assert "no lengths were found that hold the pose: the loop winds on at 1: line 2" in said
    assert "settles at 1 of 2" in said
    document = json.loads(Path("seecr-control/control.json").read_text())
    one = document["schemes"]["pose_feedback"]
    assert one["spectral_radius"][0] is None and one["spectral_radius"][1] < 1.0
    assert one["settled"] == [False, True] and one["steps"][0] is None


def test_a_loop_that_runs_away_ends_where_winches_do() -> None:
    """Above its exit points more cable lowers the platform: it ran off for 706 m, and 'settled'."""
    high = np.array([[0.4, 0.25, 0.7, 1, 0, 0, 0]])
    found = seecr.control(COGIRO, high, scheme="pose_feedback")["pose_feedback"]
    assert not found.settled[0] and np.isnan(found.radius[0])
    assert found.told.max() < 10.0 * COGIRO.reach and found.position_rms < 10.0 * COGIRO.reach
    assert "the loop winds on at 1" in str(found) and "settles" not in str(found)


LOOP = "elastic+pose_feedback"
LESS = "holds at none of these poses, even where the robot is as believed; expected a gain below"
REFUSED = {
    "--gain 3 --scheme pose_feedback": f"scheme pose_feedback: a gain of 3 {LESS} 2",
    f"--gain 0.9 --delay 0.31 --rate 10 --scheme {LOOP}": (
        f"scheme {LOOP}: a gain of 0.9 and a delay of 4 steps {LESS} 0.347"
    ),
    "--scheme pose_feedback --reads tensions": (
        "scheme pose_feedback: for pose_feedback it needs readings of position or orientation, and "
        "this robot reads tensions; leave the scheme out, or say what is read"
    ),
    "--scheme tension_feedback --reads position,orientation": (
        "scheme tension_feedback: for tension_feedback it needs readings of tensions, and this "
        "robot reads position and orientation"
    ),
    "--scheme tension_feedback --holding cable1,cable2,cable3": (
        "scheme tension_feedback: if cable1, cable2, cable3 hold tensions, only 5 winches hold "
        "lengths, which leaves the platform free to move: cables hold 6 degrees of freedom there; "
        "expected at most 2 that hold tensions"
    ),
    # a band that is slack here holds nothing, but keeps its length
    "--scheme tension_feedback --passive cable8 --holding cable1,cable2": (
        "if cable1, cable2 hold tensions, only 5 winches and 1 spring hold lengths"
    ),
    "--scheme tension_feedback --passive cable8 --holding cable8": (
        "tension_feedback: expected cables of demobot_cogiro that hold tensions, of cable1, "
        "cable2, cable3, cable4, cable5, cable6, cable7; got cable8"
    ),
    "--scheme tension_feedback --holding cable9": "that hold tensions, of cable1, ",
    f"--passive {','.join(COGIRO.cable_names)}": "no winch drives any of its lines",
    "--scheme pid": "scheme 'pid': expected geometric, elastic, stiffness, pose_feedback, ",
    "--scheme geometric+elastic": (
        "scheme 'geometric+elastic': expected one feed-forward and feedbacks on top of it"
    ),
    "--scheme stiffness --stiff up": "'up' is not one of 'least', 'x', 'y', 'z', 'rx', 'ry', 'rz'",
    "--gain 0": "gain: expected a number above 0, got 0",
    "--rate 0": "rate: expected a number above 0",
    "--delay -1": "delay: expected a number from 0 on [s], got -1",
    "--reads eyes": "reads: expected some of position, orientation, tensions, got eyes",
    "--believes other.toml": "other.toml: line 1: effect cable_stiffness: ",
    "--is other.toml": "other.toml: line 1: effect cable_stiffness: ",
}


@pytest.mark.parametrize("program", ["seecr", "crosscheck"])
@pytest.mark.parametrize("options", REFUSED)
def test_bad_input_is_one_sentence_and_nothing_is_written(program: str, options: str) -> None:
    Path("other.toml").write_text(OTHER)
    before = set(Path().iterdir())
    line = refused_in_a_line(f"{program} control demobot_cogiro poses.csv {options}")
    assert REFUSED[options] in line
    assert set(Path().iterdir()) == before


OTHER = '[[effect]]\nname = "cable_stiffness"\nparameters = { factor_99 = 1.1 }\n'


@pytest.mark.parametrize("program", ["seecr", "crosscheck"])
def test_lengths_are_no_wanted_poses(program: str) -> None:
    Path("lengths.csv").write_text("length_1_m,length_2_m\n1,1\n")
    assert "lengths.csv" in refused_in_a_line(f"{program} control demobot_cogiro lengths.csv")
    ran("seecr correct demobot_cogiro poses.csv --out c", 0)
    line = refused_in_a_line(f"{program} control demobot_cogiro c/corrected.csv")
    assert "contains rest lengths; expected the wanted poses" in line


@pytest.mark.parametrize("program", ["seecr", "crosscheck"])
def test_where_solving_fails_the_status_says_so(program: str) -> None:
    """No command within the limits, or no rest on cables that stretch to the floor and beyond."""
    said = ran(
        f"{program} control demobot_cogiro poses.csv --scheme elastic --highest 0.01 --out few", 3
    ).stdout  # fmt: skip
    words = {"seecr": "rests at no pose", "crosscheck": "elastic: no command for any of the poses"}
    assert words[program] in said and (Path("few") / "control.json").exists()
    text = seecr.model_path("planar_vertical").read_text(encoding="utf-8")
    Path("soft.xml").write_text(re.sub('stiffness="[^"]*"', 'stiffness="0.01"', text))
    Path("one.csv").write_text("cmd_x_m,cmd_y_m,cmd_z_m\n0.4,0,0.3\n")
    ran(f"{program} control soft.xml one.csv --scheme geometric --out soft {BARE}", 3)
    assert json.loads((Path("soft") / "control.json").read_text())["exit_status"] == 3


def test_robots_without_a_cable_to_spare_have_no_tensions_to_control() -> None:
    robot = seecr.load_robot("planar_two_cable")
    with pytest.raises(seecr.InputError, match="has no taut cable to spare at these poses"):
        seecr.control(robot, robot.reference_pose, scheme="tension_feedback")
    with pytest.raises(seecr.InputError, match="stiffness grows with the tensions without end"):
        ipanema = seecr.load_robot("ipanema")
        seecr.control(ipanema, ipanema.reference_pose, scheme="stiffness", lowest=10.0)
    with pytest.raises(seecr.InputError, match="expected least or one of x, y, z, rx, ry, rz"):
        seecr.control(COGIRO, POSES, scheme="stiffness", stiff="up")


# --- The page on schemes of control prints what it shows


PAGE = Path(__file__).resolve().parents[3] / "docs" / "control.md"


@pytest.mark.slow
def test_the_page_works_as_written(tmp_path: Path) -> None:
    page = Page(tmp_path)
    page.run(PAGE.read_text(encoding="utf-8"))
    used = [tuple(command.split()[:2]) for command in page.commands]
    assert used == [("seecr", "control"), ("seecr", "control"), *2 * [("crosscheck", "control")]]


# --- Recordings and figures of control: what they show is what was computed


SHOWN = np.array([[x, 0.25, 0.15, 1, 0, 0, 0] for x in (0.3, 0.4, 0.5)])
TRUE = [seecr.Term.of(COGIRO, "stiffness", factor=0.7)]


def test_a_recording_shows_wanted_believed_true_and_read(tmp_path: Path) -> None:
    tracker = seecr.Term.of(COGIRO, "tracker_frame", shift_x_m=0.01)
    found = seecr.control(COGIRO, SHOWN, scheme="elastic", true=[*TRUE, tracker])
    write_control_recording(found, tmp_path / "one.rrd")
    seen = Readback(tmp_path / "one.rrd")
    one = found["elastic"]
    for name, poses in (
        ("wanted", SHOWN), ("believed", SHOWN), ("elastic", one.solution.pose),
        ("read", one.solution.pose + np.array([0.01, 0, 0, 0, 0, 0, 0])),
    ):  # fmt: skip
        centres = np.array(seen.column(f"/scene/{name}/platform", "Boxes3D:centers"))[:, 0]
        assert np.allclose(centres, poses[:, :3], atol=2e-6), name
    off = np.linalg.norm(one.solution.deviation[:, :3], axis=1)
    assert np.allclose(seen.scalars("/plot/error/elastic"), np.log10(1e3 * off))


def test_several_schemes_are_drawn_beside_each_other(tmp_path: Path) -> None:
    names = ["geometric", "elastic+pose_feedback"]
    found = seecr.control(COGIRO, SHOWN, scheme=names, true=TRUE)
    write_control_recording(found, tmp_path / "two.rrd")
    drawn = Readback(tmp_path / "two.rrd").entities("pose")
    assert {"/scene/wanted/platform", "/scene/geometric/platform"} <= drawn
    assert sum(entity.endswith("/platform") for entity in drawn) == 3
    for kind in ("png", "svg"):
        control_figure(tmp_path / f"two.{kind}", found)
    text = (tmp_path / "two.svg").read_text()
    for words in (*names, "position error [mm]", "rotation error [°]", "wanted x [mm]", "step"):
        assert words in text


def test_a_timed_recording_goes_by_the_clock(tmp_path: Path) -> None:
    timing = crosscheck.Timing(0.2, 2.0, 5.0)
    given = {"scheme": "elastic+pose_feedback", "true": TRUE, "timing": timing}
    one = crosscheck.control_in_time(COGIRO, SHOWN[:2], **given)["elastic+pose_feedback"]
    write_timed_recording(one, tmp_path / "timed.rrd")
    seen = Readback(tmp_path / "timed.rrd")
    drawn = seen.entities("settling_time")
    assert {f"/scene/{who}/platform" for who in ("wanted", "believed", "read", "mujoco")} <= drawn
    assert {
        "/plot/error/elastic\\+pose_feedback",
        "/plot/tension/cable1",
        "/plot/winches/cable8",
    } <= drawn
    assert np.allclose(seen.seconds("/plot/error/elastic\\+pose_feedback"), one.trace.t, atol=1e-6)
    pulls = seen.scalars("/plot/tension/cable3", "settling_time")
    assert np.allclose(pulls, one.trace.tensions[:, 2])
