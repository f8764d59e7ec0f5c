"""The recording of one case of the suite: SEECR and MuJoCo at every pose, and one settling."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from crosscheck.settle.physics import Physics
from crosscheck.settle.settler import Settler, Settling
from crosscheck.show import suite
from crosscheck.suite.verdicts import UNSOLVED, Verdict
from seecr.pose import Array, pose_difference
from seecr.show import colours, layout, plots
from seecr.show.colours import COMMAND, MUJOCO, SEECR, Rgba
from seecr.show.plots import Legend, legend_of
from seecr.show.scene import Scene, States, write_legend
from seecr.show.stream import (
    Index,
    Recording,
    entity_of,
    opening,
    recording_file,
    settling_index,
    sweep_index,
)
from seecr.statics.solution import Status

if TYPE_CHECKING:
    from crosscheck.suite.results import CaseResult

READ_ME, NOW = "text/read_me", "text/now"
DEVIATION, TILT, TENSION = "plot/deviation", "plot/tilt", "plot/tension"
DIFFERENCE, SETTLED, LIMIT = "plot/difference", "plot/plain_settling", "plot/limit"
LANES = "lanes"
VERDICT = f"{LANES}/Verdict"

# Frames of a settling, and how long it takes when played [s].
_FRAMES, _WATCH_S = 240, 12.0
# A component of the deviation below this part of the largest one is not plotted.
_UNSEEN = 1e-6
# Smaller motions [mm or degrees] count as zero, and are shown on an axis of the second size.
_NOISE, _STILL = 1e-6, 0.1
_GREEN: Rgba = (24, 92, 60, 255)
_RED: Rgba = (215, 45, 45, 255)
_YELLOW: Rgba = (150, 120, 20, 255)
_PURPLE: Rgba = (110, 50, 120, 255)
_COMPONENTS: dict[str, Rgba] = {
    "dx": colours.SKY, "dy": colours.GREEN, "dz": colours.ORANGE,
    "about x": colours.SKY, "about y": colours.ORANGE, "about z": colours.GREEN,
    "tilt": colours.SILVER,
}  # fmt: skip
_QUANTITIES: dict[str, tuple[str, Rgba]] = {
    "position": ("position [m]", colours.SKY),
    "orientation": ("orientation [rad]", colours.ORANGE),
    "tension": ("tension [N]", colours.GREEN),
}
# Heights of the plots in parts of the column; its size in points of a window of 1920 by 1080.
_PARTS = {DEVIATION: 2.8, TILT: 3.0, TENSION: 3.8, DIFFERENCE: 3.6}
_WIDTH, _HEIGHT = 640.0, 1000.0


def write_case_recording(result: CaseResult, path: str | Path) -> None:
    """Write the recording of a case: scene, plots, lanes, text, layout.

    Raises:
        InputFileError: the file cannot be written.
    """
    drawn = _gathered(result)
    with recording_file(path, result.case.name, _layout(drawn)) as recording:
        _draw_scene(recording, drawn)
        write_legend(recording, drawn.top)
        _write_over_poses(recording, drawn)
        _style(recording, drawn)
        if drawn.motion is not None:
            _write_over_settling(recording, drawn, drawn.motion)


# --- what is drawn ------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Motion:
    """A platform on its way to rest.

    Attributes:
        t_s: (k,) simulated time [s], increasing; the first is 0, at the start pose.
        pose: (k, 7).
        kinetic_energy: (k,) [J].
        tensions: (k, m) [N].
        settling: its result; the motion is stage 1, without the polish.
    """

    t_s: Array
    pose: Array
    kinetic_energy: Array
    tensions: Array
    settling: Settling


@dataclass(frozen=True, eq=False)
class _Drawn:
    """A case and what its recording shows.

    Attributes:
        result: the case's. index: the timelines over its poses.
        seecr: SEECR's answers, NaN at poses that are no equilibria to it.
        mujoco: MuJoCo's, after the polish.
        watched: the pose, counted from 0, whose settling is shown.
        motion: that settling; None if MuJoCo did not come to rest at any pose.
        moving: its platform and cables; none without a motion.
    """

    result: CaseResult
    index: list[rr.TimeColumn]
    seecr: States
    mujoco: States
    watched: int
    motion: Motion | None
    moving: States

    @property
    def command(self) -> Array:
        """Commanded poses (n, 7)."""
        return self.result.case.poses

    @property
    def seen(self) -> Array:
        """Every pose (k, 7) that the 3D view has to contain."""
        return np.concatenate([self.command, self.seecr.pose, self.mujoco.pose])

    @property
    def top(self) -> float:
        """Tension [N] at the end of the colour scale, a round number."""
        tensions = np.concatenate([self.seecr.tensions, self.mujoco.tensions])
        return colours.round_up(float(np.nanmax(tensions, initial=0.0)))

    @property
    def shares(self) -> dict[str, float]:
        """Heights of the plots, in parts; none of rotations where the platform never turns."""
        turns = self.result.robot.turns
        return {root: part for root, part in _PARTS.items() if root != TILT or turns}

    def size(self, root: str) -> tuple[float, float]:
        """Width and height of a plot, in points."""
        shares = self.shares
        return _WIDTH, _HEIGHT * shares[root] / sum(shares.values()) - 55.0

    @property
    def tensions(self) -> list[Array]:
        """(n, m) tensions of both physics over the poses, and those of the settling."""
        return [self.seecr.tensions, self.mujoco.tensions, *([self.moving.tensions] * self.moves)]

    @property
    def moves(self) -> bool:
        """Whether there is a settling to watch."""
        return self.motion is not None

    def from_the_answer(self) -> Array:
        """Distance of MuJoCo from SEECR's answer as it settles (k, 3) [m, rad, N]."""
        gap = pose_difference(self.moving.pose, self.seecr.pose[self.watched])
        worst = np.abs(self.moving.tensions - self.seecr.tensions[self.watched]).max(axis=1)
        turned = np.linalg.norm(gap[:, 3:], axis=1)
        return np.stack([np.linalg.norm(gap[:, :3], axis=1), turned, worst], axis=1)


