"""An equilibrium in words: pose, cables, stiffness, where else the platform could rest.

And whether a new robot rests at its reference pose.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from seecr.compiled.columns import FORCE_OF_WEIGHT, WEIGHT
from seecr.counted import between, counted, figures, some
from seecr.description.joints import unresisted
from seecr.description.robot import Joint, Robot
from seecr.equilibrium.saddles import NO_BARRIER, TWISTED, Barrier
from seecr.equilibrium.search import elsewhere
from seecr.pose import Array, pose_difference, rotvec_from_quat, rxyz_from_quat
from seecr.prediction.uncertainty import Spread
from seecr.statics.solution import Solution, Status
from seecr.statics.tables import Tables
from seecr.units import joules, millimetres, short, significant, with_error
from seecr.workspace.bars import BarBalance, midline_points

SAGS = (
    "slack: with cable weight that is longer than the straight line; such a cable sags, and may "
    "still pull"
)
"""What "slack" means where cables have weight."""

Bars = Sequence[BarBalance] | None
"""Equilibria of a bar on two cables; None for any other robot."""

# More other equilibria than these are only in the JSON.
_MOST_OTHERS = 3
# A rotation of a command below this [rad] is rounding.
NO_TURN = 1e-9
# A component of a direction below this is not mentioned.
_PART = 0.1
# Part of the weight that is used to show how soft a pose is.
_NUDGE = 0.01
# Cables lighter than this part of the platform hardly change its frequencies: by a third of it, and
# half of that.
_LIGHT = 0.03
# Decimals of millimetres and degrees beyond which a deviation is rounding.
_DECIMALS = 9


def pose_lines(solution: Solution, spread: Spread | None = None) -> Iterator[str]:
    """The equilibrium of the first pose, with standard deviations if the model has a covariance,
    and how far it is from its command.
    """
    yield f"{solution.robot.name}: {solution.sentence(0)}"
    pose, away = solution.pose[0], solution.deviation[0]
    if not np.isfinite(pose).all():
        return
    place, (about, angles) = 1e3 * pose[:3], _turn(solution.robot, pose[3:])
    if spread is None:
        at, turned = three_figures(place, ".3f"), three_figures(angles, ".3f")
    else:
        at = _known(place, 1e3 * spread.position[0])
        # about one axis, the others' errors are zero
        errors = np.degrees(spread.rotation[0])
        turned = _known(angles, errors if len(angles) == 3 else [float(np.linalg.norm(errors))])
    yield f"rests at x y z {at} mm, turned {about} {turned} deg"
    if spread is not None:
        seen, own = spread.seen[0], np.concatenate([spread.position[0], spread.rotation[0]])
        yield f"  {_off(own)}: one standard deviation, from the uncertainty of the model"
        if not np.allclose(seen, own, rtol=0.01):
            yield f"  {_off(seen)} as the calibration's tracker would read it"
    yield "  quaternion " + " ".join(figures(q, ".7f") for q in np.round(pose[3:], 9))
    yield (
        f"off its command by {three_figures(1e3 * away[:3], '+.4f')} mm "
        f"({millimetres(1e-3 * np.round(1e3 * np.linalg.norm(away[:3]), _DECIMALS))}), turned by "
        f"{np.round(np.degrees(np.linalg.norm(away[3:])), _DECIMALS):.4g} deg"
        f" ({three_figures(np.degrees(away[3:]), '+.4f')} deg about x y z)"
    )
    if np.linalg.norm(away[3:]) > TWISTED and not solution.robot.joints:
        yield (
            "hangs twisted, more than a right angle from its command: following the path "
            "there may lead to another equilibrium (seecr sweep --follow)"
        )
    yield from stiffness_lines(solution)
    yield f"forces balance to {solution.balance[0]:.1g} of the load, rounding included"


def _off(values: Array) -> str:
    moved, turned = (
        ", ".join(short(value, 2) for value in part)
        for part in (1e3 * values[:3], np.degrees(values[3:]))
    )
    return f"± {moved} mm, ± {turned} deg about x y z"


def _turn(robot: Robot, quat: Array) -> tuple[str, Array]:
    """What the platform is turned about in words, and by which angles (k,) [deg].

    Of a platform with one hinge it is one angle, where rx ry rz are 180 -12 180 beyond a right one.
    """
    hinges = [joint for joint in robot.joints if joint.kind == "hinge"]
    turn = rotvec_from_quat(quat)
    if len(hinges) == 1 and np.linalg.norm(np.cross(turn, hinges[0].axis)) < NO_TURN:
        # the axis that has that letter may point the other way
        along = np.abs(hinges[0].axis) if _axis_name(hinges[0]) in "xyz" else hinges[0].axis
        return f"about {_axis_name(hinges[0])} by", np.degrees([turn @ along])
    return "rx ry rz", np.degrees(rxyz_from_quat(quat))


def _known(values: Array, errors: Sequence[float] | Array) -> str:
    """Numbers with as many digits as their standard errors justify."""
    return ", ".join(with_error(*pair)[0] for pair in zip(values + 0.0, errors, strict=True))


def cable_lines(solution: Solution, spread: Spread | None = None) -> Iterator[str]:
    """One line per cable: tension with its standard deviation, rest length, whether it is slack."""
    robot = solution.robot
    wide = max(len("cable"), *(len(name) for name in robot.cable_names))
    off = "" if spread is None else "      ± [N]"
    yield f"{'cable':<{wide}}  tension [N]{off}  rest length [m]"
    for k, name in enumerate(robot.cable_names):
        held = robot.constant_tension_N[k] > 0.0
        slack = "  slack" * bool(solution.slack[0, k])
        slack += (
            ""
            if robot.driven[k] and not held
            else "  passive" + (", constant tension" if held else "")
        )
        tension, rest = solution.tensions[0, k] + 0.0, solution.rest_lengths[0, k]
        shown, off = f"{tension:.4f}", ""
        if spread is not None:
            known = solution.slack[0, k]  # zero, and certain to first order
            shown, error = (shown, "") if known else with_error(tension, spread.tensions[0, k])
            off = f"  {error:>9}"
        length = "–" if held else f"{rest:.6f}"
        yield f"{name:<{wide}}  {shown:>11}{off}  {length:>15}{slack}"
    if solution.slack[0].any():
        yield from sag_lines(solution.tables)


def sag_lines(tables: Tables) -> Iterator[str]:
    """What "slack" means where cables have weight."""
    if np.any(tables.cables[..., WEIGHT] > 0.0):
        yield SAGS


def stiffness_lines(solution: Solution) -> Iterator[str]:
    """The softest direction of the first pose, its stiffness, and frequencies of vibrations."""
    soft, direction = solution.smallest_eigenvalue[0], softest_words(solution)
    if solution.status[0] is Status.SINGULAR:
        yield f"free to {direction}"
    elif solution.status[0] is Status.UNSTABLE:
        yield f"leaves this pose: {direction}"
    else:
        stiff = stiffness_words(solution.robot, soft, solution.softest_direction[0])
        yield f"softest direction: {direction}, {stiff}{_nudged(solution)}"
    frequencies, shapes = (part[0] for part in solution.modes)
    known = [significant(value, 4) for value in frequencies if np.isfinite(value)]
    if known:
        first = direction_words(solution.robot, solution.motion(0, shapes[:, 0]))
        yield f"natural frequencies without damping: {', '.join(known)} Hz; lowest mode: {first}"
        yield from _massless_lines(solution)


def _massless_lines(solution: Solution) -> Iterator[str]:
    """That frequencies leave out the inertia of cables, where these are not much lighter."""
    cables = np.sum(solution.tables.cables[0, :, WEIGHT] * solution.rest_lengths[0])
    weight = solution.tables.load[0, FORCE_OF_WEIGHT : FORCE_OF_WEIGHT + 3]
    part = float(cables / max(np.linalg.norm(weight), 1e-300))
    if part > _LIGHT and np.any(weight):
        yield (
            f"  of the platform alone: cables weigh {100.0 * part:.3g} % of what it does, and "
            "lower the frequencies by their inertia"
        )


def _nudged(solution: Solution) -> str:
    """The motion that a hundredth of the weight causes in the softest direction."""
    robot = solution.robot
    soft = solution.smallest_eigenvalue[0]
    if robot.weight == 0.0 or not soft > 0.0:
        return ""
    step = _NUDGE * robot.weight / soft * solution.softest_direction[0]
    moved, turned = float(np.linalg.norm(step[:3])), float(np.linalg.norm(step[3:]))
    whole = np.hypot(moved, turned * robot.length)
    parts = [millimetres(moved, 3)] if moved > _PART * whole else []
    if turned * robot.length > _PART * whole:
        parts.append(f"{np.degrees(turned):.3g} deg")
    return f"; 1 % of the weight moves it by {' and '.join(parts)}"


def on_hinges(robot: Robot) -> bool:
    """Whether every motion of the platform is a turn."""
    return bool(robot.joints) and bool(robot.hinges.all())


def stiffness_words(robot: Robot, value: float, direction: Array) -> str:
    """The stiffness along a motion (6,) [m, rad]: in N m/rad if that is a turn, else in N/m.

    ``value`` is that of the motion with turns times the robot's length [N/m]. The same energy as a
    turn by an angle has the stiffness value / angle^2, with the angle of the unit motion. On hinges
    alone every motion is a turn, also where the platform's origin moves along.
    """
    moved, turned = float(np.linalg.norm(direction[:3])), float(np.linalg.norm(direction[3:]))
    if turned > 0.0 and (on_hinges(robot) or moved <= _PART * turned * robot.length):
        return f"{significant(value / turned**2, 4)} N m/rad"
    return f"{significant(value, 4)} N/m"


def softest_words(solution: Solution) -> str:
    """The softest direction of the first pose, such as "turn about y"."""
    return direction_words(solution.robot, solution.softest_direction[0])


def direction_words(robot: Robot, direction: Array) -> str:
    """A motion of the platform (6,) [m, rad] in words, such as "turn about y".

    Where that is along the axis of a joint that is none of the base frame's, by the joint's name.
    """
    scaled = direction * np.repeat([1.0, robot.length], 3)
    scaled = scaled / np.linalg.norm(scaled)
    if not np.isfinite(scaled).all():
        return "no direction"
    words = []
    parts = [("move along", "slide", scaled[:3]), ("turn about", "hinge", scaled[3:])]
    if on_hinges(robot):
        parts = [("turn about", "hinge", scaled[3:] / np.linalg.norm(scaled[3:]))]
    for verb, kind, part in parts:
        size = float(np.linalg.norm(part))
        if size > _PART:
            joints = [joint for joint in robot.joints if joint.kind == kind]
            words.append(f"{verb} {_axis_words(part / size, joints)}")
    return ", ".join(words)


def _axis_words(axis: Array, joints: Sequence[Joint]) -> str:
    """The letters of a unit vector, or the joint whose oblique axis it is, which may be named x."""
    letters = [a for a, v in zip("xyz", axis, strict=True) if abs(v) > 2 * _PART]
    if len(letters) > 1:
        for joint in joints:
            if np.linalg.norm(np.cross(joint.axis, axis)) < _PART:
                return f"joint {joint.name}"
    return " and ".join(letters)


def _axis_name(joint: Joint) -> str:
    """The letter of a joint's axis in the base frame, or else its name."""
    along = np.flatnonzero(np.abs(joint.axis) > 1.0 - 1e-9)
    return "xyz"[along[0]] if len(along) else joint.name


