"""Cables from an MJCF's spatial tendons: which way each runs, its points, and its spring."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from seecr.description.bodies import Platform, actuator_words, is_loose, site_within
from seecr.description.findings import Findings
from seecr.pose import Array

if TYPE_CHECKING:
    import mujoco

    from seecr.description.mjcf_text import MjcfText
    from seecr.description.passive import Kinds

# MuJoCo's mjtWrap and mjtTrn.
_JOINT, _PULLEY, _SITE = 1, 2, 3
_ON_TENDON = 3
# Sites are one point, and a length is that of the reference pose, but for the rounding of decimals.
_SAME = 1e-9


@dataclass(frozen=True)
class TendonCable:
    """One cable: exit and anchor point (3,) [m], E S [N], rest length [m], name, falls and kind.

    The numbers are those of one straight cable that pulls as all ``falls`` of the line together.
    The kind is told as of a :class:`seecr.Robot`.
    """

    exit: Array
    anchor: Array
    ea: float
    rest: float
    name: str
    falls: float
    driven: bool = True
    pushes: bool = False
    constant_tension_N: float = 0.0


@dataclass
class Way:
    """How a tendon runs.

    Attributes:
        spans: (exit site, anchor site, divisor) of each free part.
        guides: length [m] between sites of the world, and between sites of the platform.
        geoms: numbers of geoms that it is wrapped around.
        elsewhere: whether it touches another moving body.
    """

    spans: list[tuple[int, int, float]] = field(default_factory=list)
    guides: list[float] = field(default_factory=lambda: [0.0, 0.0])
    geoms: list[int] = field(default_factory=list)
    elsewhere: bool = False


def tendon_name(model: mujoco.MjModel, i: int) -> str:
    """Its name, or its number as a cable's."""
    return model.tendon(i).name or f"cable{i + 1}"


def way_of(model: mujoco.MjModel, platform: Platform, i: int) -> Way:
    """How tendon i runs, from site to site; a pulley of MuJoCo's begins another branch."""
    way, divisor, before = Way(), 1.0, -1
    first = int(model.tendon_adr[i])
    for k in range(first, first + int(model.tendon_num[i])):
        kind, number = int(model.wrap_type[k]), int(model.wrap_objid[k])
        if kind == _PULLEY:
            divisor, before = float(model.wrap_prm[k]), -1
        elif kind != _SITE:
            way.geoms.append(number)
        else:
            if before >= 0:
                _add(model, platform, way, before, number, divisor)
            before = number
    return way


def _add(
    model: mujoco.MjModel, platform: Platform, way: Way, one: int, other: int, divisor: float
) -> None:
    """Add the part from one site to the next."""
    moves = [bool(platform.whole[model.site_bodyid[site]]) for site in (one, other)]
    # a mocap body is welded to nothing, and has no joints: the world's, where it is written
    still = [
        model.body_jntnum[model.body_weldid[model.site_bodyid[site]]] == 0 for site in (one, other)
    ]
    if not all(a or b for a, b in zip(moves, still, strict=True)):
        way.elsewhere = True
    elif moves[0] != moves[1]:
        way.spans.append((other, one, divisor) if moves[0] else (one, other, divisor))
    else:
        top = platform.body if moves[0] else 0
        apart = site_within(model, one, top) - site_within(model, other, top)
        way.guides[moves[0]] += float(np.linalg.norm(apart)) / divisor


def cables_of(
    model: mujoco.MjModel, platform: Platform, text: MjcfText, kinds: Kinds, found: Findings
) -> list[TendonCable]:
    """The cables, without those that objections are about."""
    out = []
    for i in range(model.ntendon):
        name = tendon_name(model, i)
        if model.wrap_type[model.tendon_adr[i]] == _JOINT:
            _check_fixed(model, platform, i, name, found)
            continue
        way = way_of(model, platform, i)
        if way.elsewhere:
            found.refuse("tendon", name, "holds another moving body; expected one platform alone")
            continue
        straight = _check_way(model, platform, way, name, found)
        spring = spring_of(model, i, name, text, kinds, found)
        if straight and spring is not None:
            cable = _cable(model, platform, way, spring, name)
            out.append(
                replace(
                    cable, driven=bool(kinds.driven[i]), pushes=bool(kinds.pushes[i]),
                    constant_tension_N=cable.falls * float(kinds.constant_tension_N[i]),
                )
            )  # fmt: skip
            _note_falls(out[-1], found)
    _note_actuators(model, found)
    return out