def _gathered(result: CaseResult) -> _Drawn:
    """Choose the most interesting settling, and let MuJoCo repeat it."""
    solved, settled, lengths = result.solution, result.settling, result.mujoco_rest_lengths
    known = [status in (Status.CONVERGED, Status.SINGULAR) for status in solved.status]
    pose = np.where(np.array(known)[:, None], solved.pose, np.nan)
    seecr = States(pose, solved.tensions, solved.rest_lengths, solved.slack)
    mujoco = States(settled.pose, settled.tensions, lengths, settled.slack)
    index, watched = sweep_index(result.case.poses), _worth_watching(result)
    if watched is None:
        return _Drawn(result, index, seecr, mujoco, 0, None, mujoco)
    settler = result.case.settler()
    motion = record_motion(settler, result.case.begins[watched], lengths[watched])
    same = np.tile(lengths[watched], (len(motion.t_s), 1))
    moving = States(motion.pose, motion.tensions, same, motion.tensions == 0.0)
    return _Drawn(result, index, seecr, mujoco, watched, motion, moving)


def _worth_watching(result: CaseResult) -> int | None:
    """The pose at which MuJoCo moves the platform most, among those that differ if any do."""
    settled = result.settling.settled
    if not settled.any():
        return None
    for verdict in (Verdict.DIFFERS, Verdict.BRANCH):
        if np.any(chosen := settled & (result.verdict == verdict)):
            settled = chosen
            break
    change = pose_difference(result.settling.pose, result.case.begins)
    change[:, 3:] *= result.robot.length
    return int(np.argmax(np.where(settled, np.linalg.norm(change, axis=1), -1.0)))


