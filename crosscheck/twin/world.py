"""The true robot in MuJoCo: its cables' springs, its state, its forces."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from crosscheck.settle.newton import minimise, neutral_stiffness, stiffness
from crosscheck.settle.physics import Index, Physics, Together
from crosscheck.twin.build import Places, build
from crosscheck.twin.cable import Springs, hang
from crosscheck.twin.robot import TrueRobot
from seecr.pose import Array, quat_multiply


class World(Physics):
    """MuJoCo's model and state of a true robot; see :class:`crosscheck.settle.physics.Physics`.

    Coordinates are those of the platform, then those of each cable's exit point, winch and point
    masses.

    Attributes:
        true: the robot.
        places: indices of its parts in the model.
        segments: N of each cable.
        cable_dofs: (m, h) coordinates of each cable's own parts.
        coupling: a few groups, however long the chains are, see :func:`_coupling`.
    """

    def __init__(self, true: TrueRobot, segments: int = 1) -> None:
        self.true, self.segments = true, segments
        model, self.places = build(true, segments)
        places = self.places
        super().__init__(model, places, true.robot.length)
        hubs = np.concatenate([places.exit_dofs, places.slider_dofs], axis=1)
        nodes = places.node_dofs.reshape(true.n_cables, -1)
        self.cable_dofs = np.concatenate([hubs, nodes], axis=1)
        self.coupling = _coupling(places, self.n_dof, segments)
        self.set_load(true.wrench, true.gravity)
        self.free_share = np.ones(true.n_cables)
        self.set_springs(Springs.plain(true.robot.rest_lengths, true))
        self._start_sheaves(true.up)

    def _start_sheaves(self, up: Array) -> None:
        """The frame in which sheaves turn: up, and two horizontal directions."""
        frame = np.linalg.svd(up[None])[2]
        frame[0] = up
        self._ahead, self._side = frame[1], np.cross(up, frame[1])
        upright = np.zeros(4)
        mujoco.mju_mat2Quat(upright, np.stack([self._ahead, self._side, up], axis=1).ravel())
        # followed by half a turn about the sheave's own vertical
        self._swivel = np.stack([upright, quat_multiply(upright, np.array([0.0, 0.0, 0.0, 1.0]))])
        self._turn = np.empty((self.n_cables, 2))

    @property
    def n_cables(self) -> int:
        """Number of cables m (each is N tendons)."""
        return self.true.n_cables

    @property
    def n_lines(self) -> int:
        """Number of cables, and of passive lines after them."""
        return self.n_cables + len(self.true.passive)

    @property
    def n_platform(self) -> int:
        """Number of the platform's own coordinates, which come first."""
        return self.places.n_platform

    @property
    def steers(self) -> bool:
        """Whether something has to be done at every step: turn sheaves, apply a wrench."""
        return bool(self.true.pulley_radius) or super().steers

    def set_springs(self, springs: Springs) -> None:
        """Set rest length, stiffness and weight of all segments.

        The top segment includes what lies on the sheave: the part of the cable that is not free.
        """
        n, model = self.segments, self.model
        free = springs.rest * self.free_share
        part = np.repeat((free / n / springs.rest)[:, None], n, axis=1)
        part[:, 0] += 1.0 - self.free_share
        rest = part * springs.rest[:, None]
        rest[:, 0] += self.places.tail
        at = self.places.tendons
        model.tendon_lengthspring[at, 0] = 0.0
        model.tendon_lengthspring[at, 1] = rest
        model.tendon_stiffness[at] = springs.stiffness[:, None] / part / self.mass_unit
        for k in range(2):
            poly = springs.poly[:, k, None] / part ** (k + 2)
            model.tendon_stiffnesspoly[at, k] = poly / self.mass_unit
        self._rest = springs.rest
        if n > 1:  # half of a segment's weight is at either end
            self._segment_weight = self.true.cable_weight * free / n
            g = float(np.linalg.norm(self.true.gravity))
            mass = self._segment_weight / g / self.mass_unit
            model.body_mass[self.places.node_bodies] = mass[:, None]
            model.body_mass[self.places.end_bodies] = 0.5 * mass
            mujoco.mj_setConst(model, mujoco.MjData(model))

    def carry(self, mass: float, centre: Array, wrench: Array) -> None:
        """Attach a payload to the platform, and apply a known wrench in addition to its own.

        Args:
            mass: [kg]. centre: (3,) [m] in the platform's frame; NaN is its centre of mass.
            wrench: (6,) [N, N m].
        """
        hook, model = self.places.payload, self.model
        model.body_mass[hook] = mass / self.mass_unit
        model.body_ipos[hook] = np.where(np.isnan(centre), self.true.centre_of_mass, centre)
        mujoco.mj_setConst(model, mujoco.MjData(model))
        self.mass = self.true.mass + mass
        self.set_load(self.true.wrench + wrench, self.true.gravity)

    def place(self, pose: Array) -> None:
        """Put the platform at a pose (7,), with cables straight, or hanging if they have weight."""
        super().place(pose)
        if self.segments > 1:
            self._string()
            self.update()

    def _string(self) -> None:
        """Put point masses where a chain hangs between its ends."""
        start, end = self.exit_points(), self.data.site_xpos[self.parts.anchors]
        # straight cables leave exit points, or about sheaves' tangents
        start = start + (1.0 - self.free_share)[:, None] * (end - start)
        up = -self.true.gravity / np.linalg.norm(self.true.gravity)
        free, weight = self._rest * self.free_share, self.true.cable_weight * up
        nodes = hang(start, end, free, self.true.ea, weight, self.segments)
        # a free platform has one more number in qpos than coordinates
        self.data.qpos[self.places.node_dofs + (1 if self.is_free else 0)] = nodes

    def update(self) -> None:
        """Update poses, sheaves and cable lengths to the present qpos."""
        mujoco.mj_kinematics(self.model, self.data)
        if self.true.pulley_radius:
            self._turn_sheaves()
            mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)
        mujoco.mj_tendon(self.model, self.data)

    def _turn_sheaves(self) -> None:
        """Turn each sheave about the vertical until it faces its cable."""
        reach = self.data.site_xpos[self.places.top_next] - self.true.exit_points
        half = 0.5 * np.arctan2(reach @ self._side, reach @ self._ahead)
        np.cos(half, out=self._turn[:, 0])
        np.sin(half, out=self._turn[:, 1])
        np.matmul(self._turn, self._swivel, out=self.data.mocap_quat)

    @contextmanager
    def frozen_slack(self, taut: NDArray[np.bool_]) -> Iterator[None]:
        """Let some tendons (m N,) pull and push, nonlinear laws included, and remove the others."""
        poly = self.model.tendon_stiffnesspoly
        kept = poly.copy()
        poly[~taut] = 0.0
        try:
            with super().frozen_slack(taut):
                yield
        finally:
            poly[:] = kept

    def residual(self) -> Array:
        """Residual generalised force (d,) [N, N m] at the present qpos, without velocity."""
        if self.true.pulley_radius:
            mujoco.mj_kinematics(self.model, self.data)
            self._turn_sheaves()
        return super().residual()

    def push(self) -> None:
        """Apply the wrench, and turn the sheaves for the next step."""
        super().push()
        if self.true.pulley_radius:
            self._turn_sheaves()

    def solve(
        self, stiffness: Array, force: Array, damping: float, neutral: float = 0.0
    ) -> Array | None:
        """As for any robot, but cable by cable, and also along directions that are nearly free."""
        d, own = self.n_platform, self.cable_dofs
        h = own.shape[1]
        try:
            blocks = stiffness[own[:, :, None], own[:, None, :]] + damping * np.eye(h)
            np.linalg.cholesky(blocks)
            right = np.concatenate([stiffness[own, :d], force[own][..., None]], axis=2)
            solved = np.linalg.solve(blocks, right)
            joint = np.einsum("khd,khe->de", stiffness[own, :d], solved)
            schur = stiffness[:d, :d] + damping * np.eye(d) - joint[:, :d]
            np.linalg.cholesky(schur)
        except np.linalg.LinAlgError:
            return None
        step = np.zeros(len(force))
        step[:d] = np.linalg.solve(schur, force[:d] - joint[:, d])
        step[own] = solved[..., d] - solved[..., :d] @ step[:d]
        return step

    def tensions(self) -> Array:
        """Tensions of all tendons [N], passive lines' last, as last updated; 0 where slack."""
        x, poly = self.stretches(), self.model.tendon_stiffnesspoly
        pull = self.model.tendon_stiffness * x + poly[:, 0] * x**2 + poly[:, 1] * x**3
        return np.asarray(self.mass_unit * pull + self.constant)

    def cable_tensions(self) -> Array:
        """Tension of each cable (m,) [N] where it leaves its exit point or sheave."""
        self.update()
        tension = self.tensions()[self.places.tendons[:, 0]]
        if self.segments == 1:
            return tension
        # half a segment's weight acts on the exit point itself
        along = self.data.site_xpos[self.places.top_next] - self._leaves()
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        half = 0.5 * self._segment_weight[:, None] * self.true.gravity
        half /= np.linalg.norm(self.true.gravity)
        return np.asarray(np.linalg.norm(tension[:, None] * along + half, axis=1))

    def _leaves(self) -> Array:
        """Points (m, 3) [m] where cables leave their exit points or sheaves."""
        if not self.true.pulley_radius:
            return self.exit_points()
        points = []
        for i in self.places.tendons[:, 0]:
            last = self.data.ten_wrapadr[i] + self.data.ten_wrapnum[i] - 1
            points.append(self.data.wrap_xpos.reshape(-1, 3)[last - 1])
        return np.array(points)

    @property
    def wraps(self) -> bool:
        """Whether every cable lies on its sheave, as of the last update."""
        if not self.true.pulley_radius:
            return True
        tops = self.places.tendons[:, 0]
        # site, two points on the sheave, site
        return bool(np.all(self.data.ten_wrapnum[tops] == 4))

    def cable_lengths(self) -> Array:
        """Lengths (m,) [m] from the exit points on, as of the last update."""
        return np.asarray(self.data.ten_length[self.places.tendons].sum(axis=1) - self.places.tail)

    def measure_free_share(self) -> Array:
        """Part of each cable (m,) that hangs free of its sheave, in the present state."""
        self.update()
        top = self.data.ten_length[self.places.tendons[:, 0]] - self.places.tail
        ends = self.data.site_xpos[self.places.top_next]
        arc = top - np.linalg.norm(ends - self._leaves(), axis=1)
        return np.asarray(1.0 - arc / self.cable_lengths())


