"""The shipped robots: the paper's numbers to the last digit, and what MuJoCo makes of them."""

from __future__ import annotations

import importlib.util
import math
import os
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import mujoco
import numpy as np
import pytest
from scipy.optimize import linprog

from seecr.description import mjcf
from seecr.description.mjcf import CABLES, load_robot, model_names, model_path, robot_file
from seecr.equilibrium.solving import solve
from seecr.errors import InputError
from seecr.prediction.model import load_model
from seecr.workspace.margins import tension_margin

ROOT = Path(__file__).resolve().parents[3]
DEMOBOTS = ("demobot_cogiro", "demobot_parallel")
PLANAR = ("planar_horizontal", "planar_two_cable", "planar_vertical")
ROBOTS = (*DEMOBOTS, *PLANAR)
# No robots of the paper's: without them an error that confuses cables would show nothing.
UNEVEN = ("demobot_off_centre", "demobot_uneven")
# Of another size and kind.
OTHERS = ("camera", "cogiro_large", "ipanema")

# Paper, Table II, typed from the page and not from the generator: A_i in the base frame | B_i in
# the platform frame [m]. Cogiro's A4 stands here as it is printed.
TABLE_II = {
    "demobot_cogiro": """
        0.08 0.04 0.485 |  0.04   -0.03   0.018
        0.04 0.08 0.485 | -0.0515  0.022 -0.018
        0.04 0.42 0.485 | -0.0515 -0.022  0.018
        0.08 0.04 0.485 |  0.04    0.03  -0.018
        0.72 0.46 0.485 | -0.04    0.03   0.018
        0.76 0.42 0.485 |  0.0515 -0.022 -0.018
        0.76 0.08 0.485 |  0.0515  0.022  0.018
        0.72 0.04 0.485 | -0.04   -0.03  -0.018""",
    "demobot_parallel": """
        0.04 0.04 0.486 | -0.0515 -0.022  0.018
        0.04 0.04 0.450 | -0.0515 -0.022 -0.018
        0.04 0.46 0.486 | -0.0515  0.022  0.018
        0.04 0.46 0.450 | -0.0515  0.022 -0.018
        0.76 0.46 0.486 |  0.0515  0.022  0.018
        0.76 0.46 0.450 |  0.0515  0.022 -0.018
        0.76 0.04 0.486 |  0.0515 -0.022  0.018
        0.76 0.04 0.450 |  0.0515 -0.022 -0.018""",
}


def table_ii(name: str, *, corrected: bool) -> tuple[np.ndarray, np.ndarray]:
    rows = [line.replace("|", " ").split() for line in TABLE_II[name].split("\n") if line.strip()]
    points = np.array(rows, dtype=float)
    if corrected and name == "demobot_cogiro":
        points[3, 1] = 0.46
    return points[:, :3], points[:, 3:]


def compiled(name: str) -> Any:
    return mujoco.MjModel.from_xml_path(str(model_path(name)))


def sites(model: Any, letter: str) -> np.ndarray:
    return np.array([model.site(f"{letter}{i + 1}").pos for i in range(model.ntendon)])


@pytest.fixture(scope="module")
def generator() -> Any:
    path = ROOT / "models" / "make_models.py"
    spec = importlib.util.spec_from_file_location("make_models", path)
    assert spec is not None and spec.loader is not None
    module: ModuleType = importlib.util.module_from_spec(spec)
    sys.modules["make_models"] = module
    spec.loader.exec_module(module)
    yield module
    del sys.modules["make_models"]


# --- the numbers -------------------------------------------------------------------------------


@pytest.mark.parametrize("name", DEMOBOTS)
def test_table_ii_to_the_last_digit(name: str) -> None:
    model = compiled(name)
    exit_points, anchor_points = table_ii(name, corrected=True)
    assert np.array_equal(sites(model, "A"), exit_points)
    assert np.array_equal(sites(model, "B"), anchor_points)
    assert np.array_equal(model.body("platform").pos, [0.4, 0.25, 0.15])
    assert np.array_equal(model.body("platform").quat, [1, 0, 0, 0])


def mirrored(points: np.ndarray, axis: int, middle: float) -> set[tuple[float, ...]]:
    image = points.copy()
    image[:, axis] = 2 * middle - image[:, axis]
    return {tuple(p) for p in image.round(9)}


def test_half_a_turn_takes_cogiro_to_itself() -> None:
    """Which gives A4 from A8, whatever the mirror images say: cable i to cable i + 4."""
    robot = load_robot("demobot_cogiro")
    turned = robot.exit_points * [-1, -1, 1] + [0.8, 0.5, 0.0]
    np.testing.assert_allclose(np.roll(turned, 4, axis=0), robot.exit_points, atol=1e-12)
    anchors = robot.anchor_points * [-1, -1, 1]
    np.testing.assert_allclose(np.roll(anchors, 4, axis=0), robot.anchor_points, atol=1e-12)