def midline_lines(solution: Solution) -> Iterator[str]:
    """Where the midlines of two pairs of parallel cables in a plane meet, the paper's V or H."""
    met = midline_points(solution)
    if met is None or not np.isfinite(met.points[0]).all():
        return
    place = " ".join(f"{1e3 * met.points[0]['xyz'.index(axis)]:.2f}" for axis in met.axes)
    name = f" (the paper's {met.name})" if met.name else ""
    beside = round(1e3 * float(met.beside[0]), 6) + 0.0
    yield (
        f"midlines of both pairs of cables meet at {' and '.join(met.axes)} {place} mm{name}, "
        f"{beside:+.2f} mm beside the line of the weight"
    )


def bar_lines(at_rest: Bars, at_command: Bars) -> Iterator[str]:
    """All equilibria of a bar on two cables, with its middle at rest, and at its command."""
    for where, tilts in (("there", at_rest), ("where it was commanded to", at_command)):
        if tilts is None:
            continue
        yield (
            f"a bar with its middle {where}, on cables that do not stretch, is in balance at "
            f"{counted(len(tilts), 'tilt')} (positive: the second cable's end is up):"
        )
        for one in tilts:
            yield from (f"  {line}" for line in one.lines())


def other_lines(
    solution: Solution, others: Solution | None, passes: Sequence[Barrier] = ()
) -> Iterator[str]:
    """Where else the platform could rest at the first command, the difference in energy, and the
    barriers on the way, if they were computed.
    """
    if others is None or np.isnan(solution.tensions[0]).any():
        return  # there is none to be another of
    away = elsewhere(solution, others)
    # why some have no barrier takes long to say, and mostly is the same for all
    whys = dict.fromkeys(one.why_not for one in passes if one.why_not)
    if len(away) == 0:
        yield "no other stable equilibrium was found"
    gaps = pose_difference(others.pose[away], solution.pose[0])
    # twisted ones, which nothing leads to, come last
    order = np.argsort(np.linalg.norm(gaps[:, 3:], axis=1) > TWISTED, kind="stable")
    for n in order[:_MOST_OTHERS]:
        k, gap = away[n], gaps[n]
        about, angles = _turn(solution.robot, others.pose[k, 3:])
        slack = [c for c, s in zip(solution.robot.cable_names, others.slack[k], strict=True) if s]
        more = others.energy[k] - solution.energy[0]
        energy = f"{joules(more, '+.4g')}, " if np.isfinite(more) else ""
        line = (
            f"could also rest {millimetres(np.linalg.norm(gap[:3]))} and "
            f"{np.degrees(np.linalg.norm(gap[3:])):.4g} deg away: at "
            f"{three_figures(np.round(1e3 * others.pose[k, :3], 1), '.7g')} mm, turned {about} "
            f"{three_figures(angles, '.4g')} deg, "
            f"{energy}slack: "
            f"{' '.join(slack) or 'none'}"
        )
        if passes:
            line += f"; {passes[n].kind if passes[n].why_not else passes[n].words}"
        yield line
    if len(away) > _MOST_OTHERS:
        yield f"and at {len(away) - _MOST_OTHERS} more places, all of them with --json"
    yield from (f"{NO_BARRIER}: {why}" for why in whys)


