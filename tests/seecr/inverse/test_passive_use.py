"""Lines that no winch drives in what is built on the statics: corrections, maps, files, exports."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from called import as_json, following, ran, refused_in_a_line
from passive_files import FOLDER, KINDS, LINE, Energy
from scipy.optimize import linprog, minimize

import seecr
from seecr.pose import transform_points

PLACES = np.array([[0.0, 0.0, 1.1], [0.25, 0.0, 1.25], [-0.3, 0.0, 1.0]])


def robot_of(kind: str) -> seecr.Robot:
    return seecr.load_robot(FOLDER / f"{kind}.xml")


def poses_of(kind: str) -> np.ndarray:
    shift = 0.1 if kind == "band" else 0.0
    return np.hstack([PLACES + np.array([0.0, 0.0, shift]), np.tile([1.0, 0.0, 0.0, 0.0], (3, 1))])


@pytest.mark.parametrize("kind", KINDS[1:])
@pytest.mark.parametrize("effects", ["none", "some"])
def test_corrections_reach_their_poses_and_command_no_passive_line(kind: str, effects: str) -> None:
    robot, poses = robot_of(kind), poses_of(kind)
    terms = []
    if effects == "some":
        terms = [
            seecr.Term.of(robot, "drum_gain", gain_1=0.01, gain_3=-0.004),
            seecr.Term.of(robot, "initial_pose_error", position_x_m=0.004),
            seecr.Term.of(robot, "backlash", gap_m=0.002),
        ]
    found = seecr.correct(robot, poses, effects=terms)
    assert found.reached.all() and "tensions there" in str(found)
    passive = robot.cable_names.index(LINE[kind])
    assert (found.lengths[:, passive] == robot.rest_lengths[passive]).all()
    again = seecr.predict(robot, found.commands, terms)
    np.testing.assert_allclose(again.pose, poses, atol=1e-7)
    assert not [key for key in found.records()[0] if key == f"length_{passive + 1}_m"]


def test_limits_are_those_of_the_driven_cables() -> None:
    robot = robot_of("spring")
    found = seecr.correct(robot, poses_of("spring"), lowest=0.5, highest=np.full(7, 60.0))
    assert found.reached.all()
    pulls = found.solution.tensions
    assert pulls[:, :6].min() >= 0.5 - 1e-9 and pulls[:, 6].min() < 0.5
    few = seecr.correct(robot, poses_of("spring"), lowest=np.full(6, 0.5), highest=60.0)
    np.testing.assert_allclose(few.lengths, found.lengths, rtol=1e-12)
    with pytest.raises(seecr.InputError, match=r"lowest must be one number or \(6,\)"):
        seecr.correct(robot, poses_of("spring"), lowest=np.ones(5))


def margin_by_program(kind: str, pose: np.ndarray, low: float, high: float) -> float:
    """The largest t with low + t <= tau <= high - t of driven cables, passive pulls as given."""
    energy, robot = Energy(FOLDER / f"{kind}.xml"), robot_of(kind)
    anchors = transform_points(pose[None], robot.anchor_points)[0]
    way = robot.exit_points - anchors
    length = np.linalg.norm(way, axis=1)
    unit = way / length[:, None]
    wrench = np.vstack([unit.T, np.cross(anchors - pose[:3], unit).T])
    centre = transform_points(pose[None], robot.centre_of_mass[None])[0, 0] - pose[:3]
    weight = np.array([0.0, 0.0, -9.81 * robot.mass])
    load = -np.concatenate([weight, np.cross(centre, weight)])
    k = robot.cable_names.index(LINE[kind])
    _name, _a, _b, long, stiff = energy.lines[k]
    pull = energy.force.get(LINE[kind]) or stiff[0] * (length[k] - long[-1])
    load = load - wrench[:, k] * pull
    m = len(length) - 1
    own = np.delete(wrench, k, axis=1)
    found = linprog(
        np.append(np.zeros(m), -1.0), A_eq=np.hstack([own, np.zeros((6, 1))]), b_eq=load,
        A_ub=np.vstack([np.hstack([-np.eye(m), np.ones((m, 1))]),
                        np.hstack([np.eye(m), np.ones((m, 1))])]),
        b_ub=np.append(-low * np.ones(m), high * np.ones(m)), bounds=[(None, None)] * (m + 1),
    )  # fmt: skip
    return -float(found.fun)


@pytest.mark.parametrize("kind", KINDS[1:])
def test_margins_take_the_passive_pull_as_given(kind: str) -> None:
    robot, poses = robot_of(kind), poses_of(kind)
    margins = seecr.tension_margin(robot, poses, lowest=0.5, highest=40.0)
    expected = [margin_by_program(kind, pose, 0.5, 40.0) for pose in poses]
    np.testing.assert_allclose(margins, expected, atol=1e-7)
    without = seecr.tension_margin(robot.only(robot.driven), poses, lowest=0.5, highest=40.0)
    assert np.abs(without - margins).max() > 0.5
    found = seecr.workspace_map(robot, [0.0, 0.2], [0.0], [1.0, 1.2], lowest=0.5, highest=40.0)
    there = seecr.tension_margin(
        robot, np.array([0.2, 0.0, 1.2, 1, 0, 0, 0]), lowest=0.5, highest=40.0
    )
    assert found.margin[1, 0, 1] == pytest.approx(there[0])


HEADER = "run,length_{}_m,length_{}_m,meas_x_m,meas_z_m\n"


def test_files_of_lengths_have_no_column_for_passive_lines(tmp_path: Path) -> None:
    robot = FOLDER / "band.xml"
    lengths = "a,1.3,1.2,0,1.1\n"
    good = tmp_path / "good.csv"
    good.write_text(HEADER.format("cable1", 2) + lengths)
    rows = as_json(f"seecr sweep {robot} {good} --out {tmp_path / 'a'} --figure none "
                   "--no-recording", 0)["rows"]  # fmt: skip
    assert rows[0]["rest_lengths_m"] == [1.3, 1.2, 0.6]
    swept = (tmp_path / "a" / "sweep.csv").read_text().splitlines()[0].split(",")
    assert [name for name in swept if name.startswith("length_")] == ["length_1_m", "length_2_m"]
    again = ran(f"seecr sweep {robot} {tmp_path / 'a' / 'sweep.csv'} --out {tmp_path / 'b'}", 0)
    assert again.exit_code == 0
    bad = tmp_path / "bad.csv"
    bad.write_text(HEADER.replace("meas_x", "length_band_mm,meas_x").format(1, 2)
                   + "a,1.3,1.2,600,0,1.1\n")  # fmt: skip
    said = "no winch drives band: expected no length of it, leave out length_band_mm"
    assert said in refused_in_a_line(f"seecr sweep {robot} {bad} --out {tmp_path / 'c'}")
    assert said in refused_in_a_line(f"crosscheck compare {robot} {bad} --out {tmp_path / 'd'}")
    few = tmp_path / "few.csv"
    few.write_text("run,length_1_m,meas_x_m\na,1.3,0\n")
    answer = refused_in_a_line(f"seecr sweep {robot} {few} --out {tmp_path / 'e'}")
    assert "all 2 cables of the robot that a winch drives, length_2_m missing" in answer


def test_corrected_commands_have_none_either_and_are_read_again(tmp_path: Path) -> None:
    (tmp_path / "poses.csv").write_text("cmd_x_m,cmd_y_m,cmd_z_m\n0.1,0,1.1\n0,0.1,1.2\n")
    robot, out = FOLDER / "spring.xml", tmp_path / "out"
    result = ran(f"seecr correct {robot} {tmp_path / 'poses.csv'} --out {out}", 0)
    names = (out / "corrected.csv").read_text().splitlines()[0].split(",")
    assert [n for n in names if n[:6] == "length"] == [f"length_{k}_m" for k in range(1, 7)]
    swept = ran(f"{following(result)} --out {tmp_path / 'swept'} --figure none --no-recording", 0)
    assert "at rest" in swept.stdout


def test_the_option_reaches_every_command_that_follows(tmp_path: Path) -> None:
    text = (FOLDER / "band.xml").read_text()
    bare = tmp_path / "bare.xml"
    bare.write_text(text.replace('<text name="passive" data="band"/>', ""))
    with_option = ran(f"seecr pose {bare} 0.2 0 1.3 --passive band", 0)
    assert "band" in with_option.stdout and "  passive" in with_option.stdout
    assert following(with_option).endswith("--passive band")
    declared = as_json(f"seecr pose {FOLDER / 'band.xml'} 0.2 0 1.3")
    assert as_json(f"seecr pose {bare} 0.2 0 1.3 --passive band")["pose"] == declared["pose"]
    assert as_json(f"seecr pose {bare} 0.2 0 1.3")["pose"] != declared["pose"]
    for bad in ("--passive ,", "--passive bnad"):
        assert ran(f"seecr pose {bare} 0.2 0 1.3 {bad}").exit_code == 2
    for program, names in {
        "seecr": "pose sweep map correct export",
        "crosscheck": "compare diagnose calibrate add plan twin run effects import",
    }.items():
        for name in names.split():
            assert "--passive LINE,..." in ran(f"{program} {name} --help", 0).stdout, name


@pytest.mark.parametrize("kind", KINDS)
def test_exports_keep_the_lines(kind: str, tmp_path: Path) -> None:
    robot = robot_of(kind)
    term = seecr.Term.of(robot, "platform_mass", added_kg=0.4)
    said = seecr.export(robot, [term])
    (tmp_path / "out.xml").write_text(said.text)
    again = seecr.load_robot(tmp_path / "out.xml")
    for name in ("driven", "pushes", "constant_tension_N"):
        assert np.array_equal(getattr(again, name), getattr(robot, name)), name
    pose = poses_of(kind)
    np.testing.assert_allclose(
        seecr.solve(again, pose).pose, seecr.predict(robot, pose, [term]).pose, atol=1e-9
    )
    assert (said.mujoco_text is not None) == (kind == "counterweight")


@pytest.mark.parametrize("kind", ["spring", "counterweight"])
def test_the_file_for_mujoco_alone_rests_where_its_keyframe_is(kind: str) -> None:
    """A robot with winch-side cable needs that file; MuJoCo's own forces vanish at its keyframe."""
    robot = robot_of(kind)
    said = seecr.export(robot, [seecr.Term.of(robot, "winch_side_length", length_m=0.5)])
    assert said.mujoco_text is not None
    model = mujoco.MjModel.from_xml_string(said.mujoco_text)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose(data.qacc, 0.0, atol=1e-6)
    data.ctrl[:] = 0.0
    if kind == "counterweight":
        assert model.nu == 1


