"""Frequencies of small vibrations: closed forms, and MuJoCo's own inertia and stiffness."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from robots import WAYS, rejointed
from scipy.linalg import eigh

import seecr
from crosscheck.settle.newton import stiffness
from crosscheck.settle.physics import Physics
from seecr.compiled.algebra import diagonalise, softest_batch, softest_motions
from seecr.effects.setup import plain_setup
from seecr.pose import Array, quat_from_rotvec
from seecr.show.pose_words import direction_words, stiffness_lines
from seecr.statics.tables import assemble
from seecr.statics.vibration import mass_matrices

BOB = seecr.Robot(
    "bob", np.array([[0.0, 0, 1]]), np.zeros((1, 3)), np.array([100.0]), np.ones(1), 2.0,
    inertia=0.01 * np.eye(3),
)  # fmt: skip


def test_a_bob_swings_as_a_pendulum_and_bounces_on_its_cable() -> None:
    found = seecr.solve(BOB, [[0.0, 0, 0, 1, 0, 0, 0]])
    length = 1.0 + BOB.weight / 100.0
    pendulum, bounce = np.sqrt([9.81 / length, 100.0 / 2.0]) / (2.0 * np.pi)
    np.testing.assert_allclose(
        found.frequencies[0], [0, 0, 0, pendulum, pendulum, bounce], rtol=1e-9, atol=1e-9
    )
    assert direction_words(BOB, found.modes[1][0, :, 5]) == "move along z"
    assert next(stiffness_lines(found)).startswith("free to turn about ")


def test_free_to_turn_beside_a_cable_that_just_becomes_taut_has_no_frequency() -> None:
    """Two cables hold it, a third is exactly as long as its rest length."""
    robot = seecr.load_robot("demobot_parallel")
    found = seecr.solve(robot, [[0.225, 0.35, 0.1, 1, 0, 0, 0]])
    assert found.status[0] is seecr.Status.SINGULAR and np.sum(~found.slack) == 2
    assert found.frequencies[0, 0] == 0.0 < found.frequencies[0, 1]
    assert np.linalg.eigvalsh(found.stiffness[0])[0] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("name", ["demobot_parallel", "demobot_off_centre", "planar_vertical"])
def test_mujocos_inertia_and_stiffness_give_the_same(name: str) -> None:
    path = seecr.model_path(name)
    robot = seecr.load_robot(path)
    pose = robot.reference_pose + np.array([0.03, 0, 0.02, 0, 0, 0, 0])
    found = seecr.solve(robot, pose)
    assert found.converged[0]
    physics = Physics.of(path)
    physics.set_cables(found.rest_lengths[0], robot.ea)
    physics.place(found.pose[0])
    mujoco.mj_forward(physics.model, physics.data)
    mass = np.zeros((physics.n_dof, physics.n_dof))
    mujoco.mj_fullM(physics.model, physics.data, mass)
    metre = physics.metre[:, None] * physics.metre
    slope = stiffness(physics, ~found.slack[0]) * metre / physics.mass_unit
    squares = np.linalg.eigvals(np.linalg.solve(mass, slope)).real
    np.testing.assert_allclose(
        np.sqrt(np.sort(squares)) / (2.0 * np.pi), found.frequencies[0], rtol=1e-4
    )


def test_a_heavier_platform_vibrates_with_its_own_mass() -> None:
    added = seecr.Term.of(BOB, "platform_mass", added_kg=2.0)
    found = seecr.solve(BOB, [[0.0, 0, 0, 1, 0, 0, 0]], effects=[added])
    assert found.frequencies[0, -1] == pytest.approx(np.sqrt(100.0 / 4.0) / (2.0 * np.pi))


def test_an_inertia_that_nobody_said_is_asked_for() -> None:
    found = seecr.solve(replace(BOB, inertia=np.zeros((3, 3))), [[0.0, 0, 0, 1, 0, 0, 0]])
    with pytest.raises(seecr.InputError, match="robot bob: its inertia is not known"):
        _ = found.frequencies


# --- The mass matrix: kinetic energy of motions whose velocities are known


ASIDE = np.array([0.1, -0.2, 0.3])
FREE = replace(
    seecr.load_robot("demobot_cogiro"), mass=2.0, centre_of_mass=ASIDE,
    inertia=np.diag([0.01, 0.02, 0.04]), joints=(),
)  # fmt: skip


def matrix(robot: seecr.Robot, pose: Array) -> Array:
    tables = assemble(plain_setup(robot, seecr.Commands(pose[None])))
    return mass_matrices(robot, tables, pose[None])[0]


def turned() -> Array:
    pose = FREE.reference_pose.copy()
    pose[3:] = quat_from_rotvec(np.array([[0.4, -0.7, 0.2]]))[0]
    return pose


def test_without_gravity_the_mass_is_that_of_the_description() -> None:
    floating = replace(FREE, gravity=np.zeros(3))
    assert matrix(floating, turned()) == pytest.approx(matrix(FREE, turned()))


# --- The softest motion is the platform's, whatever joints it is on


POSES = np.array([[0.05, 0.02, 0.3], [-0.1, 0.0, -0.5], [0.0, 0.08, 0.0]])


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("name", ["planar_vertical", "planar_two_cable"])
def test_the_softest_motion_does_not_depend_on_the_joints(name: str, way: str) -> None:
    """With the hinge first it had a third to a thirtieth of the stiffness."""
    robot = seecr.load_robot(name)
    poses = np.tile(robot.reference_pose, (3, 1))
    poses[:, [0, 2]] += POSES[:, :2]
    poses[:, 3:] = quat_from_rotvec(POSES[:, 2:] * [0.0, 1.0, 0.0])
    here, there = seecr.solve(robot, poses), seecr.solve(rejointed(robot, way), poses)
    assert here.converged.all() and there.softest_direction.shape == (3, 6)
    np.testing.assert_allclose(there.smallest_eigenvalue, here.smallest_eigenvalue, rtol=1e-9)
    np.testing.assert_allclose(there.softest_direction, here.softest_direction, atol=1e-6)
    metre = np.repeat([1.0, robot.length], 3)
    assert np.linalg.norm(there.softest_direction * metre, axis=1) == pytest.approx(1.0)
    # it is the motion of the joints whose stiffness that is
    for one in (here, there):
        value, vectors = np.linalg.eigh(one.stiffness[0])
        moved = one.motion(0, vectors[:, 0]) * metre
        assert value[0] >= one.smallest_eigenvalue[0] * (moved @ moved) * (1.0 - 1e-9)
    assert list(stiffness_lines(here.rows([0]))) == list(stiffness_lines(there.rows([0])))


def test_maps_have_the_platforms_motion() -> None:
    robot = seecr.load_robot("planar_vertical")
    at = [np.linspace(k - 0.05, k + 0.05, 3) for k in robot.reference_pose[[0, 2]]]
    grid = (at[0], robot.reference_pose[1], at[1])
    here, there = (seecr.workspace_map(one, *grid) for one in (robot, rejointed(robot, "both")))
    assert there.softest.shape == (3, 1, 3, 6)
    np.testing.assert_allclose(there.stiffness, here.stiffness, rtol=1e-5)
    np.testing.assert_allclose(there.softest, here.softest, atol=1e-4)
    assert there.records()[0]["softest_ry_rad"] == there.softest[0, 0, 0, 4]


# --- The compiled smallest eigenvalue and its direction against LAPACK's


# Parts of the largest entry: a few roundings of six unknowns. LAPACK leaves a quarter of that.
_VALUE, _RESIDUAL = 1e-14, 4e-14


def softest(matrices: Array) -> tuple[Array, Array]:
    values, directions = np.empty(len(matrices)), np.empty(matrices.shape[:2])
    softest_batch(matrices, values, directions)
    return values, directions


def of_spectrum(spectrum: Array, n: int = 500) -> Array:
    """Symmetric matrices (n, d, d) of given eigenvalues in random frames."""
    random = np.random.default_rng(len(spectrum))
    frames = np.linalg.qr(random.normal(size=(n, len(spectrum), len(spectrum))))[0]
    out = frames * spectrum @ frames.swapaxes(1, 2)
    return 0.5 * (out + out.swapaxes(1, 2))


def families(d: int) -> Iterator[Array]:
    """Definite and not, badly scaled, of whole numbers, with zeros, repeated and of all sizes."""
    random = np.random.default_rng(d)
    half, scale = random.normal(size=(3000, d, d)), 10.0 ** random.uniform(-12.0, 12.0, (3000, d))
    for dense in (half @ half.swapaxes(1, 2), half + half.swapaxes(1, 2)):
        yield from (dense, dense * scale[:, :, None] * scale[:, None])
    whole = random.integers(-1, 2, (3000, d, d)).astype(float)
    for one in (whole, np.where(random.random((3000, d, d)) < 0.2, whole, 0.0)):
        yield one + one.swapaxes(1, 2)
    yield np.stack([np.eye(d), -np.eye(d), np.ones((d, d)), -np.ones((d, d)), np.zeros((d, d))])
    steps, sizes = np.arange(d, dtype=float), 10.0 ** -np.arange(0.0, 3.0 * d, 3.0)
    for near in (near * steps for near in (0.0, 1e-15, 1e-12, 1e-8, 1e-4)):
        yield from (of_spectrum(1.0 + near), of_spectrum(-1.0 + near))
        yield of_spectrum(np.where(steps < d // 2, near, 1.0))
        yield of_spectrum(np.where(steps < d // 2, 1.0 + near, -1.0))
    for spectrum in (sizes, -sizes, np.where(steps % 2, sizes, -sizes)):
        yield from (times * of_spectrum(spectrum) for times in (1.0, 1e150, 1e-150))


@pytest.mark.parametrize("d", [1, 2, 3, 6, 9])
def test_eigenvalues_are_lapacks_and_directions_have_them(d: int) -> None:
    """Of repeated eigenvalues any direction will do."""
    for matrices in families(d):
        matrices = np.array(matrices, order="C")
        values, directions = softest(matrices)
        top = np.abs(matrices).max(axis=(1, 2))
        expected = np.linalg.eigvalsh(matrices)[:, 0]
        assert np.all(np.abs(values - expected) <= _VALUE * top)
        np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0, rtol=1e-14)
        left = np.einsum("nij,nj->ni", matrices, directions) - values[:, None] * directions
        assert np.all(np.abs(left).max(axis=1) <= _RESIDUAL * top)
        largest = np.abs(directions).max(axis=1)
        assert np.all(directions.max(axis=1) >= (1.0 - 2e-6) * largest)


@pytest.mark.parametrize("d", [1, 3, 6])
def test_all_eigenvalues_and_vectors_make_the_matrix_again(d: int) -> None:
    for matrix in (one for some in families(d) for one in some[::50]):
        diagonal, vectors = np.tril(matrix) + np.triu(np.full((d, d), np.nan), 1), np.empty((d, d))
        diagonalise(diagonal, vectors)
        values, top = np.diag(diagonal), np.abs(matrix).max()
        expected = np.linalg.eigvalsh(matrix)
        assert np.all(np.abs(np.sort(values) - expected) <= _VALUE * top)
        np.testing.assert_allclose(vectors.T @ vectors, np.eye(d), atol=1e-14)
        assert np.all(np.abs(matrix @ vectors - vectors * values) <= _RESIDUAL * top)


def test_only_the_lower_triangle_is_read() -> None:
    matrix = of_spectrum(np.arange(6.0), 1)
    half = np.tril(matrix) + np.triu(np.full((6, 6), np.nan), 1)
    for found, expected in zip(softest(half), softest(matrix), strict=True):
        np.testing.assert_array_equal(found, expected)


def test_what_is_no_number_has_no_direction() -> None:
    for bad in (np.nan, np.inf, -np.inf):
        matrices = np.tile(np.eye(3), (2, 1, 1))
        matrices[0, 2, 1] = bad
        values, directions = softest(matrices)
        assert np.isnan(values[0]) and np.isnan(directions[0]).all()
        assert values[1] == pytest.approx(1.0, abs=_VALUE)


def test_the_sign_is_that_of_the_largest_part() -> None:
    direction = np.array([0.1, -0.2, 0.3, -0.9, 0.1, 0.2])
    direction /= np.linalg.norm(direction)
    matrices = 2.0 * np.eye(6) - np.outer(direction, direction)
    found = softest(np.array([matrices]))[1][0]
    np.testing.assert_allclose(found, -direction, atol=1e-14)
    level = np.full((1, 2, 2), [[1.0, 0.5], [0.5, 1.0]])
    np.testing.assert_allclose(softest(level)[1][0], [np.sqrt(0.5), -np.sqrt(0.5)], atol=1e-15)


@pytest.mark.parametrize("d", [1, 2, 3, 5, 6])
def test_on_joints_it_is_the_generalised_problem_of_the_platforms_motions(d: int) -> None:
    random = np.random.default_rng(10 + d)
    half, mix = random.normal(size=(200, d, d)), np.eye(d) + 0.2 * random.normal(size=(200, d, d))
    columns = mix @ np.linalg.qr(random.normal(size=(200, 6, 6)))[0][:, :d]
    matrices = half + half.swapaxes(1, 2)
    values, motions = np.empty(200), np.empty((200, 6))
    softest_motions(matrices, columns, values, motions)
    for matrix, column, value, motion in zip(matrices, columns, values, motions, strict=True):
        expected, vectors = eigh(matrix, column @ column.T)
        assert value == pytest.approx(expected[0], rel=1e-8, abs=1e-10)
        np.testing.assert_allclose(np.abs(motion), np.abs(vectors[:, 0] @ column), atol=1e-6)
        assert np.linalg.norm(motion) == pytest.approx(1.0)
        assert motion.max() >= np.abs(motion).max() * (1.0 - 2e-6)


def test_on_joints_not_a_number_is_none() -> None:
    values, motions = np.empty(2), np.empty((2, 6))
    columns = np.tile(np.eye(6)[:3], (2, 1, 1))
    matrices = np.tile(np.eye(3), (2, 1, 1))
    columns[0, 0, 0] = matrices[1, 2, 2] = np.nan
    softest_motions(matrices, columns, values, motions)
    assert np.isnan(values).all() and np.isnan(motions).all()
