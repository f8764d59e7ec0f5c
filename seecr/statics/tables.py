"""From a setup to the tables of the compiled loop."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from seecr.compiled.columns import (
    ANCHOR,
    CENTRE_OF_MASS,
    EXIT,
    EXTRA,
    EXTRA_SLOPE,
    FORCE_OF_WEIGHT,
    FRICTION,
    GAP,
    HYSTERESIS,
    N_COLUMNS,
    N_LOAD,
    OF_THE_PAST,
    PULL,
    PUSHES,
    RADIUS,
    REST,
    UP,
    WEIGHT,
)
from seecr.description.joints import values_of_pose
from seecr.description.robot import Robot
from seecr.effects.setup import QUANTITIES, Setup
from seecr.parallel import in_parts
from seecr.pose import Array, quat_to_matrix


def by_row(
    compiled: Callable[..., None],
    *given: Any,
    threads: int | None = None,
    scratch: Callable[[], Any] | None = None,
) -> None:
    """Call a compiled function with arrays (n, ...), in as many parts as there are threads.

    The first is an array; what is none is the same for all rows. What ``scratch`` makes is the last
    argument, each part's own: threads would write into it at once.
    """

    def run(part: slice) -> None:
        own = () if scratch is None else (scratch(),)
        compiled(*(each[part] if isinstance(each, np.ndarray) else each for each in given), *own)

    in_parts(run, len(given[0]), threads)


# So many rows are solved or evaluated at once by the compiled loop: what it reads and writes takes
# up to 6 kB for each, and is kept for none where there are more.
PORTION = 8192


def portions(rows: NDArray[np.intp]) -> list[NDArray[np.intp]]:
    """Rows in as many portions as their number needs."""
    return [rows[k : k + PORTION] for k in range(0, len(rows), PORTION)]


# So many rows are worth the lanes of seecr.compiled.lanes, and tables made for these. Lanes take as
# long to compile as a million descents one by one. A map and a search for equilibria soon solve
# that many, in batches of this size and more; a first diagnosis of a hundred rows does not.
_MANY = 256
_singly: set[str] = set()


def are_many(n: int) -> bool:
    """Whether n rows are worth lanes, and tables made for these."""
    return n >= _MANY and not _singly


@contextmanager
def one_by_one() -> Iterator[None]:
    """Rows are solved one after the other, however many they are: to compare with."""
    _singly.add("asked for")
    try:
        yield
    finally:
        _singly.clear()


@dataclass(eq=False)
class ByRow:
    """Arrays with a row for each of n poses or searches: all fields of a dataclass."""

    def columns(self) -> dict[str, NDArray[Any]]:
        """All arrays by name."""
        return vars(self)

    def only(self, rows: NDArray[np.integer] | NDArray[np.bool_]) -> Self:
        """Some rows."""
        return replace(self, **{name: each[rows] for name, each in self.columns().items()})

    def and_more(self, other: Self) -> Self:
        """The rows of both."""
        its = other.columns()
        return replace(self, **{k: np.concatenate([v, its[k]]) for k, v in self.columns().items()})

    def put(self, rows: NDArray[np.integer] | NDArray[np.bool_], other: Self) -> None:
        """Overwrite rows with those of another."""
        its = other.columns()
        for name, mine in self.columns().items():
            mine[rows] = its[name]

    def copy(self) -> Self:
        """The same with arrays of its own."""
        return replace(self, **{name: each.copy() for name, each in self.columns().items()})


@dataclass(eq=False)
class Tables:
    """The problem of n poses in the form that the compiled loop reads."""

    cables: Array  # (n, m, N_COLUMNS)
    load: Array  # (n, N_LOAD)
    poses: Array  # (n, 7) commanded
    screws: Array  # (n, d, 7) joints at the commanded pose; (n, 0, 7) for a free platform
    length: float
    scale: Array  # (n,) [N] load that residuals are measured against
    reach: Array  # (n,) [m] a larger deviation counts as a fall
    n_dof: int

    def __len__(self) -> int:
        return len(self.poses)

    def sliding(self) -> Tables:
        """The same tables without hysteresis and friction at the exit points, which hold cables."""
        cables = self.cables.copy()
        cables[..., [HYSTERESIS, FRICTION]] = 0.0
        return replace(self, cables=cables)

    def with_past(self, other: Tables) -> Tables:
        """The same tables with the history columns of others."""
        cables, past = self.cables.copy(), list(OF_THE_PAST)
        cables[..., past] = other.cables[..., past]
        return replace(self, cables=cables)


class Alike(Tables):
    """Tables whose rows differ in their lengths and poses alone, and if at all in their loads.

    A row of ``cables`` takes ten times as much memory as what tells it from the others, and longer
    to write than its equilibrium to find. So the full arrays are made when they are asked for.
    """

    cable: Array
    paid: Array
    one_load: Array

    @classmethod
    def of(cls, cable: Array, paid: Array, load: Array, **rest: Any) -> Alike:
        """``cable`` (1, m, N_COLUMNS); ``paid`` (n, m, 2) rest lengths and gaps; load (1 or n)."""
        out = cls.__new__(cls)
        vars(out).update(cable=cable, paid=paid, one_load=load, **rest)
        return out

    def __getattr__(self, name: str) -> Array:
        if name not in ("cables", "load") or "paid" not in vars(self):
            raise AttributeError(name)
        one = self.cable if name == "cables" else self.one_load
        out = np.broadcast_to(one, (len(self.paid), *one.shape[1:])).copy()
        if name == "cables":
            out[..., REST : GAP + 1] = self.paid
        vars(self)[name] = out
        return out


def told_apart(tables: Tables) -> tuple[Array, Array, Array]:
    """What tells rows apart: cables, rest lengths and gaps (n, m, 2), and loads.

    Cables and loads have one row where all are alike. Full arrays count where they were made, since
    they may have been written to.
    """
    own, cables = vars(tables), shared_cables(tables)
    load = own["load"] if "load" in own else own["one_load"]
    paid = cables[..., REST : GAP + 1].copy() if "cables" in own else own["paid"]
    return cables, paid, load


def shared_cables(tables: Tables) -> Array:
    """Cables (n or 1, m, N_COLUMNS): one row where rows differ in lengths and gaps alone."""
    own = vars(tables)
    return np.asarray(own["cables"] if "cables" in own else own["cable"])


def straightened(tables: Tables) -> Tables:
    """The same tables with cables that neither weigh anything nor run over pulleys."""
    cables, bent = shared_cables(tables), [WEIGHT, RADIUS]
    if not cables[..., bent].any():
        return tables
    out, cables = take(tables, slice(None)), cables.copy()
    cables[..., bent] = 0.0
    vars(out)["cables" if "cables" in vars(out) else "cable"] = cables
    return out


def rest_lengths_of(tables: Tables) -> Array:
    """Rest lengths (n, m) [m] of the cables."""
    own = vars(tables)
    return np.asarray(own["cables"][..., REST] if "cables" in own else own["paid"][..., 0])


def _screws_of(robot: Robot, poses: Array) -> Array:
    if not robot.joints:
        return np.zeros((len(poses), 0, 7))
    if len(poses) > PORTION:  # too many to be kept
        return values_of_pose(robot, poses)[1]
    return _known_screws(robot, poses.tobytes())


@lru_cache(maxsize=8)
def _known_screws(robot: Robot, poses: bytes) -> Array:
    return values_of_pose(robot, np.frombuffer(poses).reshape(-1, 7))[1]


def assemble(setup: Setup, strains: Array | None = None) -> Tables:
    """The tables of a setup; history columns are null, users' laws linearised at strains (n, m)."""
    robot = setup.robot
    poses = np.array(setup.commands.pose, order="C")  # a copy: see seecr.compiled.jit
    n, m = len(poses), robot.n_cables
    if are_many(n) and not setup.laws:
        return _alike(setup, poses)
    cables, load = np.zeros((n, m, N_COLUMNS)), np.zeros((n, N_LOAD))
    _write(setup, QUANTITIES, cables, load, blank=True)
    _write_passive(robot, cables)
    if setup.laws:
        _linearise(setup, np.zeros((n, m)) if strains is None else strains, cables)
    return Tables(
        cables=cables, load=load, poses=poses, screws=_screws_of(robot, poses),
        length=robot.length, scale=_load_scale(setup), reach=_reach(cables), n_dof=robot.n_dof,
    )  # fmt: skip