def _coupling(places: Places, n_dof: int, segments: int) -> list[Together]:
    """Groups of coordinates that may be shifted together in finite differences of the forces.

    Cables meet only on the platform and segments only at their ends, so a few groups suffice,
    however long the chains are.
    """
    groups: list[Together] = []
    for k in range(places.n_platform):
        rows = np.arange(n_dof)
        groups.append((np.array([k]), rows, np.full(n_dof, k)))
    hubs = np.concatenate([places.exit_dofs, places.slider_dofs], axis=1)
    blocks = [hubs, *(places.node_dofs[:, j] for j in range(segments - 1))]
    for part in range(4):
        # hubs first, then every third mass: their forces do not overlap
        mine = [0] if part == 0 else list(range(part, segments, 3))
        for axis in range(max((blocks[b].shape[1] for b in mine), default=0)):
            columns: list[Index] = []
            near_rows: list[Index] = []
            for b in mine:
                near = np.concatenate(blocks[max(b - 1, 0) : b + 2], axis=1)
                columns.append(np.repeat(blocks[b][:, axis], near.shape[1]))
                near_rows.append(near.ravel())
            flat = np.concatenate(columns)
            groups.append((np.unique(flat), np.concatenate(near_rows), flat))
    return groups


# Descent of a true robot to its equilibrium: Newton's method on MuJoCo's energy and forces.