def test_a_passive_line_is_no_bar_nor_pair() -> None:
    robot = replace(seecr.load_robot("planar_two_cable"), driven=[True, False])
    pose = robot.reference_pose
    assert seecr.bar_balances(robot, pose) is None


# --- A block and tackle on a winch beside a band that nothing drives: both at once

# Its twin by hand has no pulley: n lines between two points pull as one of n^2 times the stiffness
# and 1/n of the rest length, with n times the tension of each.


FILE = """<mujoco model="tackle">
  <custom><text name="passive" data="band"/>{texts}</custom>
  <worldbody>
    <site name="A1" pos="-1 0 2"/><site name="A2" pos="1 0 2"/><site name="A3" pos="0 0 0"/>
    <body name="platform" pos="0 0 1">
      <joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1"/>
      <inertial pos="0 0 0" mass="1.5" diaginertia="0.1 0.1 0.1"/>
      <site name="B1"/><site name="B2"/><site name="B3"/>
    </body>
  </worldbody>
  <tendon>
    <spatial name="left" {left}</spatial>
    <spatial name="right" springlength="0 1.41421356" stiffness="8485.28137">
      <site site="A2"/><site site="B2"/></spatial>
    <spatial name="band" {band}</spatial>
  </tendon>
</mujoco>
"""
L0, K, BAND_L0, BAND_K = 2.0 * 1.41421356, 2121.3203425, 0.7, 30.0
FALLS = np.array([2.0, 1.0, 2.0])
POSES = np.array(
    [[x, 0.0, z, 1.0, 0.0, 0.0, 0.0] for x, z in ((0, 1.2), (0.3, 1.3), (-0.2, 0.9), (0, 1.97))]
)
ENDS = np.array([[-1.0, 2.0], [1.0, 2.0], [0.0, 0.0]])