def unsought_lines(effects: Sequence[str]) -> Iterator[str]:
    """That effects of these names, if any, lead to one rest along their way."""
    if effects:
        yield (
            f"other equilibria are not sought: with {', '.join(effects)}, what the cables did "
            "before decides where the platform rests"
        )


def three_figures(values: Array, form: str) -> str:
    """Coordinates in one format, with commas between."""
    return ", ".join(figures(value, form) for value in np.round(values, 6))


def at_rest(solution: Solution) -> bool:
    """Whether every pose is at rest in a stable equilibrium."""
    return bool(solution.converged.all())


# --- a new robot ----------------------------------------------------------------------------------


def home_lines(solution: Solution) -> Iterator[str]:
    """Whether the robot rests at its reference pose, and if not, why not."""
    yield f"sent to its reference pose: {solution.sentence(0)}"
    robot = solution.robot
    if at_rest(solution):
        away = solution.deviation[0]
        taut = robot.n_cables - int(solution.slack[0].sum())
        yield (
            f"  it comes to rest {millimetres(np.linalg.norm(away[:3]), 3)} and "
            f"{short(float(np.degrees(np.linalg.norm(away[3:]))))} deg off, {taut} of "
            f"{counted(robot.n_cables, 'cable')} taut, tensions "
            f"{between(solution.tensions[0].min(), solution.tensions[0].max())} N; softest: "
            f"{softest_words(solution)}, {significant(solution.smallest_eigenvalue[0], 3)} N/m"
        )
        return
    yield f"  {reason(solution)}"