def test_cogiro_a4_is_corrected_to_the_mirror_image_of_a1() -> None:
    printed, _ = table_ii("demobot_cogiro", corrected=False)
    assert np.array_equal(printed[3], printed[0])  # two cables from one hole
    shipped_points = sites(compiled("demobot_cogiro"), "A")
    for points, symmetric in ((shipped_points, True), (printed, False)):
        here = {tuple(p) for p in points.round(9)}
        assert (mirrored(points, 1, 0.25) == here) is symmetric
        assert (mirrored(points, 0, 0.40) == here) is symmetric


def statically_feasible(exit_points: np.ndarray, anchors: np.ndarray, place: np.ndarray) -> bool:
    """Are there tensions tau >= 0 with W tau + w_e = 0 (paper, eq 3) for the unturned platform?"""
    along = exit_points - (anchors + place)
    unit = along / np.linalg.norm(along, axis=1)[:, None]
    wrench_matrix = np.vstack([unit.T, np.cross(anchors, unit).T / 0.05])
    load = np.array([0, 0, -0.4 * 9.81, 0, 0, 0])
    answer = linprog(np.zeros(len(unit)), A_eq=wrench_matrix, b_eq=-load, bounds=(0, None))
    assert answer.status in (0, 2), answer.message  # solved, or proved infeasible
    return bool(answer.status == 0)


@pytest.mark.parametrize(("z", "lost"), [(0.1, 5), (0.2, 7)])
def test_printed_a4_loses_the_left_of_the_papers_own_trajectory(z: float, lost: int) -> None:
    places = [np.array([x, 0.25, z]) for x in np.linspace(0.17, 0.63, 24)]
    model = compiled("demobot_cogiro")
    corrected = [statically_feasible(sites(model, "A"), sites(model, "B"), p) for p in places]
    assert all(corrected)
    exits, anchors = table_ii("demobot_cogiro", corrected=False)
    printed = np.array([statically_feasible(exits, anchors, p) for p in places])
    assert np.array_equal(printed, np.arange(24) >= lost)  # all on the left


@pytest.mark.parametrize("name", ROBOTS)
def test_mass_centre_and_inertia(name: str) -> None:
    model, (a, b, c) = compiled(name), (0.102, 0.044, 0.036)
    if name == "planar_two_cable":
        a, b, c = 0.2, 0.02, 0.02
    body = model.body("platform")
    assert body.mass[0] == 0.4
    assert model.body_mass.sum() == 0.4  # looks weigh nothing
    assert np.array_equal(body.ipos, np.zeros(3))
    assert np.array_equal(body.iquat, [1, 0, 0, 0])
    box = 0.4 / 12 * np.array([b**2 + c**2, a**2 + c**2, a**2 + b**2])
    assert body.inertia == pytest.approx(box, rel=1e-14)
    assert np.array_equal(model.geom("platform").size, np.array([a, b, c]) / 2)
    assert np.array_equal(model.opt.gravity, [0, 0, -9.81])


@pytest.mark.parametrize("name", ROBOTS)
def test_k_c_is_exactly_vectran(name: str) -> None:
    model = compiled(name)
    assert np.array_equal(model.tendon_lengthspring[:, 0], np.zeros(model.ntendon))
    k_c = model.tendon_stiffness * model.tendon_lengthspring[:, 1]
    assert np.array_equal(k_c, np.full(model.ntendon, CABLES["vectran"]))


@pytest.mark.parametrize("name", ROBOTS)
def test_rest_lengths_are_the_straight_lengths_at_the_reference_pose(name: str) -> None:
    model = compiled(name)
    straight = np.linalg.norm(
        sites(model, "A") - (sites(model, "B") + model.body("platform").pos), axis=1
    )
    short = straight - model.tendon_lengthspring[:, 1]
    assert np.all(short > 0)  # else MuJoCo's viewer draws no cables: see the next test
    assert np.all(short <= 6 * np.spacing(straight))


@pytest.mark.parametrize("name", ROBOTS)
def test_viewer_draws_every_cable_at_the_reference_pose(name: str) -> None:
    model = compiled(name)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    scene = mujoco.MjvScene(model, 500)
    mujoco.mjv_updateScene(
        model, data, mujoco.MjvOption(), mujoco.MjvPerturb(), mujoco.MjvCamera(),
        mujoco.mjtCatBit.mjCAT_ALL, scene,
    )  # fmt: skip
    cables = [g for g in scene.geoms[: scene.ngeom] if g.objtype == mujoco.mjtObj.mjOBJ_TENDON]
    assert len(cables) == model.ntendon
    assert all(np.all(np.isfinite(g.pos)) for g in cables)


