"""Settling in MuJoCo against closed forms and statics written out here, independent of seecr."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import mujoco
import numpy as np
import pytest
from random_robots import write_mjcf
from robots import WAYS, rejointed

from crosscheck.errors import CrosscheckError
from crosscheck.settle import newton, relaxation
from crosscheck.settle import settler as settle
from crosscheck.settle.physics import Physics
from crosscheck.settle.relaxation import SettleStatus
from crosscheck.settle.settler import Settler, settle_batch
from crosscheck.show.case_recording import record_motion
from crosscheck.suite.write import write_worst_pose_mjcf
from seecr.description.mjcf import load_robot
from seecr.equilibrium.solving import solve
from seecr.errors import SeecrError
from seecr.pose import pose_difference, quat_from_rotvec, quat_rotate, transform_points

G = 9.81
# DemoBot's exit and anchor points [m].
COGIRO, PARALLEL = (
    (robot.exit_points, robot.anchor_points)
    for robot in map(load_robot, ("demobot_cogiro", "demobot_parallel"))
)
HOME = np.array([0.4, 0.25, 0.15])


def text(values):
    return " ".join(repr(float(v)) for v in np.ravel(values))


def mjcf(
    exits,
    anchors,
    *,
    home=HOME,
    mass=0.4,
    com=(0, 0, 0),
    size=1.0,
    ea=3000.0,
    joints=None,
    extra="",
):
    """An MJCF robot in the contract's form, as text."""
    exits, anchors, home = (np.asarray(v, float) * size for v in (exits, anchors, home))
    inertia = mass / 12 * np.array([0.044**2 + 0.036**2, 0.102**2 + 0.036**2, 0.102**2 + 0.044**2])
    sites = "".join(f'<site name="A{i}" pos="{text(a)}"/>' for i, a in enumerate(exits))
    own = "".join(f'<site name="B{i}" pos="{text(b)}"/>' for i, b in enumerate(anchors))
    lengths = np.linalg.norm(exits - home - anchors, axis=1)
    cables = "".join(
        f'<spatial name="cable{i + 1}" springlength="{text([0, rest])}" '
        f'stiffness="{text(ea / rest)}"><site site="A{i}"/><site site="B{i}"/></spatial>'
        for i, rest in enumerate(lengths)
    )
    return (
        f'<mujoco model="robot"><worldbody>{sites}<body name="platform" pos="{text(home)}">'
        f"{joints or '<freejoint/>'}"
        f'<inertial pos="{text(np.asarray(com) * size)}" mass="{mass!r}" '
        f'diaginertia="{text(inertia * size**2)}"/>{own}</body></worldbody>'
        f"<tendon>{cables}</tendon>{extra}</mujoco>"
    )


def settler(points, **options):
    keys = ("tolerance", "max_steps")
    own = {k: options.pop(k) for k in keys if k in options}
    return of_text(mjcf(*points, **options), **own)


def of_text(xml, make=Settler, **own):
    """What is made of a file with this text."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "robot.xml"
        path.write_text(xml, encoding="utf-8")
        return make(path, **own)


def loaded(one, wrench):
    """The settler with a wrench on the platform besides the MJCF's own gravity."""
    one.physics.set_load = partial(Physics.set_load, one.physics, wrench)
    return one


def poses_at(positions):
    positions = np.atleast_2d(positions)
    return np.hstack([positions, np.tile([1.0, 0, 0, 0], (len(positions), 1))])


def nominal(points, poses, size=1.0):
    return np.linalg.norm(points[0] * size - transform_points(poses, points[1] * size), axis=-1)


def random_poses(n, seed=3):
    rng = np.random.default_rng(seed)
    return poses_at(rng.uniform([0.17, 0.12, 0.08], [0.63, 0.38, 0.3], (n, 3)))


def unbalanced(points, result, rest, ea, load, com=(0, 0, 0), mass=0.4, gravity=(0, 0, -G)):
    """Wrench left over at the platform's origin, from scratch: tensions, weight and load."""
    arms = quat_rotate(result.pose[3:], points[1])
    cables = points[0] - result.pose[:3] - arms
    lengths = np.linalg.norm(cables, axis=1)
    tension = ea * np.maximum(lengths - rest, 0) / rest
    pulls = tension[:, None] * cables / lengths[:, None]
    weight = mass * np.asarray(gravity)
    force = pulls.sum(0) + weight + load[:3]
    arm = quat_rotate(result.pose[3:], np.asarray(com, float))
    torque = np.cross(arms, pulls).sum(0) + np.cross(arm, weight) + load[3:]
    return force, torque, tension


