"""Paths of least energy between equilibria.

The string method (E, Ren and Vanden-Eijnden, J. Chem. Phys. 126, 164103, 2007): images of the
platform are moved across the path by Newton's steps, then evenly spaced along it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from seecr.equilibrium.coordinates import Coordinates
from seecr.pose import Array
from seecr.statics.solution import Solution
from seecr.statics.tables import take

# Images on the path, most rounds, and the gradient across the path at which they end [load].
_IMAGES, _ROUNDS, _ACROSS = 33, 300, 1e-3
SOFTEST = 1e-2
"""The softest stiffness that a Newton step assumes, over the load and the robot's length."""


def strings(one: Solution, others: Solution, longest: float) -> tuple[Array, NDArray[np.bool_]]:
    """Images (b, k, 7) on the paths of least energy from one equilibrium to b others.

    Args:
        one, others: the equilibria.
        longest: step of an image [of the gap between two].

    Returns:
        the images, with the equilibria at their ends, and (b,) whether they settled.
    """
    by, count = Coordinates(one.robot), len(others)
    ends = by.of(np.concatenate([one.pose, others.pose, one.tables.poses[:1]]))
    first, commanded = ends[:1], ends[-1:]
    whole = by.between(ends[1:-1], np.repeat(first, count, axis=0))
    parts = np.linspace(0.0, 1.0, _IMAGES)[:, None] * whole[:, None]
    every = _moved(by, np.broadcast_to(first, (count, _IMAGES, first.shape[1])), parts)
    settled = np.zeros(count, dtype=bool)
    for _ in range(_ROUNDS):
        left = np.flatnonzero(~settled)
        if len(left) == 0:
            break
        every[left], settled[left] = _round(one, by, every[left], commanded, longest)
    poses = by.poses(every.reshape(-1, every.shape[2]))
    return poses.reshape(count, _IMAGES, 7), settled


def _round(
    one: Solution, by: Coordinates, images: Array, commanded: Array, longest: float
) -> tuple[Array, NDArray[np.bool_]]:
    """Images (b, k, ...) after a step across their paths, and which of these needed none."""
    (b, k), d = images.shape[:2], one.robot.n_dof
    many = take(one.tables, np.zeros(b * k, int))
    softest = SOFTEST * float(many.scale[0]) / one.robot.length
    at = by.evaluated(many, images.reshape(b * k, -1), commanded)
    gradient = at.gradient.reshape(b, k, -1)[:, 1:-1]
    hessian = at.hessian.reshape(b, k, d, d)[:, 1:-1]
    along = _between(by, images[:, 2:], images[:, :-2])
    along /= np.linalg.norm(along, axis=2, keepdims=True)
    across = np.eye(d) - along[..., :, None] * along[..., None, :]
    slope = np.einsum("bnij,bnj->bni", across, gradient)
    settled = np.linalg.norm(slope, axis=2).max(axis=1) < _ACROSS * many.scale[0]
    values, vectors = np.linalg.eigh(across @ hessian @ across)
    parts_of = np.einsum("bnij,bni->bnj", vectors, slope) / np.maximum(np.abs(values), softest)
    step = -np.einsum("bnij,bnj->bni", vectors, parts_of)
    gaps = np.linalg.norm(_between(by, images[:, 1:], images[:, :-1]), axis=2)
    size = np.linalg.norm(step, axis=2, keepdims=True)
    most = longest * gaps.mean(axis=1)[:, None, None]
    step *= np.minimum(1.0, most / np.maximum(size, 1e-300))
    out = images.copy()
    out[:, 1:-1] = _moved(by, images[:, 1:-1], step)
    return np.where(settled[:, None, None], images, _evenly(by, out)), settled


def _evenly(by: Coordinates, images: Array) -> Array:
    """The same paths (b, k, ...) with evenly spaced images."""
    steps = _between(by, images[:, 1:], images[:, :-1])
    along = np.pad(np.cumsum(np.linalg.norm(steps, axis=2), axis=1), ((0, 0), (1, 0)))
    aim = np.linspace(0.0, along[:, -1], images.shape[1], axis=1)[:, 1:-1]
    at = np.sum(along[:, None, :] <= aim[:, :, None], axis=2) - 1
    at = np.clip(at, 0, steps.shape[1] - 1)
    row = np.arange(len(images))[:, None]
    part = (aim - along[row, at]) / np.maximum(along[row, at + 1] - along[row, at], 1e-300)
    out = images.copy()
    out[:, 1:-1] = _moved(by, images[row, at], part[..., None] * steps[row, at])
    return out


def _moved(by: Coordinates, there: Array, steps: Array) -> Array:
    """Coordinates (b, k, ...) after steps (b, k, d)."""
    flat = there.reshape(-1, there.shape[2])
    return by.moved(flat, steps.reshape(len(flat), -1)).reshape(there.shape)


def _between(by: Coordinates, there: Array, before: Array) -> Array:
    """Steps (b, k, d) from coordinates ``before`` to others (b, k, ...)."""
    steps = by.between(there.reshape(-1, there.shape[2]), before.reshape(-1, there.shape[2]))
    return steps.reshape(*there.shape[:2], -1)