def _write_passive(robot: Robot, cables: Array) -> None:
    """What lines have that no winch drives, into cables (..., m, columns)."""
    if not robot.all_driven:
        pull = robot.constant_tension_N
        cables[..., PULL], cables[..., PUSHES] = pull, robot.pushes | (pull > 0.0)


def _alike(setup: Setup, poses: Array) -> Alike:
    """The same for many rows: their cables differ in their lengths alone."""
    from seecr.compiled.lanes import pair_lengths  # takes a while to import

    robot, n = setup.robot, len(poses)
    pushed = setup.commands.loads is not None or setup.wrench.any()
    cable = np.zeros((1, robot.n_cables, N_COLUMNS))
    load = np.zeros((n if pushed else 1, N_LOAD))
    names = {name for name, item in QUANTITIES.items() if item.column is not None}
    _write_values(setup, names, cable, load, blank=True)
    _write_passive(robot, cable)
    if pushed:
        _write_values(setup, {"wrench"}, cable, load)
    _write_load(setup, load)
    paid, reach = np.empty((n, robot.n_cables, 2)), np.empty(n)
    spans = np.array(setup.geometric_lengths(setup.commands.pose))
    pair_lengths(np.ascontiguousarray(setup.rest_lengths()), spans, paid, reach)
    return Alike.of(
        cable, paid, load, poses=poses, screws=_screws_of(robot, poses),
        length=robot.length, scale=_load_scale(setup), reach=reach, n_dof=robot.n_dof,
    )  # fmt: skip