ONE_CABLE = (np.array([[0.0, 0.0, 1.0]]), np.array([[0.0, 0.0, 0.05]]))


def hang(com=(0, 0, 0), **options):
    one = settler(ONE_CABLE, home=(0, 0, 0.2), com=com, ea=100.0, **options)
    return one, poses_at([0, 0, 0.2])[0], np.array([0.75])


def test_one_vertical_cable_stretches_by_weight_times_length_over_ea():
    one, pose, rest = hang()
    result = one.settle(pose, rest)
    assert result.status is SettleStatus.SETTLED
    stretch = 0.4 * G * 0.75 / 100.0
    assert result.pose[:3] == pytest.approx([0, 0, 0.2 - stretch], abs=1e-12)
    assert result.tensions == pytest.approx([0.4 * G], rel=1e-10)
    energy = 0.5 * (100.0 / 0.75) * stretch**2 + 0.4 * G * (0.2 - stretch)
    assert result.energy == pytest.approx(energy, rel=1e-12)
    assert result.free_to_move  # about the cable
    assert abs(result.smallest_eigenvalue) < result.neutral


def test_slack_cables_carry_exactly_nothing():
    exits = np.array([[0, 0, 1.0], [0.3, 0, 1.0], [0, 0.2, -1.0]])
    one = settler((exits, np.zeros((3, 3))), home=(0, 0, 0.2))
    pose = poses_at([0, 0, 0.2])[0]
    result = one.settle(pose, np.array([0.8, 2.0, 2.0]))
    assert result.settled
    assert result.slack.tolist() == [False, True, True]
    assert result.tensions[1:].tolist() == [0.0, 0.0]
    assert result.tensions[0] == pytest.approx(0.4 * G, rel=1e-9)


@pytest.mark.parametrize("points", [COGIRO, PARALLEL], ids=["cogiro", "parallel"])
@pytest.mark.parametrize("ea", [1e2, 300.0, 3e3, 1e5, 1e7])
def test_settles_and_polishes_over_the_range_of_stiffness(points, ea):
    one = settler(points, ea=ea)
    poses = random_poses(8)
    rest = nominal(points, poses)
    results = settle_batch(one, poses, rest)
    assert set(results.status) == {SettleStatus.SETTLED}
    rounding = np.finfo(float).eps * ea * np.sqrt(8) / (0.4 * G)
    assert np.max(results.residual) < max(1e-9, 4 * rounding)
    assert np.max(results.settled_residual) < 1e-7
    away = pose_difference(results.settled_pose, results.pose)
    assert np.max(np.linalg.norm(away[:, :3], axis=1)) < 1e-6
    assert np.max(np.linalg.norm(away[:, 3:], axis=1)) < 1e-5
    for result, l0 in zip(results, rest, strict=True):
        force, torque, tension = unbalanced(points, result, l0, ea, np.zeros(6))
        assert np.linalg.norm(force) < max(1e-9, 20 * rounding) * 0.4 * G
        assert np.linalg.norm(torque) < max(1e-9, 20 * rounding) * 0.4 * G * 0.06
        assert result.tensions == pytest.approx(tension, abs=10 * np.finfo(float).eps * ea)


def test_a_robot_of_another_size_settles_in_the_same_steps():
    # Lengths x 400, mass x 1000, stiffness with the weight: the same statics in other units.
    poses = random_poses(3)
    small = settle_batch(settler(COGIRO), poses, nominal(COGIRO, poses))
    scaled = poses * np.array([400, 400, 400, 1, 1, 1, 1])
    large = settle_batch(
        settler(COGIRO, size=400.0, mass=400.0, ea=3e6), scaled, nominal(COGIRO, scaled, 400.0)
    )
    assert large.steps.tolist() == small.steps.tolist()
    assert large.pose[:, :3] / 400 == pytest.approx(small.pose[:, :3], abs=1e-12)
    assert large.tensions / 1000 == pytest.approx(small.tensions, abs=1e-9)


def test_wrench_gravity_and_centre_of_mass_balance():
    rng = np.random.default_rng(5)
    com = np.array([0.01, -0.005, 0.008])
    gravity = np.array([1.0, -0.5, -9.0])
    option = f'<option gravity="{text(gravity)}"/>'
    one = settler(COGIRO, com=com, ea=3000.0, extra=option)
    pose = poses_at(HOME)[0]
    rest = nominal(COGIRO, pose[None])[0]
    for _ in range(4):
        load = np.concatenate([rng.uniform(-1, 1, 3), rng.uniform(-0.02, 0.02, 3)])
        result = loaded(one, load).settle(pose, rest)
        assert result.settled
        force, torque, _ = unbalanced(COGIRO, result, rest, 3000.0, load, com, gravity=gravity)
        assert np.linalg.norm(force) < 1e-8
        assert np.linalg.norm(torque) < 1e-9