def record_motion(
    settler: Settler, pose: Array, rest_lengths: Array, *, max_frames: int = _FRAMES
) -> Motion:
    """Settle from a pose (7,) with rest lengths (m,) [m], and keep at most so many frames, evenly
    spread, with the last state.
    """
    frames: list[tuple[float, Array, float, Array]] = []
    clock = 0.0

    def observe(physics: Physics) -> None:
        # After a MuJoCo step, pose, kinetic energy and tensions are still those before it.
        nonlocal clock
        frames.append((clock, physics.pose(), physics.kinetic_energy, physics.tensions()))
        clock += float(physics.model.opt.timestep)

    settling = settler.settle(pose, rest_lengths, observe=observe)
    kept = np.unique(np.linspace(0, len(frames) - 1, max_frames).round().astype(int))
    times, poses, kinetic, tensions = zip(*(frames[i] for i in kept), strict=True)
    return Motion(np.array(times), np.array(poses), np.array(kinetic), np.array(tensions), settling)


# --- layout -------------------------------------------------------------------------------------


def _layout(drawn: _Drawn) -> rrb.Blueprint:
    """Scene, legend and lanes on the left, plots in the middle, text on the right."""
    robot, name = drawn.result.robot, drawn.result.case.name
    left = layout.scene_and_lanes(robot, drawn.seen, name, LANES, robot.n_cables + 1)
    root = rrb.Horizontal(
        left,
        rrb.Vertical(*_plot_views(drawn), row_shares=list(drawn.shares.values())),
        rrb.Vertical(layout.text("Read me", READ_ME), layout.text("Now", NOW), row_shares=[3.2, 2]),
        column_shares=[5, 4, 2.6],
    )
    speed = 0.0 if drawn.motion is None else float(drawn.motion.t_s[-1]) / _WATCH_S
    return layout.blueprint(
        root, playback_speed=colours.round_up(speed), timeline=opening(drawn.index)
    )


def _plot_views(drawn: _Drawn) -> list[rrb.TimeSeriesView]:
    """The plots, top to bottom."""
    moved, turned = _components(drawn)
    views = [_component_view(drawn, DEVIATION, "Deviation from the command [mm]", moved)]
    if TILT in drawn.shares:
        views.append(_component_view(drawn, TILT, "Rotation from the command [°]", turned))
    names = drawn.result.robot.cable_names
    roots = [f"{TENSION}/{who}" for who in ("seecr", "mujoco")]
    titles = [title for title, _colour in _QUANTITIES.values()]
    return [
        *views,
        plots.cables_view("Tension [N]", drawn.tensions, names, drawn.size(TENSION), roots),
        plots.plot(
            "log10 |SEECR - MuJoCo| (crosses: before the polish, lines: limits)",
            [f"{SETTLED}/**", f"{DIFFERENCE}/**", f"{LIMIT}/**"],
            legend_of(_logarithms(drawn), titles, drawn.size(DIFFERENCE)),
        ),
    ]


def _components(drawn: _Drawn) -> tuple[list[str], list[str]]:
    """Components that are worth a line: those that move at all."""
    parts = plots.deviation(drawn.seecr.pose, drawn.command)
    largest = {name: np.nanmax(np.abs(values), initial=0.0) for name, values in parts.items()}
    most = max(largest[n] for n in plots.TRANSLATIONS)
    moved = [n for n in plots.TRANSLATIONS if largest[n] > _UNSEEN * most]
    turned = [n for n in plots.TURNS if largest[n] > _UNSEEN * max(largest["tilt"], 1e-6)]
    return moved or ["dz"], [*turned, "tilt"] if len(turned) != 1 else turned


def _component_view(drawn: _Drawn, root: str, title: str, names: list[str]) -> rrb.TimeSeriesView:
    """Some components of the deviation; where nothing moves an axis that hides rounding."""
    poses = [(drawn.seecr.pose, drawn.command), (drawn.mujoco.pose, drawn.command)]
    ways = [[plots.deviation(*both) for both in poses]]
    if drawn.moves:
        ways.append([plots.deviation(drawn.moving.pose, drawn.command[drawn.watched])])
    curves = [np.stack([part[n] for part in parts for n in names], axis=1) for parts in ways]
    largest = np.nanmax(np.abs(curves[0][:, : len(names)]), initial=0.0)
    legend = (
        Legend(values=(-_STILL, _STILL)) if largest < _NOISE
        else legend_of(curves, names, drawn.size(root))
    )  # fmt: skip
    both = [f"{root}/{who}/{entity_of(name)}" for who in ("seecr", "mujoco") for name in names]
    return plots.plot(title, both, legend)