def open_lines(solution: Solution, held: bool, limits: tuple[float, float]) -> Iterator[str]:
    """What a rest at the reference pose leaves open: slack cables, and tensions beyond limits.

    Args:
        held: whether tensions within ``limits`` [N] of all cables balance the load there.
    """
    if not at_rest(solution):
        return
    robot, (lowest, highest) = solution.robot, limits
    within = f"of {lowest:g} N or more"
    if np.isfinite(highest):
        within = f"from {lowest:g} to {highest:g} N"
    slack = solution.slack[0] & robot.driven
    names = [name for name, hangs in zip(robot.cable_names, slack, strict=True) if hangs]
    if not held:
        yield (
            f"  no tensions {within} in all cables balance the load there: seecr map counts such "
            "a pose as one that cannot be held; expected crossed cables, more of them, or another "
            "reference pose (--at)"
        )
    elif names:
        verb = "hangs" if len(names) == 1 else "hang"
        yield (
            f"  {some(names)} {verb} slack there; tensions {within} could hold the platform with "
            "all cables taut: --pretension 10 shortens them so"
        )
    over = [
        f"{name} {significant(tension, 3)} N"
        for name, tension in zip(robot.cable_names, solution.tensions[0], strict=True)
        if tension > highest
    ]
    if over:
        yield f"  beyond {highest:g} N there: {some(over)}"


def reason(solution: Solution) -> str:
    """Why a robot does not rest where it was sent: directions in which no cable resists."""
    robot, pose = solution.robot, solution.pose[0]

    def motions(some: Array) -> str:
        return "; ".join(direction_words(robot, one) for one in some)

    if not np.isfinite(pose).all():
        pose = solution.command[0]
    free = unresisted(robot, pose, np.ones(robot.n_cables, dtype=bool))
    if len(free):
        return (
            f"no cable, taut or slack, resists {counted(len(free), 'motion')}: "
            f"{motions(free)}; expected more cables, or anchor points elsewhere"
        )
    slack = solution.slack[0]
    if slack.all():
        return (
            "no cable pulls there, since nothing loads them: tighten them with --pretension 10, "
            "which shortens them to 10 N or more"
        )
    loose = unresisted(robot, pose, ~slack) if slack.any() else free
    if len(loose):
        names = [name for name, hangs in zip(robot.cable_names, slack, strict=True) if hangs]
        return (
            f"with {some(names)} slack nothing but the weight resists: "
            f"{motions(loose)}; another pose (--at) may hold it"
        )
    if np.isfinite(solution.softest_direction[0]).all():
        return f"it gives way there: {softest_words(solution)}; another pose (--at) may hold it"
    return "no pose was found where its cables carry it; another reference pose (--at) may do"