def test_a_pretensioned_robot_settles_without_any_load():
    exits = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    anchors = 0.05 * exits[::-1] * [1, -1, -1]
    pose = np.concatenate([[0.02, 0.01, -0.03], quat_from_rotvec(np.array([0.02, 0.01, 0.0]))])
    one = settler((exits, anchors), home=(0, 0, 0), extra='<option gravity="0 0 0"/>')
    rest = 0.99 * nominal((exits, anchors), poses_at([0, 0, 0]))[0]
    result = one.settle(pose, rest)
    assert result.settled
    assert np.linalg.norm(result.pose[:3]) < 1e-9
    assert not result.slack.any()


PLANAR = (
    np.array([[-1.0, 0, 1.0], [1.0, 0, 1.0], [-1.0, 0, 0.9], [1.0, 0, 0.9]]),
    np.array([[-0.05, 0, 0.03], [0.05, 0, 0.03], [-0.05, 0, -0.03], [0.05, 0, -0.03]]),
)
XZ_TILT = (
    '<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 0 1"/>'
    '<joint type="hinge" axis="0 1 0" pos="0.02 0 0.01"/>'
)


def test_a_planar_robot_on_slides_and_a_hinge_balances_in_its_plane():
    one = settler(PLANAR, home=(0, 0, 0), joints=XZ_TILT, ea=500.0)
    pose = poses_at([0.3, 0, 0.2])
    rest = nominal(PLANAR, pose)[0]
    result = one.settle(pose[0], rest)
    assert result.settled
    assert result.qpos.shape == (3,)
    assert result.pose[1] == 0.0
    force, torque, _ = unbalanced(PLANAR, result, rest, 500.0, np.zeros(6))
    assert np.linalg.norm(force[[0, 2]]) < 1e-9 * 0.4 * G
    assert abs(torque[1]) < 1e-9 * 0.4 * G
    assert abs(np.degrees(2 * np.arcsin(result.pose[5]))) > 1  # it tilts


@pytest.mark.parametrize("way", WAYS)
def test_the_smallest_stiffness_is_the_platforms_whatever_its_joints(way, tmp_path):
    """By joint values it was half of that, or less, and stood beside SEECR's in results.json."""
    path = write_mjcf(rejointed(load_robot("planar_vertical"), way), tmp_path / "robot.xml")
    robot, pose = load_robot(path), np.array([0.3, 0.0, 0.2, 1.0, 0.0, 0.0, 0.0])
    solution = solve(robot, pose)
    there = Settler(path).settle(pose, solution.rest_lengths[0])
    assert there.smallest_eigenvalue == pytest.approx(solution.smallest_eigenvalue[0], rel=1e-6)


def test_an_unstable_equilibrium_is_left_behind():
    # Centre of mass above the cable's end: upright like a pencil on its tip, in exact balance.
    one, pose, rest = hang(com=(0, 0, 0.15))
    result = one.settle(pose, rest)
    assert result.settled
    assert result.nudges > 0
    height = quat_rotate(result.pose[3:], np.array([0, 0, 0.1]))[2]
    assert height == pytest.approx(-0.1, abs=1e-9)


def nothing_but_nan(result):
    return all(
        np.isnan(v).all()
        for v in (result.pose, result.qpos, result.tensions, result.settled_pose, result.energy)
    )


def test_status_unstable(monkeypatch):
    monkeypatch.setattr(settle, "_NUDGES", 0)
    one, pose, rest = hang(com=(0, 0, 0.15))
    result = one.settle(pose, rest)
    assert result.status is SettleStatus.UNSTABLE
    assert result.smallest_eigenvalue < 0
    assert nothing_but_nan(result)


def test_status_time_limit():
    pose = poses_at(HOME)
    result = settler(COGIRO, max_steps=5).settle(pose[0], nominal(COGIRO, pose)[0])
    assert result.status is SettleStatus.TIME_LIMIT
    assert result.steps == 5
    assert result.settled_residual > 0
    assert nothing_but_nan(result)


def test_status_fell():
    pose = poses_at(HOME)
    result = settler(COGIRO).settle(pose[0], np.full(8, 100.0))
    assert result.status is SettleStatus.FELL
    assert result.settled_residual == pytest.approx(1.0, rel=1e-6)
    assert nothing_but_nan(result)