def _logarithms(drawn: _Drawn) -> list[Array]:
    """Curves of differences and their limits: (n, 8) over the poses, (k, 3) over time."""
    gap, limit = drawn.result.difference, drawn.result.allowance
    out = [
        gap.position_m, gap.orientation_rad, gap.tension_N, gap.settled_position_m,
        gap.settled_orientation_rad, limit.position_m, limit.orientation_rad, limit.tension_N,
    ]  # fmt: skip
    moving = [drawn.from_the_answer()] if drawn.moves else []
    return [plots.log10(values) for values in (np.stack(out, axis=1), *moving)]


# --- content ------------------------------------------------------------------------------------


def _draw_scene(recording: Recording, drawn: _Drawn) -> None:
    scene = Scene(recording, drawn.result.robot, drawn.seen, drawn.top)
    scene.surroundings()
    index, i = drawn.index, drawn.watched
    scene.platform("command", index, drawn.command, COMMAND)
    scene.platform("seecr", index, drawn.seecr.pose, SEECR, solid=True)
    scene.cables("seecr", index, drawn.seecr)
    timelines: list[tuple[Index, States]] = [(index, drawn.mujoco)]
    if drawn.result.case.kind == "sweep":
        scene.path("command", drawn.command, COMMAND)
        scene.path("seecr", drawn.seecr.pose, SEECR)
    if drawn.motion is not None:
        # MuJoCo's platform moves; the command and SEECR's answer stay where they are
        begin = settling_index(np.zeros(1))
        scene.platform("command", begin, drawn.command[i : i + 1], COMMAND)
        scene.platform("seecr", begin, drawn.seecr.pose[i : i + 1], SEECR, solid=True)
        timelines.append((settling_index(drawn.motion.t_s), drawn.moving))
    for over, states in timelines:
        scene.platform("mujoco", over, states.pose, MUJOCO)
        scene.cables("mujoco", over, states)
        scene.anchors("mujoco", over, states.pose, MUJOCO)


def _write_over_poses(recording: Recording, drawn: _Drawn) -> None:
    """Both physics at every pose, their difference and its limits, in numbers and words."""
    result, index = drawn.result, drawn.index
    for who, states in (("seecr", drawn.seecr), ("mujoco", drawn.mujoco)):
        _write_curves(recording, drawn, who, index, states.pose, states.tensions, drawn.command)
    gap, limit = result.difference, result.allowance
    quantities = ("position_m", "orientation_rad", "tension_N")
    for quantity, key in zip(_QUANTITIES, quantities, strict=True):
        difference, allowed = plots.log10(getattr(gap, key)), plots.log10(getattr(limit, key))
        recording.scalars(f"{DIFFERENCE}/{quantity}", index, difference)
        recording.scalars(f"{LIMIT}/{quantity}", index, allowed)
    recording.scalars(f"{SETTLED}/position", index, plots.log10(gap.settled_position_m))
    recording.scalars(f"{SETTLED}/orientation", index, plots.log10(gap.settled_orientation_rad))
    # slack for one physics and taut for the other by more than is allowed
    apart = gap.cable_tension_N > limit.tension_N[:, None]
    differs = np.asarray((drawn.seecr.slack != drawn.mujoco.slack) & apart)
    both = drawn.seecr.known & drawn.mujoco.known
    pulls = plots.lane_states(drawn.seecr.slack, differs, both)
    plots.write_lanes(recording, LANES, index, result.robot.cable_names, pulls)
    plots.lane(recording, VERDICT, index, [verdict.name.lower() for verdict in result.verdict])
    watched = drawn.watched if drawn.moves else None
    recording.text(READ_ME, suite.guide_text(result, opening(index)[0], watched))
    poses = enumerate(drawn.seecr.pose)
    recording.texts(NOW, index, [suite.pose_numbers_text(result, i, pose) for i, pose in poses])