def test_named_cables_differ_by_ten() -> None:
    assert CABLES == {"vectran": 3000.0, "fishing": 300.0}
    assert CABLES["vectran"] / CABLES["fishing"] == 10.0  # section IV: "approximately 10 times"
    nylon = np.array([1.5e9, 3.0e9]) * math.pi * 0.2e-3**2
    assert nylon[0] < CABLES["fishing"] < nylon[1]


# --- the planar robots -------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "offset"), [("planar_vertical", (0, 0, -0.036)),
                                              ("planar_horizontal", (0.103, 0, 0))])  # fmt: skip
def test_four_cable_pairs_are_parallelograms(name: str, offset: tuple[float, ...]) -> None:
    model = compiled(name)
    for points in (sites(model, "A"), sites(model, "B")):
        assert points[1] - points[0] == pytest.approx(offset, abs=1e-15)
        assert points[3] - points[2] == pytest.approx(offset, abs=1e-15)


# --- robots of another size and kind -----------------------------------------------------------


@pytest.mark.parametrize("name", OTHERS)
def test_others_hold_together(name: str) -> None:
    model = compiled(name)
    robot = load_robot(name)
    platform = model.geom("platform")
    assert model.body_mass.sum() == robot.mass  # looks weigh nothing
    if name != "cogiro_large":  # which has its own
        edges = 4.0 * platform.size**2
        inertia = robot.mass / 12 * (edges.sum() - edges)
        np.testing.assert_allclose(np.diag(robot.inertia), inertia, rtol=1e-12)
    assert np.all(np.abs(robot.anchor_points - platform.pos) <= platform.size + 0.01)
    # exit points apart, above the floor
    assert np.all(robot.exit_points[:, 2] >= 0.0) and robot.ea.min() == robot.ea.max()
    assert len({tuple(point) for point in robot.exit_points}) == robot.n_cables
    assert solve(robot, robot.reference_pose).converged[0]


def test_cogiro_is_that_of_its_description() -> None:
    robot = load_robot("cogiro_large")
    # a half turn takes each cable nearly to the one opposite: it was built so, and measured
    turn = np.array([-1.0, -1.0, 1.0])
    np.testing.assert_allclose(robot.exit_points[4:], robot.exit_points[:4] * turn, atol=0.09)
    np.testing.assert_allclose(robot.anchor_points[4:], robot.anchor_points[:4] * turn, atol=0.02)
    # its equation (2): the same in the platform frame, with products of inertia, +integral x y dm
    c = robot.centre_of_mass
    about_p = robot.inertia + robot.mass * (c @ c * np.eye(3) - np.outer(c, c))
    printed = [[42.955, 0.414, -2.205], [0.414, 42.427, 1.849], [-2.205, 1.849, 25.557]]
    np.testing.assert_allclose(about_p, printed, atol=0.02)


@pytest.mark.parametrize(("payload", "reach"), [(300.0, 5.0), (500.0, 1.0)])
def test_cogiro_carries_what_its_description_says(payload: float, reach: float) -> None:
    """More than 300 kg over all its workspace, 500 kg near the middle, with at most 5000 N."""
    robot = load_robot("cogiro_large")
    poses = np.tile(robot.reference_pose, (3, 1))
    poses[:, 0] = [-reach, 0.0, reach]
    arm = robot.centre_of_mass
    wrench = [0.0, 0.0, -9.81 * payload, -9.81 * payload * arm[1], 9.81 * payload * arm[0], 0.0]
    assert np.all(tension_margin(robot, poses, highest=5000.0, wrenches=[wrench]) > 0.0)


def test_the_large_ones_sag_is_beside_it() -> None:
    robot = load_robot("cogiro_large")
    sag = load_model(model_path("cogiro_large").with_name("sag.toml"), robot)
    assert sag.notes == () and sag.names == ("cable_weight",)
    pose = robot.reference_pose - np.array([4.5, 0, 0, 0, 0, 0, 0])
    plain, hanging = solve(robot, pose), solve(robot, pose, effects=sag)
    moved = np.linalg.norm(plain.pose[0, :3] - hanging.pose[0, :3])
    assert 0.5e-3 < moved < 2e-3
    # half of each cable's weight hangs on the platform
    assert np.all(hanging.tensions > plain.tensions)


def test_pretension_balances_the_weight_where_the_winches_were_zeroed() -> None:
    robot = load_robot("ipanema")
    found = solve(robot, robot.reference_pose)
    np.testing.assert_allclose(found.deviation[0], 0.0, atol=1e-12)
    tensions = found.tensions[0]
    assert tensions.mean() == pytest.approx(500.0, abs=1.0)
    np.testing.assert_allclose(tensions[:4], tensions[0], rtol=1e-9)
    # nearest: what is off 500 N makes no wrench of its own, W^T y for some y
    ends = robot.reference_pose[:3] + robot.anchor_points
    unit = robot.exit_points - ends
    unit /= np.linalg.norm(unit, axis=1)[:, None]
    wrench_matrix = np.vstack([unit.T, np.cross(robot.anchor_points, unit).T])
    off = tensions - 500.0
    rebuilt = wrench_matrix.T @ np.linalg.lstsq(wrench_matrix.T, off, rcond=None)[0]
    np.testing.assert_allclose(rebuilt, off, atol=1e-6)