def test_status_diverged_leaves_no_log_behind(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(relaxation, "time_step", lambda physics: 1e9)
    pose = poses_at(HOME)
    result = settler(COGIRO).settle(pose[0], nominal(COGIRO, pose)[0])
    assert result.status is SettleStatus.DIVERGED
    assert nothing_but_nan(result)
    assert list(tmp_path.iterdir()) == []
    assert mujoco.get_mju_user_warning() is None


def test_a_time_step_that_diverges_is_shortened(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    pose = poses_at([0.3, 0.2, 0.12])
    one, rest = settler(COGIRO), nominal(COGIRO, pose)[0]
    plain = one.settle(pose[0], rest)
    monkeypatch.setattr(relaxation, "time_step", lambda physics: 1e9)
    monkeypatch.setattr(relaxation, "_SHORTER", 1e12)
    again = one.settle(pose[0], rest)
    assert again.settled
    assert again.pose == pytest.approx(plain.pose, abs=1e-11)
    assert list(tmp_path.iterdir()) == []


def test_status_polish_moved():
    pose = poses_at([0.17, 0.25, 0.1])
    result = settler(PARALLEL, tolerance=0.6).settle(pose[0], nominal(PARALLEL, pose)[0])
    assert result.status is SettleStatus.POLISH_MOVED
    assert result.moved_m > 1e-4
    assert nothing_but_nan(result)


def test_status_polish_stalled(monkeypatch):
    monkeypatch.setattr(newton, "_MAX_ITERATIONS", 0)
    pose = poses_at([0.3, 0.2, 0.12])
    result = settler(PARALLEL, tolerance=1e-5).settle(pose[0], nominal(PARALLEL, pose)[0])
    assert result.status is SettleStatus.POLISH_STALLED
    assert result.residual > 1e-9
    assert nothing_but_nan(result)


def test_damping_friction_limits_and_contacts_do_not_shift_the_rest_state():
    pose = poses_at([0.3, 0, 0.2])
    rest = nominal(PLANAR, pose)[0]
    plain = settler(PLANAR, home=(0, 0, 0), joints=XZ_TILT, ea=500.0).settle(pose[0], rest)
    rough = XZ_TILT.replace(
        'type="slide"', 'type="slide" damping="3" frictionloss="2" limited="true" range="0 0.1"'
    )
    floor = (
        '<body name="platform"',
        '<geom type="plane" size="5 5 1" pos="0 0 0.15"/><body name="platform"',
    )
    xml = mjcf(*PLANAR, home=(0, 0, 0), joints=rough, ea=500.0).replace(*floor)
    xml = xml.replace("<inertial", '<geom size="0.1"/><inertial')
    other = of_text(xml)
    assert other.physics.ignored == (
        "joint limits",
        "dry friction",
        "contacts",
        "damping",
    )
    rested = other.settle(pose[0], rest)
    assert rested.pose == pytest.approx(plain.pose, abs=1e-10)
    assert rested.steps == plain.steps  # damping would only take longer


def test_the_order_does_not_matter():
    poses = random_poses(7)
    rest = nominal(PARALLEL, poses)
    one = settler(PARALLEL)
    alone = settle_batch(one, poses, rest)
    backwards = settle_batch(one, poses[::-1], rest[::-1])
    assert backwards.pose[::-1].tolist() == alone.pose.tolist()
    assert alone.slack.shape == (7, 8)
    assert alone.slack.dtype == bool
    with pytest.raises(AttributeError, match="a settling has no poses"):
        _ = alone.poses


def test_energy_is_least_at_rest_and_its_slope_is_the_wrench():
    pose = poses_at([0.17, 0.25, 0.1])[0]
    rest = nominal(PARALLEL, pose[None])[0]
    one = loaded(settler(PARALLEL), np.array([0.3, -0.2, 0.5, 0, 0, 0]))
    answer = one.settle(pose, rest).pose
    assert one.energy(answer, rest) < one.energy(pose, rest)
    for axis in range(3):
        step = 1e-5 * np.eye(7)[axis]
        up = one.energy(answer + step, rest)
        down = one.energy(answer - step, rest)
        assert (up - down) / 2e-5 == pytest.approx(0, abs=1e-5)
        assert up > one.energy(answer, rest)


def test_a_motion_falls_and_comes_to_rest():
    pose = poses_at([0.17, 0.25, 0.1])[0]
    rest = nominal(PARALLEL, pose[None])[0]
    one = settler(PARALLEL)
    motion = record_motion(one, pose, rest, max_frames=100)
    assert motion.settling.settled
    assert motion.t_s.shape == (100,)
    assert motion.t_s[0] == 0.0
    assert np.all(np.diff(motion.t_s) > 0)
    assert motion.pose[0] == pytest.approx(pose, abs=1e-15)
    assert motion.kinetic_energy[0] == 0.0
    assert motion.kinetic_energy.max() > 1e-4
    assert motion.kinetic_energy[-1] < 1e-12
    assert motion.pose[-1] == pytest.approx(motion.settling.settled_pose, abs=1e-6)
    assert motion.tensions[-1] == pytest.approx(motion.settling.tensions, abs=1e-5)
    stored = [one.energy(p, rest) for p in motion.pose]
    total = stored + motion.kinetic_energy
    assert np.all(total[1:] < total[0])
    assert stored[-1] == pytest.approx(np.min(total), abs=1e-12)


def test_the_worst_pose_finds_files_beside_the_source(tmp_path):
    folder = tmp_path / "robot"
    folder.mkdir()
    (folder / "light.xml").write_text(
        '<mujoco><worldbody><light pos="0 0 3"/></worldbody></mujoco>'
    )
    source = folder / "robot.xml"
    source.write_text(mjcf(*COGIRO, extra='<include file="light.xml"/>'))
    rest = nominal(COGIRO, poses_at(HOME))[0]
    qpos = poses_at(HOME)[0]
    write_worst_pose_mjcf(source, qpos, rest, np.full(8, 3000.0), tmp_path / "worst.xml")
    assert mujoco.MjModel.from_xml_path(str(tmp_path / "worst.xml")).nlight == 1


def broken(old, new):
    return mjcf(*COGIRO).replace(old, new)


TWO = (
    '</body><body name="second"><freejoint/><geom size="0.1"/><site name="S"/></body></worldbody>'
    '<tendon><spatial name="more"><site site="S"/><site site="A1"/></spatial></tendon>'
)


@pytest.mark.parametrize(
    ("xml", "message"),
    [
        ("<mujoco", "cannot read this as MJCF"),
        ("<mujoco/>", "no moving body"),
        (broken("</body></worldbody>", TWO), "2 moving bodies hang together"),
        (
            '<mujoco><worldbody><body><freejoint/><geom size="1"/></body></worldbody></mujoco>',
            "no cables",
        ),
        (broken('<site site="A2"/>', '<site site="A2"/><site site="A1"/>'), "guide sites"),
        (broken('<site site="A2"/>', '<site site="A2"/><site site="B2"/><site site="A2"/>'),
         "cable3: expected exactly two sites; MuJoCo's side takes no block and tackle"),
        (broken('<site site="A2"/>', '<site site="B1"/>'), "cable3 has all its sites on"),
        (broken('stiffness="', 'stiffness="1 2 '), "one number|cannot read"),
    ],
)  # fmt: skip
def test_what_is_no_cable_robot_is_refused(tmp_path, xml, message):
    path = tmp_path / "robot.xml"
    path.write_text(xml)
    with pytest.raises(SeecrError, match=message) as caught:
        Settler(path)
    assert str(path) in str(caught.value)


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(SeecrError, match="no such file"):
        Settler(Path(tmp_path / "none.xml"))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"rest_lengths": np.ones(7)}, r"rest_lengths: expected shape \(8,\), got \(7,\)"),
        ({"rest_lengths": np.array([1, 1, 0, 1, 1, 1, 1, 1.0])}, "got 0 for cable 3"),
        ({"rest_lengths": np.full(8, np.nan)}, "rest_lengths: expected finite numbers"),
        ({"pose": np.zeros(6)}, r"pose: expected shape \(7,\), got \(6,\)"),
        ({"pose": np.zeros(7)}, "quaternion of norm 1, got norm 0"),
    ],
)
def test_wrong_numbers_are_refused(change, message):
    inputs = {"pose": poses_at(HOME)[0], "rest_lengths": np.ones(8)} | change
    with pytest.raises(CrosscheckError, match=message):
        settler(COGIRO).settle(**inputs)


def test_wrong_stiffness_and_load_are_refused():
    one = settler(COGIRO)
    with pytest.raises(CrosscheckError, match=r"ea: expected positive numbers \[N\], got -1 for c"):
        one.physics.set_cables(np.ones(8), np.full(8, -1.0))
    with pytest.raises(CrosscheckError, match=r"wrench: expected shape \(6,\)"):
        one.physics.set_load(np.zeros(3))
    with pytest.raises(CrosscheckError, match="gravity: expected finite numbers"):
        one.physics.set_load(gravity=np.array([0, 0, np.inf]))


def test_a_batch_of_the_wrong_shape_is_refused():
    with pytest.raises(CrosscheckError, match=r"expected \(n, 7\) and \(n, 8\), got \(2, 7\) and"):
        settle_batch(settler(COGIRO), random_poses(2), np.ones((3, 8)))