_MAX_ITERATIONS = 300
_TOLERANCE = 1e-11
_NUDGE, _NUDGES = 1e-3, 3


@dataclass(frozen=True)
class Descent:
    """How a descent ended; the world is left there.

    Attributes:
        balanced: MuJoCo's forces balance, and no direction leads further down.
        free: some motion changes no force, so that the end point along it is arbitrary.
        residual: residual force relative to the load.
    """

    balanced: bool
    free: bool
    residual: float

    @property
    def at_rest(self) -> bool:
        """Whether it ended in a stable equilibrium."""
        return self.balanced and not self.free


def descend(world: World, judge: bool = True, limit: int = _MAX_ITERATIONS) -> Descent:
    """Go downhill from the world's present state until MuJoCo's forces balance.

    Args:
        world: left where it ends.
        judge: check stability there, and continue if it is unstable.
        limit: most steps.
    """
    total, goal = 0, max(0.01 * _TOLERANCE, world.rounding())
    for nudge in range(1 + _NUDGES):
        size, iterations = minimise(world, goal, limit - total)
        total += iterations
        fine = size <= max(_TOLERANCE, 10.0 * world.rounding())
        if not (fine and judge):
            return Descent(fine, False, size)
        value, softest, neutral = _softest(world)
        if value >= -neutral:
            return Descent(True, value <= neutral, size)
        if nudge < _NUDGES:
            world.move(_NUDGE * world.length * softest / world.metre)
    return Descent(False, False, size)


def _softest(world: World) -> tuple[float, Array, float]:
    """Smallest eigenvalue of the stiffness [N/m], its eigenvector (d,), and what counts as zero.

    A cable whose tension is mere rounding resists on one side at most: without it, the platform may
    be free to move to the other. If it would be unstable without them, such cables are included.
    """
    world.update()
    tensions = world.tensions()
    firm = tensions > 1e-9 * world.force_scale
    neutral = neutral_stiffness(world)
    for taut in (firm, tensions > 0.0):
        matrix = stiffness(world, taut)
        zero = neutral + 1e-9 * float(np.max(np.abs(matrix)))
        if world.solve(matrix, np.zeros(len(matrix)), -zero) is not None:
            return np.inf, np.zeros(len(matrix)), zero
        values, vectors = np.linalg.eigh(matrix)
        if values[0] >= -zero or np.array_equal(firm, tensions > 0.0):
            break
    return float(values[0]), np.asarray(vectors[:, 0]), zero
