"""Robots of few joints: every effect is asked for, none crashes, what cannot show is said so."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import crosscheck
import seecr
from crosscheck.inference.catalogue import Catalogue
from crosscheck.inference.fit import Data
from crosscheck.inference.search import Search
from crosscheck.preparation.prepare import prepare
from seecr.pose import Array

EXITS = [(-1, -1, 1), (1, -1, 1), (1, 1, 1), (-1, 1, 1)]
SLIDES = {axis: f'<joint type="slide" axis="{axis}"/>' for axis in ("1 0 0", "0 1 0", "0 0 1")}
HINGE = '<joint type="hinge" axis="0 1 0" pos="-0.5 0 0"/>'
LOADS = np.repeat([0.0, 0.5, 1.0], 8)
# Of each robot its joints, exit and anchor points, and an effect that its joints cannot show.
ROBOTS: dict[str, tuple[str, Any, Any, str]] = {
    "a point mass": ("".join(SLIDES.values()), EXITS, [(0, 0, 0)] * 4, "centre_of_mass"),
    "one slide": (
        SLIDES["0 0 1"], [(0.3, 0, 1), (-0.3, 0, 1)], [(0.05, 0, 0), (-0.05, 0, 0)],
        "centre_of_mass",
    ),
    "one hinge": (HINGE, [(0, 0, 1), (0.2, 0, 1)], [(0, 0, 0), (0.2, 0, 0)], ""),
}  # fmt: skip


def robot_of(kind: str, folder: Path) -> seecr.Robot:
    joints, exits, anchors, _still = ROBOTS[kind]
    apart = [np.linalg.norm(np.subtract(a, b)) for a, b in zip(exits, anchors, strict=True)]
    sites = [f'<site name="a{i}" pos="{x} {y} {z}"/>' for i, (x, y, z) in enumerate(exits)]
    held = [f'<site name="b{i}" pos="{x} {y} {z}"/>' for i, (x, y, z) in enumerate(anchors)]
    cables = [
        f'<spatial name="c{i}" stiffness="{2e4 / long}" springlength="0 {0.9995 * long}">'
        f'<site site="a{i}"/><site site="b{i}"/></spatial>'
        for i, long in enumerate(apart)
    ]
    (folder / "robot.xml").write_text(
        f'<mujoco><worldbody>{"".join(sites)}<body name="p">{joints}<inertial pos="0 0 0" mass="2" '
        f'diaginertia=".01 .01 .01"/>{"".join(held)}</body></worldbody>'
        f"<tendon>{''.join(cables)}</tendon></mujoco>"
    )
    return seecr.load_robot(folder / "robot.xml")


def poses_of(robot: seecr.Robot, random: np.random.Generator) -> Array:
    from seecr.description.joints import pose_of_values

    return pose_of_values(robot, random.uniform(-0.2, 0.2, (24, len(robot.joints))))[0]


def measured(robot: seecr.Robot, hidden: seecr.Term) -> crosscheck.Measurements:
    """Readings with three payloads, by SEECR's own prediction."""
    random = np.random.default_rng(4)
    pose, run, time = poses_of(robot, random), np.repeat([0, 1, 2], 8), 5.0 * np.arange(24)
    loads = seecr.Loads(LOADS, np.full((24, 3), np.nan), np.zeros((24, 6)))
    read = seecr.predict(robot, seecr.Commands(pose, run=run, time=time, loads=loads), [hidden])
    noisy = read.readings.position + random.normal(0.0, 2e-5, (24, 3))
    return crosscheck.Measurements(
        Path("m.csv"), robot.n_cables, np.array(["a", "b", "c"])[run], command_pose=pose,
        t_s=time, loads=loads, position=noisy, sigma=crosscheck.Sigma(position_m=2e-5),
    )  # fmt: skip


def test_a_member_that_moves_nothing_gains_nothing(tmp_path: Path) -> None:
    """It has no column in the linear model, where the sets about one with it are looked at."""
    robot = robot_of("a point mass", tmp_path)
    ready = prepare(
        robot, measured(robot, seecr.Term.of(robot, "stiffness", factor=0.8)), seecr.Terms()
    )
    found = Data.of(ready.problem, ready.terms)
    search = Search(found, Catalogue.of(found, ready.terms))
    scores = search.scores_about(search.begin())
    both = frozenset({"centre_of_mass", "stiffness"})
    assert "centre_of_mass" not in scores.about.columns and scores.gain(both, "centre_of_mass") == 0
    assert both - {"centre_of_mass"} in scores.neighbours(both)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ROBOTS)
def test_every_effect_is_asked_for(kind: str, tmp_path: Path) -> None:
    robot, still = robot_of(kind, tmp_path), ROBOTS[kind][3]
    data = measured(robot, seecr.Term.of(robot, "stiffness", factor=0.8))
    found = crosscheck.diagnose(robot, data)
    assert found.verdict is not crosscheck.DiagnosisVerdict.NO_VERDICT
    assert found.to_json() and found.sight is not None
    plan = crosscheck.make_plan(robot, data)
    told = {one.name for one in plan.effects} | plan.missing.keys()
    assert told == seecr.catalogue().keys()
    for name in seecr.catalogue():
        term = seecr.Term(layout := seecr.layout_of(name, robot), layout.null)
        assert crosscheck.compare(robot, data, [term]).rms
        try:
            added = crosscheck.add_effect(robot, data, name)
        except crosscheck.CrosscheckError as error:
            assert name in str(error)
            continue
        assert str(added)
    if still:
        assert still not in [missing.effect for missing in found.missing]
        said = " ".join(found.sight.lines())
        assert re.search(rf"{still}[^(;]*\(whatever its size, it moves none", said), said
        why = next(one.why_not for one in found.candidates if one.effect == still)
        assert "moves no reading" in str(why)
        assert "any value fits them equally well" in str(crosscheck.add_effect(robot, data, still))
    assert str(crosscheck.calibrate(robot, data))