def relengthened(tables: Tables, setup: Setup) -> Tables:
    """The tables of a setup, from those of another that differs only in ``extra_length``."""
    cables = tables.cables.copy()
    _write(setup, {"extra_length"}, cables, tables.load)
    return replace(tables, cables=cables, reach=_reach(cables))


def reassembled(tables: Tables, setup: Setup, names: Collection[str]) -> Tables:
    """Tables with some quantities taken from a setup of the same rows; users' laws are left out.

    History columns and the scales of a search stay: the result is for differences at an
    equilibrium.
    """
    cables, load = tables.cables, tables.load.copy()
    if not _OF_CABLES.isdisjoint(names):
        cables = cables.copy()
    _write(setup, names, cables, load)
    return replace(tables, cables=cables, load=load)


# Quantities that also affect other columns: rest lengths and gaps, weight and vertical.
_OF_LENGTHS = {"exit_points", "anchor_points", "pulley_radius"} | {
    name for name, item in QUANTITIES.items() if item.paid_out
}
_OF_CABLES = _OF_LENGTHS | {name for name, item in QUANTITIES.items() if item.column is not None}
_OF_LOAD = {"mass", "centre_of_mass", "gravity", "pulley_radius", "lift"}


def _write(
    setup: Setup, names: Collection[str], cables: Array, load: Array, *, blank: bool = False
) -> None:
    """Write some quantities, and what follows from them, to where the compiled loop reads them.

    In ``blank`` tables zeros are not written, since they are there already.
    """
    _write_values(setup, names, cables, load, blank=blank)
    if not _OF_LENGTHS.isdisjoint(names):
        rest = setup.rest_lengths()
        cables[..., REST] = rest
        cables[..., GAP] = setup.geometric_lengths(setup.commands.pose) - rest
    if not _OF_LOAD.isdisjoint(names):
        _write_load(setup, load)


def _write_values(
    setup: Setup, names: Collection[str], cables: Array, load: Array, *, blank: bool = False
) -> None:
    """Write quantities that go to their columns and entries as they are."""
    for name in names:
        item = QUANTITIES[name]
        value = np.asarray(getattr(setup, name))
        if blank and not value.any():
            continue
        if item.column is not None:
            per_cable = value if item.shape[-1] == 3 else value[..., None]
            cables[..., item.column : item.column + per_cable.shape[-1]] = per_cable
        if item.entry is not None:
            load[:, item.entry : item.entry + value.shape[-1]] = value