def line(spring: tuple[float, float], k: int, times: int) -> str:
    """The rest of a tendon that runs so many times between its points."""
    way = [f'<site site="{"AB"[j % 2]}{k}"/>' for j in range(times + 1)]
    return f'springlength="0 {spring[0]}" stiffness="{spring[1]}">{"".join(way)}'


@pytest.fixture(name="both")
def fixture_both(tmp_path: Path) -> tuple[seecr.Robot, seecr.Robot]:
    """The robot with tackles, and the same by hand."""
    out = []
    for name, times in (("tackle", 2), ("hand", 1)):
        path, n = tmp_path / f"{name}.xml", 2 // times
        springs = [(rest / n, n**2 * k) for rest, k in ((L0, K), (BAND_L0, BAND_K))]
        left, band = (line(one, k, times) for one, k in zip(springs, (1, 3), strict=True))
        path.write_text(FILE.format(texts="", left=left, band=band))
        out.append(seecr.load_robot(path))
    return out[0], out[1]


def energy(x: np.ndarray, command: np.ndarray) -> float:
    """Of the file, as it is written: lengths of the lines, paid out for a command; J."""
    pairs = ((2.0, L0, K), (1.0, 1.41421356, 8485.28137), (2.0, BAND_L0, BAND_K))
    home, total = np.array([0.0, 1.0]), 9.81 * 1.5 * x[1]
    for k, (falls, rest, stiffness) in enumerate(pairs):
        now, told, there = (float(np.linalg.norm(p - ENDS[k])) for p in (x, command, home))
        paid = rest if k == 2 else rest + falls * (told - there)
        stretch = max(falls * now - paid, 0.0)
        total += 0.5 * stiffness * rest / paid * stretch**2
    return total