def _check_fixed(
    model: mujoco.MjModel, platform: Platform, i: int, name: str, found: Findings
) -> None:
    """Object to a fixed tendon with a spring, which couples joints; one without does nothing."""
    first, count = int(model.tendon_adr[i]), int(model.tendon_num[i])
    bodies = [int(model.jnt_bodyid[joint]) for joint in model.wrap_objid[first : first + count]]
    if all(is_loose(model, platform, body) for body in bodies):
        return
    if model.tendon_stiffness[i] != 0 or np.any(model.tendon_stiffnesspoly[i]):
        found.refuse(
            "tendon", name, "is a fixed tendon, a spring between joints; expected <spatial> "
            "tendons through sites: leave it out", fixable=True,
        )  # fmt: skip
    else:
        found.note("tendon", name, "is left out: it is a fixed tendon without stiffness")


def _check_way(
    model: mujoco.MjModel, platform: Platform, way: Way, name: str, found: Findings
) -> bool:
    """Whether a tendon runs straight from the world to the platform; objects if it does not."""
    one_way = len(way.spans) == 1 and way.spans[0][2] == 1.0
    if way.geoms:
        moving = [geom for geom in way.geoms if platform.whole[model.geom_bodyid[geom]]]
        names = ", ".join(model.geom(geom).name or f"number {geom}" for geom in way.geoms)
        found.refuse(
            "tendon", name, "is wrapped around a geom ({}); expected a straight cable from its "
            "exit point to its anchor point, and the pulley's radius as effect pulley_radius in a "
            "model, the cable before it as winch_side_length", names,
            fixable=one_way and not moving,
        )  # fmt: skip
        return False
    if not way.spans:
        sides = "the platform" if way.guides[1] > way.guides[0] else "the world"
        found.refuse(
            "tendon", name, f"has all its sites on {sides}; expected one on the world (exit point) "
            "and one on the platform (anchor point), or no such tendon", fixable=True,
        )  # fmt: skip
        return False
    if any(way.guides):
        cure = ": it ends at its first site on the platform"
        if way.guides[0] > 0.0:
            cure = ", and the {} m before the exit point as effect winch_side_length in a model"
        found.refuse(
            "tendon", name, "runs through guide sites; expected exactly two, exit point and anchor "
            f"point{cure}", f"{way.guides[0]:g}", fixable=one_way,
        )  # fmt: skip
        return False
    if not _one_line(model, platform, way):
        found.refuse(
            "tendon", name, "has parts between different points, which one tension pulls in "
            "several directions; expected one exit point and one anchor point, between which a "
            "block and tackle may run to and fro: use the same two sites for all its parts",
        )  # fmt: skip
        return False
    return True


def _one_line(model: mujoco.MjModel, platform: Platform, way: Way) -> bool:
    """Whether all parts are between the same two points, but for rounding."""
    ends = np.array([_points(model, platform, span) for span in way.spans])
    return np.allclose(ends, ends[:1], rtol=_SAME, atol=_SAME)  # infinite ones are refused later


def _points(
    model: mujoco.MjModel, platform: Platform, span: tuple[int, int, float]
) -> tuple[Array, Array]:
    """Exit point in the world's frame, and anchor point in the platform's."""
    return site_within(model, span[0]), site_within(model, span[1], platform.body)