def _write_load(setup: Setup, load: Array) -> None:
    """Write weights with their centres and the vertical; one row where all rows have the same."""
    mass, centre = (each[: len(load)] for each in setup.carried())
    load[:, FORCE_OF_WEIGHT : FORCE_OF_WEIGHT + 3] = mass[:, None] * setup.gravity
    load[:, CENTRE_OF_MASS : CENTRE_OF_MASS + 3] = centre
    load[:, UP : UP + 3] = _hanging(setup)


def _linearise(setup: Setup, strains: Array, cables: Array) -> None:
    """Add the tangents of users' laws at the given strains; Newton's method does the rest."""
    step = 1e-6 * (1e-3 + np.abs(strains))
    for law in setup.laws:
        slope = (law(strains + step) - law(strains - step)) / (2.0 * step)
        driven = setup.robot.driven  # a law is that of the winches' ropes
        cables[..., EXTRA] += np.where(driven, law(strains) - slope * strains, 0.0)
        cables[..., EXTRA_SLOPE] += np.where(driven, slope, 0.0)


def _hanging(setup: Setup) -> Array:
    """The vertical of the planes in which cables hang: of the frame with pulleys or lifts."""
    g = np.linalg.norm(setup.gravity)
    if g == 0.0 or np.any(setup.pulley_radius) or np.any(setup.lift):
        return setup.robot.up
    return -setup.gravity / g


def _reach(cables: Array) -> Array:
    """(n,) [m] a larger deviation counts as a fall."""
    rest, gap = cables[..., REST], cables[..., GAP]
    return np.asarray(3.0 * (rest.max(axis=1) + np.abs(gap).max(axis=1)))


def _load_scale(setup: Setup) -> Array:
    """Load [N] of each pose: weight, external force, and moment over the robot's length."""
    weight = setup.weight()
    if not setup.wrench.any() and weight.min(initial=np.inf) > 0.0:
        return weight
    force = np.linalg.norm(setup.wrench[:, :3], axis=1)
    moment = np.linalg.norm(setup.wrench[:, 3:], axis=1) / setup.robot.length
    scale = weight + force + moment
    # an unloaded platform is measured against the force at a strain of 1e-3
    return np.where(scale > 0.0, scale, 1e-3 * float(np.max(setup.ea)))


def take(tables: Tables, rows: NDArray[np.integer] | slice) -> Tables:
    """Some rows of the tables."""
    if isinstance(tables, Alike) and vars(tables).keys().isdisjoint(("cables", "load")):
        load = tables.one_load
        return Alike.of(
            tables.cable, tables.paid[rows], load[rows] if len(load) > 1 else load,
            poses=tables.poses[rows], screws=tables.screws[rows], length=tables.length,
            scale=tables.scale[rows], reach=tables.reach[rows], n_dof=tables.n_dof,
        )  # fmt: skip
    return Tables(
        tables.cables[rows], tables.load[rows], tables.poses[rows], tables.screws[rows],
        tables.length, tables.scale[rows], tables.reach[rows], tables.n_dof,
    )  # fmt: skip


# From exit points to anchor points at the poses of tables, and cables that have no way between.

# A distance below this part of the robot's length is none but for rounding.
_NONE = 1e-12


def ways(tables: Tables) -> Array:
    """(n, m, 3) [m] from exit points to anchor points, base frame."""
    turn = quat_to_matrix(tables.poses[:, 3:])
    anchors = tables.cables[..., ANCHOR : ANCHOR + 3] @ np.swapaxes(turn, 1, 2)
    return np.asarray(tables.poses[:, None, :3] + anchors - tables.cables[..., EXIT : EXIT + 3])


def spanless(tables: Tables) -> NDArray[np.bool_]:
    """(n, m) whether an anchor point is at its exit point, or within its pulley.

    No cable is free there: it has no direction in which it could pull.
    """
    way, radius = ways(tables), tables.cables[..., RADIUS]
    rise = (way * tables.load[:, None, UP : UP + 3]).sum(axis=2)
    far = (way**2).sum(axis=2)
    across = np.sqrt(np.maximum(far - rise**2, 0.0))
    # (across - radius)^2 + rise^2 <= radius^2, without its loss of digits
    return np.asarray(far <= 2.0 * radius * across + (_NONE * tables.length) ** 2)