# --- in MuJoCo ---------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ROBOTS)
def test_cables_pull_and_never_push(name: str) -> None:
    model = compiled(name)
    data = mujoco.MjData(model)
    height = model.jnt_qposadr[0] + (2 if name in DEMOBOTS else 1)
    dof = 2 if name in DEMOBOTS else 1
    reference = data.qpos[height]
    for shift, pulls in ((-0.001, True), (0.001, False)):
        data.qpos[height] = reference + shift
        mujoco.mj_forward(model, data)
        if pulls:
            assert data.qfrc_passive[dof] > 0.1
        else:
            assert not np.any(data.qfrc_passive)


# --- the files ---------------------------------------------------------------------------------


def test_generator_reproduces_the_files(generator: Any) -> None:
    assert {m.name for m in generator.MODELS} == {*ROBOTS, *UNEVEN, *OTHERS}
    for model in generator.MODELS:
        path = ROOT / "models" / model.name / f"{model.name}.xml"
        assert path.read_text(encoding="utf-8") == generator.write_mjcf(model)


def test_generator_check_names_the_file_that_differs(
    generator: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    monkeypatch.setattr(generator, "HERE", tmp_path)
    assert generator.main([]) == 0
    assert generator.main(["--check"]) == 0
    changed = tmp_path / "demobot_cogiro" / "demobot_cogiro.xml"
    changed.write_text(changed.read_text().replace("0.46", "0.04"))
    capsys.readouterr()
    assert generator.main(["--check"]) == 1
    assert "demobot_cogiro.xml: is not what make_models.py writes" in capsys.readouterr().out
    assert generator.main(["--chek"]) == 2
    assert "expected no argument or --check, got: --chek" in capsys.readouterr().err


def test_exact_spring_for_any_length_and_constant(generator: Any) -> None:
    random = np.random.default_rng(1)
    for k_c, length in zip(10 ** random.uniform(2, 7, 500), random.uniform(0.05, 20, 500),
                           strict=True):  # fmt: skip
        stiffness, rest = generator.exact_spring(float(k_c), float(length))
        assert stiffness * rest == k_c
        assert 0 < length - rest < 1e-13 * length


def test_model_names_are_the_folders() -> None:
    assert model_names() == tuple(sorted((*ROBOTS, *UNEVEN, *OTHERS)))


def test_unknown_model_lists_the_known_nearest_first() -> None:
    with pytest.raises(InputError) as caught:
        model_path("demobot_paralel")
    text = str(caught.value)
    assert text.startswith(
        "shipped robot 'demobot_paralel': expected one of demobot_parallel, demobot_uneven, "
    )
    assert all(name in text for name in ROBOTS) and "\n" not in text


def test_a_robot_is_a_file_or_a_shipped_name(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    assert robot_file("planar_vertical") == model_path("planar_vertical")
    (tmp_path / "planar_vertical").mkdir()  # results of it, perhaps
    assert robot_file("planar_vertical") == model_path("planar_vertical")
    (tmp_path / "cogiro_large").write_text("mine")
    assert robot_file("cogiro_large") == Path("cogiro_large")
    for path in ("gone.xml", "folder/gone"):
        assert robot_file(path) == Path(path)  # whoever reads it says what is wrong
    with pytest.raises(InputError) as caught:
        robot_file("demobot_4")
    assert str(caught.value).startswith(
        "demobot_4: neither a file nor a shipped robot; expected an MJCF file or one of demobot_"
    )


def test_missing_models_folder_is_said(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(mjcf, "_PLACES", (tmp_path,))
    with pytest.raises(InputError, match="none: the models folder is missing"):
        model_path("demobot_cogiro")


def test_a_shipped_robot_is_read_once_and_again_if_its_file_is_written_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert load_robot("ipanema") is load_robot("ipanema")
    path = tmp_path / "own" / "own.xml"
    path.parent.mkdir()
    path.write_bytes(model_path("ipanema").read_bytes())
    assert load_robot(path) is not load_robot(path), "what a user's file includes may change"
    monkeypatch.setattr(mjcf, "_PLACES", (tmp_path,))
    before = load_robot("own")
    assert load_robot("own") is before
    path.write_bytes(model_path("own").read_bytes().replace(b"ipanema", b"other"))
    os.utime(path, ns=(0, 0))
    assert load_robot("own") is not before and load_robot("own").name == "other"