def spring_of(
    model: mujoco.MjModel, i: int, name: str, text: MjcfText, kinds: Kinds, found: Findings
) -> tuple[float, float] | None:
    """Stiffness [N/m] and rest length [m] of a tendon; none and any for a constant tension.

    None if there is an objection.
    """
    stiffness = float(model.tendon_stiffness[i])
    low, high = (float(end) for end in model.tendon_lengthspring[i])
    if kinds.constant_tension_N[i] > 0.0:
        if stiffness != 0.0:
            found.note("tendon", name, "has a spring beside its constant tension: it is left out")
        return 0.0, float(model.tendon_length0[i])
    # MuJoCo 4 has it, 3 has not
    yields = getattr(model, "tendon_springyield", np.zeros(model.ntendon))[i] != 0.0
    if np.any(model.tendon_stiffnesspoly[i]) or yields:
        what = "a springyield" if yields else "a polynomial stiffness"
        found.refuse("tendon", name, f"has {what}; expected one number [N/m], its stiffness")
        return None
    if not stiffness > 0:
        _refuse_no_spring(model, i, name, stiffness, found)
        return None
    if low == 0.0 < high or kinds.pushes[i]:
        return stiffness, high
    written = text.attribute(i, "springlength")
    if low == high > 0.0 and written is None:
        found.note(
            "tendon", name, "has no springlength: its length at the reference pose is taken as its "
            "rest length, as MuJoCo does ({} m), and it is a cable that never pushes", f"{high:g}",
        )  # fmt: skip
        return stiffness, high
    if low == high > 0.0:  # one number is written: two are of a spring that pushes
        found.note(
            "tendon", name, 'has one springlength ({} m), with which it would push as well; read '
            'as "0 l0", a cable that never pushes; a spring that does, which no winch drives, has '
            '"l0 l0"', f"{high:g}",
        )  # fmt: skip
        return stiffness, high
    found.refuse(
        "tendon", name, 'has springlength "{}"; expected two values, "0 l0" with the rest length '
        'l0 [m], so that the cable pulls and never pushes, or "l0 l0" for a spring that pushes '
        "too", f"{low:g} {high:g}",
    )  # fmt: skip
    return None


def _refuse_no_spring(
    model: mujoco.MjModel, i: int, name: str, stiffness: float, found: Findings
) -> None:
    """Object to a tendon without a spring: what it has instead, and what to write."""
    on = model.actuator_trntype == _ON_TENDON
    moved_by = np.flatnonzero(on & (model.actuator_trnid[:, 0] == i))
    if model.tendon_limited[i]:
        length = float(model.tendon_range[i, 1])
        start = f"is a rope that cannot stretch (range up to {length:g} m), without stiffness"
    else:
        length = float(model.tendon_length0[i])
        start = f"has stiffness {stiffness:g}"
        if len(moved_by):
            start += " and an actuator alone, which is not read"
    found.refuse(
        "tendon", name, f'{start}; expected an elastic cable: springlength="0 l0" with its rest '
        'length l0, and a positive stiffness="E S / l0" [N/m], with E S [N] the force that would '
        "double its length; l0 would be {} m", f"{length:g}",
    )  # fmt: skip


def _cable(
    model: mujoco.MjModel, platform: Platform, way: Way, spring: tuple[float, float], name: str
) -> TendonCable:
    """The cable that pulls as the tendon does.

    The length of the tendon is n L, with L between the points and n = sum of 1/divisor (MuJoCo's
    length of a spatial tendon). Its energy k (n L - l0)^2 / 2 is that of a cable with n^2 k and
    l0/n, whose tension is n times the line's (virtual work).
    """
    stiffness, rest = spring
    falls = sum(1.0 / divisor for *_sites, divisor in way.spans)
    exit_point, anchor = _points(model, platform, way.spans[0])
    return TendonCable(exit_point, anchor, falls * stiffness * rest, rest / falls, name, falls)


def _note_falls(cable: TendonCable, found: Findings) -> None:
    """Tell of a line that runs to and fro how it is read."""
    falls = cable.falls
    if falls == 1.0:
        return
    read = f"{falls**2:g} times its stiffness and {1.0 / falls:g} times its rest length"
    pays = f" (the winch pays out {falls:g} times as much)" if cable.driven else ""
    if cable.constant_tension_N > 0.0:
        read = f"{falls:g} times its constant tension"
    found.note(
        "tendon", cable.name, f"runs {falls:g} times between its points: read as one cable of "
        f"{read}; lengths are that cable's{pays}, tensions the line's",
    )  # fmt: skip


def _note_actuators(model: mujoco.MjModel, found: Findings) -> None:
    """That actuators are left out; whether they would pull without control too."""
    if model.nu == 0:
        return
    every = np.arange(model.nu)
    pulls = np.flatnonzero(np.any(model.actuator_biasprm[:, :2] != 0.0, axis=1))
    text = "left out: winches are what commands pay out, from the rest lengths"
    if len(pulls):
        text += f"; {actuator_words(model, pulls)} would pull in MuJoCo even at ctrl 0"
    found.note("", "", f"{actuator_words(model, every)} {text}")