def _write_over_settling(recording: Recording, drawn: _Drawn, motion: Motion) -> None:
    """MuJoCo's motion, and its distance from SEECR's answer."""
    index, moving, i = settling_index(motion.t_s), drawn.moving, drawn.watched
    k, robot = len(motion.t_s), drawn.result.robot
    aim, pull = (np.tile(a[i], (k, 1)) for a in (drawn.seecr.pose, drawn.seecr.tensions))
    _write_curves(recording, drawn, "seecr", index, aim, pull, drawn.command[i])
    _write_curves(recording, drawn, "mujoco", index, moving.pose, moving.tensions, drawn.command[i])
    away = drawn.from_the_answer()
    for quantity, values in zip(_QUANTITIES, away.T, strict=True):
        recording.scalars(f"{DIFFERENCE}/{quantity}", index, plots.log10(values))
    states = plots.lane_states(moving.slack, moving.slack & False, moving.known)
    plots.write_lanes(recording, LANES, index, robot.cable_names, states)
    slack = [suite.slack_names(robot, which) for which in moving.slack]
    moments = zip(motion.t_s.tolist(), motion.kinetic_energy.tolist(), away[:, :2], slack,
                  strict=True)  # fmt: skip
    recording.texts(NOW, index, [suite.instant_text(*moment) for moment in moments])


def _write_curves(
    recording: Recording, drawn: _Drawn, who: str, index: Index, poses: Array, tensions: Array,
    command: Array,
) -> None:  # fmt: skip
    """Deviations from the command and tensions of one physics."""
    for name, values in plots.deviation(poses, command).items():
        root = DEVIATION if name in plots.TRANSLATIONS else TILT
        if root in drawn.shares:
            recording.scalars(f"{root}/{who}/{entity_of(name)}", index, values)
    for name, values in zip(drawn.result.robot.cable_names, tensions.T, strict=True):
        recording.scalars(f"{TENSION}/{who}/{entity_of(name)}", index, values)


def _style(recording: Recording, drawn: _Drawn) -> None:
    """Lines for SEECR and dots for MuJoCo, or two kinds of dots if poses are unrelated."""
    names = drawn.result.robot.cable_names
    said, _legend = plots.merged_curves(drawn.tensions, names, drawn.size(TENSION))
    shades = colours.cable_colours(len(names))
    curves = [(TENSION, name, said.get(k, name), shades[k]) for k, name in enumerate(names)]
    for name, colour in _COMPONENTS.items():
        root = DEVIATION if name in plots.TRANSLATIONS else TILT
        curves += [(root, name, name, colour)] * (root in drawn.shares)
    for root, name, words, colour in curves:
        line, dots = (f"{root}/{who}/{entity_of(name)}" for who in ("seecr", "mujoco"))
        if drawn.result.case.kind == "sweep":
            plots.as_line(recording, line, words, colour, 1.5)
        else:
            plots.as_crosses(recording, line, words, colour, 4.5)
        plots.as_dots(recording, dots, words, colour, 2.5)
    for quantity, (title, colour) in _QUANTITIES.items():
        plots.as_dots(recording, f"{DIFFERENCE}/{quantity}", title, colour, 2.5)
        plots.as_crosses(recording, f"{SETTLED}/{quantity}", title, colour, 3.5)
        # the same name as the dots: the viewer's legend then lists both once
        plots.as_line(recording, f"{LIMIT}/{quantity}", title, colour, 0.8)
    # green for agreement, red where a threshold is exceeded, other colours for findings
    verdicts = {verdict.name.lower(): _YELLOW for verdict in Verdict}
    verdicts |= {"agrees": _GREEN, "differs": _RED}
    verdicts |= {verdict.name.lower(): _PURPLE for verdict in UNSOLVED}
    plots.state_colours(recording, VERDICT, verdicts)
