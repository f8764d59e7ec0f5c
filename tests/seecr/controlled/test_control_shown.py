"""Recordings and figures of control: what they show is what was computed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from recordings import Readback

import crosscheck
import seecr
from crosscheck.show.control import write_timed_recording
from seecr.show.control import control_figure, write_control_recording

COGIRO = seecr.load_robot(seecr.model_path("demobot_cogiro"))
POSES = np.array([[x, 0.25, 0.15, 1, 0, 0, 0] for x in (0.3, 0.4, 0.5)])
TRUE = [seecr.Term.of(COGIRO, "stiffness", factor=0.7)]


def test_a_recording_shows_wanted_believed_true_and_read(tmp_path: Path) -> None:
    tracker = seecr.Term.of(COGIRO, "tracker_frame", shift_x_m=0.01)
    found = seecr.control(COGIRO, POSES, scheme="elastic", true=[*TRUE, tracker])
    write_control_recording(found, tmp_path / "one.rrd")
    seen = Readback(tmp_path / "one.rrd")
    one = found["elastic"]
    for name, poses in (
        ("wanted", POSES), ("believed", POSES), ("elastic", one.solution.pose),
        ("read", one.solution.pose + np.array([0.01, 0, 0, 0, 0, 0, 0])),
    ):  # fmt: skip
        centres = np.array(seen.column(f"/scene/{name}/platform", "Boxes3D:centers"))[:, 0]
        assert np.allclose(centres, poses[:, :3], atol=2e-6), name
    off = np.linalg.norm(one.solution.deviation[:, :3], axis=1)
    assert np.allclose(seen.scalars("/plot/error/elastic"), np.log10(1e3 * off))


def test_several_schemes_are_drawn_beside_each_other(tmp_path: Path) -> None:
    names = ["geometric", "elastic+pose_feedback"]
    found = seecr.control(COGIRO, POSES, scheme=names, true=TRUE)
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
    one = crosscheck.control_in_time(COGIRO, POSES[:2], **given)["elastic+pose_feedback"]
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
