"""The nearest poses that can be held, against brute force: how often are answers farther?

    python scripts/score_nearest.py --robots ipanema --kinds far --poses 20
    python scripts/score_nearest.py --keep reference.npz      for other versions, too

The reference minimises position^2 + (length x rotation)^2 by SciPy's SLSQP from many poses that are
held, with equations and derivatives of its own, and takes the nearest of its answers at which the
platform is stable. Kinds: far (0.1 to 5 frames outside, level), near (within 2 % of a frame),
turned (over the frame, turned by any angle), both; kept (turned, and only the orientation gives
way: where the reference finds a turn at the wanted position). With --sag the cables have weight:
the reference's are catenaries then, with no less tension than SEECR asks of them.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from copy import copy
from pathlib import Path
from typing import Any, TypedDict

import numpy as np
from brute_cables import Pull, hanging, nearly_straight, straight
from numpy.typing import NDArray
from scipy.optimize import minimize

from seecr.description.mjcf import load_robot, model_path
from seecr.description.robot import Robot
from seecr.effects.cable import CableWeight
from seecr.inverse.correction import correct
from seecr.pose import Array, pose_add, pose_difference, quat_to_matrix
from seecr.tensions.distribution import balanced
from seecr.workspace.margins import feasible


class Limits(TypedDict, total=False):
    """Of tensions [N]."""

    lowest: float
    highest: float


LIMITS: dict[str, Limits] = {
    "demobot_parallel": {},
    "demobot_cogiro": {"lowest": 0.3, "highest": 3.0},
    "cogiro_large": {"highest": 5000.0},
    "ipanema": {"lowest": 50.0, "highest": 3000.0},
}
# [N/m] of the cables: CoGiRo's own, and what others may have; next to nothing on the DemoBot.
WEIGHTS = {
    "demobot_parallel": 0.02,
    "demobot_cogiro": 0.02,
    "cogiro_large": 0.62784,
    "ipanema": 0.05,
}
KINDS = ("far", "near", "turned", "both", "kept")
# Poses tried over the frame, of which this many are gone on with, and from so many SLSQP begins.
_SAMPLE, _NEAR, _SEEDS = 150000, 150, 16
# Turns tried at one position.
_TURNS = 20000
_STEPS, _HALVINGS, _BALANCED, _MISSED = 40, 7, 1e-6, 1e-6


def _frame(robot: Robot) -> float:
    return float(np.ptp(robot.exit_points, axis=0).max())


def _any_turn(random: np.random.Generator, n: int) -> Array:
    turn = random.normal(size=(n, 4))
    return np.asarray(turn / np.linalg.norm(turn, axis=1, keepdims=True))


def wanted_poses(robot: Robot, limits: Limits, kind: str, n: int, seed: int = 1) -> Array:
    """Poses (n, 7) that cannot be held."""
    random, frame = np.random.default_rng(seed), _frame(robot)
    out: list[Array] = []
    box = np.concatenate([robot.exit_points, robot.reference_pose[None, :3]])
    while len(out) < n:
        pose, toward = robot.reference_pose.copy(), random.normal(size=3)
        toward /= np.linalg.norm(toward)
        if kind in ("far", "both"):
            pose[:3] += frame * random.uniform(0.1, 5.0 if kind == "far" else 2.0) * toward
        elif kind == "near":
            way = np.tile(pose, (60, 1))
            way[:, :3] += np.linspace(0.0, 1.5 * frame, 60)[:, None] * toward
            out_there = np.flatnonzero(~feasible(robot, way, **limits))
            if len(out_there) == 0:
                continue
            pose = way[out_there[0]]
            pose[:3] += random.uniform(0.0, 0.02 * frame) * toward
        else:
            pose[:3] = random.uniform(box.min(axis=0), box.max(axis=0))
        if kind in ("turned", "both", "kept"):
            pose[3:] = _any_turn(random, 1)[0]
        if not feasible(robot, pose, **limits)[0]:
            out.append(pose)
    return np.array(out)


def _skew(v: Array) -> Array:
    zero = np.zeros_like(v[..., 0])
    x, y, z = v[..., 0], v[..., 1], v[..., 2]
    rows = [[zero, -z, y], [z, zero, -x], [-y, x, zero]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


class Brute:
    """One wanted pose; x is the way from it [m, length x rotation] and tensions, both scaled."""

    def __init__(
        self,
        robot: Robot,
        limits: Limits,
        wanted: Array,
        kept: bool = False,
        cable_weight: float = 0.0,
    ) -> None:
        m = robot.n_cables
        self.cable_weight, self.hangs = cable_weight, True  # [N/m], whether all are catenaries
        self.ways = [(0.0, 0.0) if kept and k < 3 else (None, None) for k in range(6)]
        self.kept = kept
        self.robot, self.wanted, self.turn = robot, wanted, quat_to_matrix(wanted[3:])
        self.weight, self.unit = robot.mass * robot.gravity, np.repeat([1.0, robot.length], 3)
        self.low = np.full(m, limits.get("lowest", 0.0))
        self.high = np.full(m, limits.get("highest", np.inf))
        most = self.high[0] if np.isfinite(self.high[0]) else 0.0
        self.pull = max(float(np.linalg.norm(self.weight)), 0.2 * most)

    def places(self, away: Array) -> Array:
        return pose_add(np.tile(self.wanted, (len(away), 1)), away / self.unit)

    def balance(self, away: Array, pulls: Array) -> tuple[Array, Array]:
        """What is out of balance (6,) [N] and its derivatives (6, 6 + m)."""
        robot, length = self.robot, self.robot.length
        angle = float(np.linalg.norm(away[3:])) / length
        cross = _skew(away[3:] / length)
        a, b, c = 1.0 - angle**2 / 6.0, 0.5 - angle**2 / 24.0, 1.0 / 6.0 - angle**2 / 120.0
        if angle > 1e-2:
            a, b = np.sin(angle) / angle, (1.0 - np.cos(angle)) / angle**2
            c = (1.0 - a) / angle**2
        turn = (np.eye(3) + a * cross + b * cross @ cross) @ self.turn
        spin = (np.eye(3) + b * cross + c * cross @ cross) / length
        arms, centre = robot.anchor_points @ turn.T, turn @ robot.centre_of_mass
        ways = robot.exit_points - self.wanted[:3] - away[:3] - arms
        one = self.cables(ways, pulls)
        forces, stiff = one.force, one.by_anchor
        lever = _skew(arms)
        left = np.concatenate([
            forces.sum(axis=0) + self.weight,
            (np.cross(arms, forces).sum(axis=0) + np.cross(centre, self.weight)) / length,
        ])  # fmt: skip
        turned = _skew(forces) @ lever - lever @ stiff @ lever
        rates = np.zeros((6, 6 + len(pulls)))
        rates[:3, :3], rates[:3, 3:6] = stiff.sum(axis=0), -(stiff @ lever).sum(axis=0) @ spin
        rates[3:, :3] = (lever @ stiff).sum(axis=0) / length
        bent = turned.sum(axis=0) + _skew(self.weight) @ _skew(centre)
        rates[3:, 3:6] = bent @ spin / length
        rates[:3, 6:] = one.by_tension.T
        rates[3:, 6:] = np.cross(arms, one.by_tension).T / length
        return left, rates

    def cables(self, ways: Array, pulls: Array) -> Pull:
        """Of cables at pulls between the limits; those of hanging ones begin at what they need.

        That is what they weigh as the mean of both ends' tensions.
        """
        weight = self.cable_weight
        if weight == 0.0:
            return straight(self.robot, ways, pulls)
        size, up = np.linalg.norm(ways, axis=1), self.robot.up
        floor = weight * (size + 0.5 * ways @ up)
        least = np.maximum(self.low, floor)
        some, room = np.zeros(len(pulls)), np.ones(len(pulls))
        ends = np.isfinite(self.high)
        some[ends] = ((pulls - self.low) / (self.high - self.low))[ends]
        room[ends] = ((self.high - least) / (self.high - self.low))[ends]
        tensions = least + (pulls - self.low) * room
        found = hanging(self.robot, ways, tensions, weight)
        self.hangs = found is not None
        if found is None:
            found = nearly_straight(self.robot, ways, tensions, weight)
        by = np.where(floor > self.low, -weight * (1.0 - some), 0.0)
        moved = by[:, None] * (ways / size[:, None] + 0.5 * up)
        by_anchor = found.by_anchor + found.by_tension[:, :, None] * moved[:, None]
        return Pull(
            found.force, by_anchor, found.by_tension * room[:, None],
            (found.grip - moved) / room[:, None],
        )  # fmt: skip

    def go(self, start: Array) -> tuple[Array, Array] | None:
        """The local minimum from a start (6,): way and tensions; None where SLSQP gives up.

        Of hanging cables from where straight ones lead to.
        """
        if self.cable_weight == 0.0:
            return self._go(start)
        light = copy(self)
        light.cable_weight = 0.0
        found = light._go(start)
        found = self._go(start) if found is None else self._go(*found)
        return found if found is not None and self._hang(*found) else None

    def _hang(self, away: Array, pulls: Array) -> bool:
        self.balance(away, pulls)
        return self.hangs

    def _go(self, start: Array, pulls: Array | None = None) -> tuple[Array, Array] | None:
        far = max(float(np.linalg.norm(start)), 1e-3 * self.robot.length)
        left, rates = self.balance(start, np.zeros(len(self.low)))
        first = balanced(rates[:, 6:], -left, self.low, self.high)[0] if pulls is None else pulls
        grade = np.concatenate([np.full(6, far), np.full(len(first), self.pull)])
        found = minimize(
            lambda x: (x[:6] @ x[:6], np.concatenate([2.0 * x[:6], np.zeros(len(first))])),
            np.concatenate([start, first]) / grade, jac=True, method="SLSQP",
            bounds=self.ways + [
                (a / self.pull, b / self.pull) for a, b in zip(self.low, self.high, strict=True)
            ],
            constraints={
                "type": "eq",
                "fun": lambda x: self.balance(*np.split(x * grade, [6]))[0] / self.pull,
                "jac": lambda x: self.balance(*np.split(x * grade, [6]))[1] * grade / self.pull,
            },
            options={"maxiter": _STEPS, "ftol": 1e-9},
        )  # fmt: skip
        away, pulls = np.split(found.x * grade, [6])
        pulls = np.clip(pulls, self.low, self.high)
        if not np.isfinite(found.x).all():
            return None
        fine = np.abs(self.balance(away, pulls)[0]).max() <= _BALANCED * self.pull
        return (away, pulls) if fine else None

    def stable(self, away: Array, pulls: Array) -> bool:
        """Whether the stiffness, with each cable's own, has positive eigenvalues only."""
        rates, (arms, ways) = self.balance(away, pulls)[1], self._reach(away)
        grip = self.cables(ways, pulls).grip * (self._taut(pulls))[:, None]
        own = np.concatenate([grip, np.cross(arms, grip) / self.robot.length], axis=1)
        stiffness = -rates[:, 6:] @ own - rates[:, :6] @ self._chart(away)
        return bool(np.linalg.eigvalsh(0.5 * (stiffness + stiffness.T))[0] > 0.0)

    def _taut(self, pulls: Array) -> NDArray[np.bool_]:
        return np.asarray((pulls > 1e-6 * self.pull) | (self.cable_weight > 0.0))

    def _reach(self, away: Array) -> tuple[Array, Array]:
        """Arms (m, 3) and ways (m, 3) from anchor to exit points."""
        pose = self.places(away[None])[0]
        arms = self.robot.anchor_points @ quat_to_matrix(pose[3:]).T
        return arms, self.robot.exit_points - pose[:3] - arms

    def _chart(self, away: Array) -> Array:
        """Ways (6, 6) of small turns on top of the rotation, which rates are not by."""
        there, step = self.places(np.tile(away, (6, 1))), 1e-6
        plus, minus = (
            pose_difference(pose_add(there, moves / self.unit), np.tile(self.wanted, (6, 1)))
            for moves in (step * np.eye(6), -step * np.eye(6))
        )
        return np.asarray(((plus - minus) * self.unit / (2.0 * step)).T)

    def nearest(self, sample: Array, limits: Limits) -> float:
        """[m] the least way of all answers at which the platform stays; infinite for none."""
        sizes = [np.inf]
        for start in self._starts(sample, limits):
            found = self.go(start)
            if found is not None and self.stable(*found):
                sizes.append(float(np.linalg.norm(found[0])))
        return min(sizes)

    def _starts(self, sample: Array, limits: Limits) -> Iterator[Array]:
        random = np.random.default_rng(7)
        if self.kept:  # turns at the wanted position
            sample = np.tile(self.wanted, (_TURNS, 1))
            sample[:, 3:] = _any_turn(random, len(sample))
            sample = sample[feasible(self.robot, sample, **limits)]
            if len(sample) == 0:
                return
        away = pose_difference(sample, np.tile(self.wanted, (len(sample), 1))) * self.unit
        near = np.argsort(np.linalg.norm(away, axis=1))[:_NEAR]
        others = random.choice(len(away), min(_NEAR, len(away)), replace=False)
        away = away[np.concatenate([near, others])]
        inner, outer = np.zeros(len(away)), np.ones(len(away))
        for _ in range(_HALVINGS):
            middle = 0.5 * (inner + outer)
            ok = feasible(self.robot, self.places(away * (1.0 - middle[:, None])), **limits)
            inner, outer = np.where(ok, middle, inner), np.where(ok, outer, middle)
        away *= 1.0 - inner[:, None]
        order = np.argsort(np.linalg.norm(away, axis=1))
        yield np.zeros(6)
        yield from away[order[: _SEEDS // 2]]
        yield from away[random.choice(order, min(_SEEDS // 2, len(order)), replace=False)]


def held_sample(robot: Robot, limits: Limits) -> Array:
    """Poses over the frame that can be held, half of them turned by all angles."""
    random = np.random.default_rng(99)
    box = np.concatenate([robot.exit_points, robot.reference_pose[None, :3]])
    poses = np.tile(robot.reference_pose, (_SAMPLE, 1))
    poses[:, :3] = random.uniform(box.min(axis=0), box.max(axis=0), (_SAMPLE, 3))
    poses[::2, 3:] = _any_turn(random, _SAMPLE // 2)
    tilts = np.zeros((_SAMPLE // 2, 6))
    tilts[:, 3:] = random.normal(scale=0.4, size=(_SAMPLE // 2, 3))
    poses[1::2] = pose_add(poses[1::2], tilts)
    parts = np.array_split(poses, 30)
    return np.concatenate([part[feasible(robot, part, **limits)] for part in parts])


def score(name: str, kind: str, n: int, seed: int, kept: dict[str, Array], sag: float = 0.0) -> str:
    """One line: of how many poses the answer is farther than the reference by 1 %.

    Args:
        sag: weight of the cables, by the plausible one.
    """
    robot, limits, weight = load_robot(model_path(name)), LIMITS[name], sag * WEIGHTS[name]
    key = f"{name}-{kind}-{n}-{seed}" + (f"-{weight:g}" if sag else "")
    want, effects = (
        wanted_poses(robot, limits, kind, n, seed),
        ([CableWeight(weight)] if sag else []),
    )
    correct(robot, want[:1], effects=effects, **limits)
    began = time.process_time()
    kept_position = kind == "kept"
    prefer = "position" if kept_position else "pose"
    found = correct(robot, want, effects=effects, prefer=prefer, **limits)
    spent = 1e3 * (time.process_time() - began) / n
    unit = np.repeat([1.0, robot.length], 3)
    ours = np.linalg.norm(pose_difference(found.aimed, want) * unit, axis=1)
    off = np.abs(pose_difference(found.solution.pose, found.aimed)).max(axis=1)
    stays = found.found & found.solution.converged & (off < _MISSED)
    moved = np.linalg.norm(found.aimed[:, :3] - want[:, :3], axis=1) > _MISSED
    if key not in kept:
        sample = held_sample(robot, limits)
        kept[key] = np.array(
            [
                Brute(robot, limits, one, kept_position, weight).nearest(sample, limits)
                for one in want
            ]
        )
    with np.errstate(invalid="ignore"):
        part = np.where(stays & ~(kept_position & moved), ours / kept[key] - 1.0, np.inf)
    both = stays & np.isfinite(kept[key])
    return (
        f"{name} {kind}: of {n} poses {int(np.sum(part[both] > 0.01))} farther by more than 1 % "
        f"(worst {100 * part[both].max(initial=0.0):.1f} %), {int(np.sum(part[both] < -0.01))} "
        f"nearer; without an answer that stays {int(np.sum(~stays))}, the reference "
        f"{int(np.sum(np.isinf(kept[key])))}; {int(found.settled.sum())} local minima; "
        f"{spent:.0f} ms per pose"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robots", nargs="*", default=list(LIMITS))
    parser.add_argument("--kinds", nargs="*", default=list(KINDS), choices=KINDS)
    parser.add_argument("--poses", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1, help="of the poses")
    parser.add_argument(
        "--sag", type=float, default=0.0, help="weight of the cables, by the plausible one"
    )
    parser.add_argument("--keep", type=Path, help="file of references, read and written")
    given = parser.parse_args()
    # arrays, but savez takes them beside a bool of its own by name
    kept: dict[str, Any] = {}
    if given.keep is not None and given.keep.is_file():
        with np.load(given.keep) as file:
            kept = {key: file[key] for key in file}
    for name in given.robots:
        for kind in given.kinds:
            print(score(name, kind, given.poses, given.seed, kept, given.sag), flush=True)
            if given.keep is not None:
                np.savez(given.keep, **kept)


if __name__ == "__main__":
    main()