def test_it_rests_where_the_energy_is_least(both: tuple[seecr.Robot, seecr.Robot]) -> None:
    robot, _hand = both
    assert robot.falls.tolist() == FALLS.tolist() and robot.driven.tolist() == [True, True, False]
    found = seecr.solve(robot, POSES)
    for k, pose in enumerate(POSES):
        told = pose[[0, 2]]
        rest = minimize(energy, told, (told,), "Nelder-Mead", options={"xatol": 1e-10, "fatol": 0})
        assert found.pose[k, [0, 2]] == pytest.approx(rest.x, abs=1e-7)
    # the band's own line: k (2 l - l0)
    length = np.linalg.norm(found.pose[:, [0, 2]], axis=1)
    assert found.tensions[:, 2] == pytest.approx(BAND_K * (2.0 * length - BAND_L0), rel=1e-9)


def test_it_is_the_robot_by_hand_with_its_lines_tensions(
    both: tuple[seecr.Robot, seecr.Robot],
) -> None:
    one, two = (seecr.solve(each, POSES) for each in both)
    np.testing.assert_allclose(one.pose, two.pose, atol=1e-12)
    np.testing.assert_allclose(one.tensions * FALLS, two.tensions, rtol=1e-9)
    read, plain = (seecr.predict(each, POSES).readings.tensions for each in both)
    np.testing.assert_allclose(read * FALLS, plain, rtol=1e-9)


@pytest.mark.parametrize("whole", [False, True])
def test_limits_and_aims_are_of_the_driven_lines(
    whole: bool, both: tuple[seecr.Robot, seecr.Robot]
) -> None:
    """Given for them, or for all lines: those of the band mean nothing."""
    robot, hand = both
    low, high = np.array([10.0, 15.0]), np.array([200.0, 300.0])
    own = [np.append(one, 7e3) if whole else one for one in (low, high)]
    line = seecr.tension_margin(robot, POSES, lowest=own[0], highest=own[1])
    cable = seecr.tension_margin(hand, POSES, lowest=FALLS[:2] * low, highest=FALLS[:2] * high)
    np.testing.assert_allclose(line, cable, atol=1e-9)
    assert (line > 0.0).any() and not (line > 0.0).all()
    held = POSES[line > 0.0]
    found = seecr.correct(robot, held, lowest=own[0], highest=own[1], aim="middle")
    other = seecr.correct(
        hand, held, lowest=FALLS[:2] * low, highest=FALLS[:2] * high, aim="middle"
    )
    assert found.reached.all()
    np.testing.assert_allclose(found.lengths, other.lengths, atol=1e-9)
    np.testing.assert_allclose(found.lengths[:, 2], BAND_L0 / 2.0)
    pulls = found.solution.tensions[:, :2]
    assert np.all(pulls >= low - 1e-6) and np.all(pulls <= high + 1e-6)


def test_what_is_saved_is_read_again(both: tuple[seecr.Robot, seecr.Robot], tmp_path: Path) -> None:
    """A weight on a doubled line pulls the platform with twice the line's tension."""
    robot, _hand = both
    robot.save(tmp_path / "saved.xml")
    again = seecr.load_robot(tmp_path / "saved.xml")
    for name in ("ea", "rest_lengths", "falls", "driven", "pushes", "constant_tension_N"):
        np.testing.assert_allclose(getattr(again, name), getattr(robot, name), rtol=1e-12)
    path = tmp_path / "weight.xml"
    weight = '<text name="constant_tension" data="left=9N"/>'
    left, band = line((0.0, 0.0), 1, 2), line((BAND_L0, BAND_K), 3, 2)
    path.write_text(FILE.format(texts=weight, left=left, band=band))
    hung = seecr.load_robot(path)
    assert hung.constant_tension_N[0] == pytest.approx(18.0)
    found = seecr.solve(hung, hung.reference_pose)
    assert found.converged[0] and found.tensions[0, 0] == pytest.approx(9.0)
    note = "tendon left runs 2 times between its points: read as one cable of 2 times its constant"
    assert any(note in one and "winch" not in one for one in hung.notes)
    hung.save(tmp_path / "hung.xml")
    assert seecr.load_robot(tmp_path / "hung.xml").constant_tension_N[0] == pytest.approx(18.0)
    assert 'data="left=9.0N"' in (tmp_path / "hung.xml").read_text()
