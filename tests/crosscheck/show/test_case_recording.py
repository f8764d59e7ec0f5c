"""Recordings, read back: their numbers are those of results.json, and nothing is left half done."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from recordings import Readback, headless_viewer
from rerun.chunk import RrdReader

from crosscheck.settle.relaxation import SettleStatus
from crosscheck.settle.settler import SettlingBatch
from crosscheck.show.case_recording import NOW, READ_ME, write_case_recording
from crosscheck.suite.agreement import load_thresholds
from crosscheck.suite.cases import Case, demobot_sweep, user_cases
from crosscheck.suite.results import CaseResult
from crosscheck.suite.run import Run, results_json, run_case
from crosscheck.suite.verdicts import Verdict
from seecr.description.mjcf import load_robot, model_path
from seecr.pose import quat_conjugate, quat_multiply
from seecr.show import scene
from seecr.show.colours import round_up, scale_colours
from seecr.statics.solution import Status

pytestmark = pytest.mark.slow

PARALLEL = model_path("demobot_parallel")
POSES = 6


def sweep_case(name: str = "parallel-fishing-z0.10") -> Case:
    return Case(name, PARALLEL, PARALLEL, "fishing", "sweep", demobot_sweep(0.1, POSES))


@pytest.fixture(scope="module")
def result() -> CaseResult:
    return run_case(sweep_case(), load_thresholds())


@pytest.fixture(scope="module")
def written(result: CaseResult, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("recording") / "case.rrd"
    write_case_recording(result, path)
    return path


@pytest.fixture(scope="module")
def back(written: Path) -> Readback:
    return Readback(written)


@pytest.fixture(scope="module")
def reported(result: CaseResult) -> dict[str, Any]:
    run = Run([result], load_thresholds(), seed=0, jobs=1, wall_s=0.0)
    case: dict[str, Any] = json.loads(results_json(run))["cases"][0]
    return case


def test_poses_are_counted_from_zero_on_one_timeline_and_two_are_of_place_and_time(
    back: Readback, written: Path
) -> None:
    assert back.timelines == {"pose", "x_mm", "settling_time"}
    assert back.column("/plot/deviation/seecr/dx", "pose") == list(range(POSES))
    assert {"Deviation from the command [mm]", "Rotation from the command [°]"} <= back.views
    (recording,) = RrdReader(written).recordings()
    assert recording.recording_id == "parallel-fishing-z0.10"
    assert recording.application_id == "crosscheck-parallel-fishing-z0-10"


@pytest.mark.parametrize("quantity", ["position", "orientation", "tension"])
def test_differences_are_those_of_results_json(
    back: Readback, reported: dict[str, Any], quantity: str
) -> None:
    key = {"position": "position_m", "orientation": "orientation_rad", "tension": "tension_N"}
    stored = np.array(reported["difference"][key[quantity]])
    drawn = 10.0 ** back.scalars(f"/plot/difference/{quantity}")
    np.testing.assert_allclose(drawn, np.maximum(stored, 1e-18), rtol=1e-12)
    limit = 10.0 ** back.scalars(f"/plot/limit/{quantity}")
    np.testing.assert_allclose(limit, reported["allowed"][key[quantity]], rtol=1e-12)
    plain = 10.0 ** back.scalars("/plot/plain_settling/position")
    np.testing.assert_allclose(plain, reported["difference"]["settled_position_m"], rtol=1e-12)


@pytest.mark.parametrize("who", ["seecr", "mujoco"])
def test_deviation_tilt_and_tension_of_both(back: Readback, result: CaseResult, who: str) -> None:
    answer = result.solution if who == "seecr" else result.settling
    for i, name in enumerate(("dx", "dy", "dz")):
        moved = answer.pose[:, i] - result.case.poses[:, i]
        drawn = back.scalars(f"/plot/deviation/{who}/{name}")
        np.testing.assert_allclose(drawn, 1e3 * moved, rtol=0, atol=1e-12)
    turn = quat_multiply(answer.pose[:, 3:], quat_conjugate(result.case.poses[:, 3:]))
    tilt = 2.0 * np.degrees(np.arccos(np.clip(np.abs(turn[:, 0]), 0.0, 1.0)))
    np.testing.assert_allclose(back.scalars(f"/plot/tilt/{who}/tilt"), tilt, atol=2e-6)
    # at the end of the paper's sweep
    assert back.scalars(f"/plot/tilt/{who}/about_y")[0] == pytest.approx(26.5, abs=0.1)
    for k in range(8):
        drawn = back.scalars(f"/plot/tension/{who}/cable{k + 1}")
        np.testing.assert_array_equal(drawn, answer.tensions[:, k])


def test_lanes_say_who_is_slack(back: Readback, result: CaseResult) -> None:
    for k in range(8):
        words = [row[0] for row in back.column(f"/lanes/cable{k + 1}", "StateChange:state")]
        assert words == ["slack" if s else "taut" for s in result.solution.slack[:, k]]
    assert sum(result.solution.slack[0]) == 4
    verdicts = [row[0] for row in back.column("/lanes/Verdict", "StateChange:state")]
    assert verdicts == [v.name.lower() for v in result.verdict]


def test_every_cable_is_drawn_taut_or_slack(back: Readback, result: CaseResult) -> None:
    taut = back.column("/scene/seecr/cables/taut", "LineStrips3D:strips")
    loose = back.column("/scene/seecr/cables/slack", "LineStrips3D:strips")
    for i, slack in enumerate(result.solution.slack):
        assert len(taut[i]) == 8 - slack.sum()
        assert len(loose[i]) == slack.sum() * scene.DASHES
    radius = back.static("/scene/seecr/cables/taut", "LineStrips3D:radii")[0]
    assert radius > back.static("/scene/seecr/cables/slack", "LineStrips3D:radii")[0]


def test_platforms_are_where_the_answers_are(back: Readback, result: CaseResult) -> None:
    for who, poses in (
        ("command", result.case.poses),
        ("seecr", result.solution.pose),
        ("mujoco", result.settling.pose),
    ):
        centres = back.column(f"/scene/{who}/platform", "Boxes3D:centers")
        np.testing.assert_allclose([c[0] for c in centres], poses[:, :3], atol=1e-7)
        quats = back.column(f"/scene/{who}/platform", "Boxes3D:quaternions")
        np.testing.assert_allclose(np.roll([q[0] for q in quats], 1, 1), poses[:, 3:], atol=1e-7)
    shades = {
        who: str(back.static(f"/scene/{who}/platform", "Boxes3D:colors"))
        for who in ("command", "seecr", "mujoco")
    }
    assert len(set(shades.values())) == 3
    fills = [back.static(f"/scene/{who}/platform", "Boxes3D:fill_mode")[0] for who in shades]
    assert fills == [1, 3, 1], "edges, solid, edges"


def test_the_settling_starts_at_the_command_and_ends_at_rest(
    back: Readback, result: CaseResult
) -> None:
    seconds = back.seconds("/plot/deviation/mujoco/dx")
    assert seconds[0] == 0.0 and np.all(np.diff(seconds) > 0.0) and seconds[-1] > 0.2
    moved = back.scalars("/plot/deviation/mujoco/dx", "settling_time")
    aim = back.scalars("/plot/deviation/seecr/dx", "settling_time")
    assert moved[0] == 0.0
    assert abs(aim[0]) == pytest.approx(34.4, abs=0.1), "an end of the sweep moves most"
    assert moved[-1] == pytest.approx(aim[-1], abs=1e-3)
    gap = back.scalars("/plot/difference/position", "settling_time")
    assert gap[0] > -2.0 and gap[-1] < -6.0


def test_the_text_has_the_guide_and_the_numbers(back: Readback, result: CaseResult) -> None:
    guide = back.static(f"/{READ_ME}", "TextDocument:text")[0]
    assert "parallel-fishing-z0.10" in guide and "settling_time" in guide
    worst = result.worst["tension_N"]
    assert f"| tension | {worst.value:.3g} N | {worst.pose} | 1e-06 N |" in guide
    now = [row[0] for row in back.column(f"/{NOW}", "TextDocument:text")]
    assert len(now) == POSES
    assert "Pose 0 (of 0 to 5)" in now[0] and "x 170.00, y 250.00, z 100.00 mm" in now[0]
    assert "26.5" in now[0] and "| slack | cable2, cable4, cable5, cable7 |" in now[0]
    x, y, z = 1e3 * (result.solution.pose[0, :3] - result.case.poses[0, :3])
    assert f"| SEECR moves by | dx {x:+.2f}, dy {y:+.2f}, dz {z:+.2f} mm |" in now[0]
    assert f"| MuJoCo differs by | {result.difference.position_m[0]:.3g} m |" in now[0]
    assert "Settling, " in back.column(f"/{NOW}", "TextDocument:text", "settling_time")[0][0]


@pytest.fixture(scope="module")
def failed(result: CaseResult) -> CaseResult:
    """A result whose second pose is no equilibrium in SEECR, and the third has none in MuJoCo."""
    status = result.solution.status.copy()
    status[1] = Status.STALLED  # with a pose all the same, which must not pass for an answer
    rows = list(result.settling)
    nothing = np.full(7, np.nan)
    rows[2] = dataclasses.replace(
        rows[2],
        status=SettleStatus.FELL,
        pose=nothing,
        settled_pose=nothing,
        tensions=np.full(8, np.nan),
    )
    verdict = result.verdict.copy()
    verdict[1], verdict[2] = Verdict.SEECR_UNSOLVED, Verdict.MUJOCO_UNSOLVED
    return dataclasses.replace(
        result,
        solution=dataclasses.replace(result.solution, status=status),
        settling=SettlingBatch(rows),
        verdict=verdict,
    )


def test_a_pose_without_an_answer_is_not_drawn(failed: CaseResult, tmp_path: Path) -> None:
    write_case_recording(failed, tmp_path / "failed.rrd")
    back = Readback(tmp_path / "failed.rrd")
    for who, missing in (("seecr", 1), ("mujoco", 2)):
        for entity, component in (
            (f"/scene/{who}/platform", "Boxes3D:centers"),
            (f"/scene/{who}/cables/taut", "LineStrips3D:strips"),
            (f"/scene/{who}/cables/slack", "LineStrips3D:strips"),
        ):
            counts = [len(row) for row in back.column(entity, component)]
            assert counts[missing] == 0 and counts[0] > 0, entity
    words = [row[0] for row in back.column("/lanes/cable1", "StateChange:state")]
    assert words[1:3] == ["no answer"] * 2
    assert np.isnan(back.scalars("/plot/deviation/seecr/dx")[1])
    words = back.column(f"/{NOW}", "TextDocument:text")[1][0]
    assert "SEECR moves by | no answer" in words and "SEECR turns by | no answer" in words
    guide = back.static(f"/{READ_ME}", "TextDocument:text")[0]
    assert f"- pose 1: {Verdict.SEECR_UNSOLVED.value}" in guide


def test_no_settling_to_watch(failed: CaseResult, tmp_path: Path) -> None:
    rows = [dataclasses.replace(row, status=SettleStatus.FELL) for row in failed.settling]
    nothing = dataclasses.replace(failed, settling=SettlingBatch(rows))
    write_case_recording(nothing, tmp_path / "nothing.rrd")
    back = Readback(tmp_path / "nothing.rrd")
    assert back.timelines == {"pose", "x_mm"}
    assert "settling_time" not in back.static(f"/{READ_ME}", "TextDocument:text")[0]


ODD = """<mujoco model="odd"><worldbody>{sites}
<body name="p" pos="{x} {x} {z}">{joints}<inertial pos="0 0 0" mass="{mass}" diaginertia="1 1 1"/>
<site name="B" pos="0 0 0"/></body></worldbody><tendon>{cables}</tendon></mujoco>"""


CABLE = """<spatial name="haul/{i} [port] ü" springlength="0 {length!r}" stiffness="{stiffness!r}">
<site site="A{i}"/><site site="B"/></spatial>"""


def odd_robot(path: Path, size: float, joints: str) -> Path:
    """Four cables to one point, on ``size`` metres, with names that are hard to write."""
    corners = [(0.0, 0.0), (size, 0.0), (size, size), (0.0, size)]
    length = float(np.linalg.norm([size / 2, size / 2, size / 4]))
    stiffness = 5e3 * size**3
    sites = [f'<site name="A{i}" pos="{x} {y} {size / 2}"/>' for i, (x, y) in enumerate(corners)]
    cables = [CABLE.format(i=i, length=length, stiffness=stiffness) for i in range(4)]
    text = ODD.format(
        sites="".join(sites),
        cables="".join(cables),
        x=size / 2,
        z=size / 4,
        mass=size**3,
        joints=joints,
    )
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("size", [0.5, 300.0])
def test_any_robot(size: float, tmp_path: Path) -> None:
    axes = {"x": "1 0 0", "y": "0 1 0", "z": "0 0 1"}
    joints = "".join(f'<joint name="{a}" type="slide" axis="{v}"/>' for a, v in axes.items())
    path = odd_robot(tmp_path / "odd.xml", size, joints)
    case = user_cases(path, n_random=3)[1]
    write_case_recording(run_case(case, load_thresholds()), tmp_path / "odd.rrd")
    back = Readback(tmp_path / "odd.rrd")
    radius = back.static("/scene/mujoco/cables/taut", "LineStrips3D:radii")[0]
    assert 1e-3 < radius / size < 6e-3
    # it cannot turn
    assert "Deviation from the command [mm]" in back.views
    assert "Rotation from the command [°]" not in back.views
    assert not any(e.startswith("/plot/tilt") for e in back.entities("pose"))
    lanes = sorted(e for e in back.entities("pose") if e.startswith("/lanes/haul"))
    assert len(lanes) == 4
    half = back.column("/scene/seecr/platform", "Boxes3D:half_sizes")[0][0]
    assert min(half) > 1e-3 * size, "a platform that is a point is seen all the same"


def test_slack_dashes_hang_below_the_straight_line() -> None:
    robot = load_robot(PARALLEL)
    pose = robot.reference_pose[None]
    slack = np.zeros((1, 8), dtype=bool)
    slack[0, 2] = True
    lengths = 1.02 * robot.nominal_lengths(pose)
    strips = np.array(scene.slack_strips(robot, pose, slack, lengths))
    points = strips.reshape(-1, 3)
    start, end = robot.exit_points[2], pose[0, :3] + robot.anchor_points[2]
    np.testing.assert_allclose(points[0], start, atol=1e-12)
    np.testing.assert_allclose(points[-1], end, atol=1e-12)
    part = (points[:, 0] - start[0]) / (end[0] - start[0])
    below = (start + part[:, None] * (end - start) - points)[1:-1, 2]
    assert np.all(below > 0.0)
    fine = np.linspace(0.0, 1.0, 2001)[:, None]
    sag = below.max()
    curve = start + fine * (end - start) - 4 * sag * fine * (1 - fine) * np.array([0, 0, 1.0])
    length = np.linalg.norm(np.diff(curve, axis=0), axis=1).sum()
    assert length == pytest.approx(lengths[0, 2], rel=0.02)


def test_the_tension_scale_grows_lighter_all_the_way() -> None:
    shades = scale_colours(np.linspace(0.0, 1.0, 200), 1.0).astype(float)
    light = shades[:, :3] @ [0.2126, 0.7152, 0.0722]
    assert np.all(np.diff(light) >= -0.6), "a grey print reads the same"
    assert light[-1] > 2.4 * light[0]
    np.testing.assert_array_equal(scale_colours(np.array([5.0]), 1.0)[0], shades[-1])


@pytest.mark.parametrize(
    ("value", "top"), [(1.83, 2.0), (2.0, 2.0), (0.0071, 0.008), (9100.0, 1e4), (0.0, 1.0)]
)
def test_the_top_of_the_scale_is_round(value: float, top: float) -> None:
    assert round_up(value) == pytest.approx(top)


def test_the_viewer_has_nothing_to_complain_about(written: Path) -> None:
    with headless_viewer() as viewer:
        viewer.open(str(written))
        for at in (
            {"timeline": "pose", "sequence": 2},
            {"timeline": "settling_time", "duration": 0.1},
        ):
            viewer.set_time(**at, play_state="paused")
            assert viewer.take_screenshot().startswith(b"\x89PNG")
            views = viewer.get_state().views
            assert len(views) == 9
            assert [(view.name, view.reports) for view in views if view.reports] == []
