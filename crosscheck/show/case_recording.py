"""The recording of one case of the suite: SEECR and MuJoCo at every pose, and one settling."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from crosscheck.settle.physics import Physics
from crosscheck.settle.settler import Settler, Settling
from crosscheck.show import suite
from crosscheck.suite.results import CaseResult
from crosscheck.suite.verdicts import UNSOLVED, Verdict
from seecr.pose import Array, pose_difference
from seecr.show import colours, layout, plots
from seecr.show.colours import COMMAND, MUJOCO, SEECR, Rgba
from seecr.show.plots import Legend, legend_of
from seecr.show.scene import Scene, States, write_legend
from seecr.show.stream import (
    Recording,
    entity_of,
    opening,
    recording_file,
    settling_index,
    sweep_index,
)
from seecr.statics.solution import Status

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
# Their keys in differences and in what is allowed.
_KEYS = {"position": "position_m", "orientation": "orientation_rad", "tension": "tension_N"}
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
        for track in drawn.tracks:
            _write_track(recording, drawn, track)
        _write_limits_and_words(recording, drawn)
        _style(recording, drawn)


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
class _Track:
    """Both physics over poses, or over the instants of a settling.

    Attributes:
        index: timelines over k poses or instants.
        command: (k, 7).
        seecr: SEECR's answers, NaN at poses that are no equilibria to it.
        mujoco: MuJoCo's, after the polish, or as it settles.
        apart: (k,) how far they are from each other by quantity [m, rad, N].
    """

    index: Sequence[rr.TimeColumn]
    command: Array
    seecr: States
    mujoco: States
    apart: dict[str, Array]

    @property
    def deviations(self) -> dict[str, dict[str, Array]]:
        """Deviations from the command [mm, deg] of both, by name."""
        both = {"seecr": self.seecr, "mujoco": self.mujoco}
        return {who: plots.deviation(one.pose, self.command) for who, one in both.items()}


@dataclass(frozen=True, eq=False)
class _Drawn:
    """A case and what its recording shows.

    Attributes:
        result: the case's. tracks: over its poses, and over a settling if MuJoCo came to rest.
        watched: the pose, counted from 0, whose settling is shown. motion: that settling.
    """

    result: CaseResult
    tracks: list[_Track]
    watched: int | None = None
    motion: Motion | None = None

    @property
    def seen(self) -> Array:
        """Every pose (k, 7) that the 3D view has to contain."""
        over = self.tracks[0]
        return np.concatenate([over.command, over.seecr.pose, over.mujoco.pose])

    @property
    def top(self) -> float:
        """Tension [N] at the end of the colour scale, a round number."""
        return colours.round_up(float(np.nanmax(np.concatenate(self.tensions[:2]), initial=0.0)))

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
        """(k, m) tensions of both physics over each timeline."""
        return [one.tensions for track in self.tracks for one in (track.seecr, track.mujoco)]


def _gathered(result: CaseResult) -> _Drawn:
    """Choose the most interesting settling, and let MuJoCo repeat it."""
    solved, settled, lengths = result.solution, result.settling, result.mujoco_rest_lengths
    known = [status in (Status.CONVERGED, Status.SINGULAR) for status in solved.status]
    pose = np.where(np.array(known)[:, None], solved.pose, np.nan)
    seecr = States(pose, solved.tensions, solved.rest_lengths, solved.slack)
    mujoco = States(settled.pose, settled.tensions, lengths, settled.slack)
    apart = {quantity: getattr(result.difference, key) for quantity, key in _KEYS.items()}
    poses = _Track(sweep_index(result.case.poses), result.case.poses, seecr, mujoco, apart)
    i = _worth_watching(result)
    if i is None:
        return _Drawn(result, [poses])
    motion = record_motion(result.case.settler(), result.case.begins[i], lengths[i])
    k = len(motion.t_s)
    # MuJoCo's platform moves; the command and SEECR's answer stay where they are
    aim = States(*(np.repeat(part[i : i + 1], k, axis=0) for part in vars(seecr).values()))
    same = np.tile(lengths[i], (k, 1))
    moving = States(motion.pose, motion.tensions, same, motion.tensions == 0.0)
    gap = pose_difference(moving.pose, aim.pose)
    worst = np.abs(moving.tensions - aim.tensions).max(axis=1)
    away = (np.linalg.norm(gap[:, :3], axis=1), np.linalg.norm(gap[:, 3:], axis=1), worst)
    settling = _Track(
        [settling_index(motion.t_s)], np.tile(poses.command[i], (k, 1)), aim, moving,
        dict(zip(_KEYS, away, strict=True)),
    )  # fmt: skip
    return _Drawn(result, [poses, settling], i, motion)


def _worth_watching(result: CaseResult) -> int | None:
    """The pose at which MuJoCo moves the platform most, among those that differ if any do."""
    settled = result.settling.settled
    if not settled.any():
        return None
    of = (settled & (result.verdict == kind) for kind in (Verdict.DIFFERS, Verdict.BRANCH))
    settled = next((some for some in of if some.any()), settled)
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
    root = rrb.Horizontal(
        layout.scene_and_lanes(robot, drawn.seen, name, LANES, robot.n_cables + 1),
        rrb.Vertical(*_plot_views(drawn), row_shares=list(drawn.shares.values())),
        rrb.Vertical(layout.text("Read me", READ_ME), layout.text("Now", NOW), row_shares=[3.2, 2]),
        column_shares=[5, 4, 2.6],
    )
    speed = colours.round_up(0.0 if drawn.motion is None else drawn.motion.t_s[-1] / _WATCH_S)
    return layout.blueprint(root, playback_speed=speed, timeline=opening(drawn.tracks[0].index))


def _plot_views(drawn: _Drawn) -> list[rrb.TimeSeriesView]:
    """The plots, top to bottom."""
    # components that are worth a line: those that move at all
    parts = drawn.tracks[0].deviations["seecr"]
    largest = {name: np.nanmax(np.abs(values), initial=0.0) for name, values in parts.items()}
    most = max(largest[n] for n in plots.TRANSLATIONS)
    moved = [n for n in plots.TRANSLATIONS if largest[n] > _UNSEEN * most] or ["dz"]
    turned = [n for n in plots.TURNS if largest[n] > _UNSEEN * max(largest["tilt"], 1e-6)]
    turned = turned if len(turned) == 1 else [*turned, "tilt"]
    views = [_component_view(drawn, DEVIATION, "Deviation from the command [mm]", moved)]
    if TILT in drawn.shares:
        views.append(_component_view(drawn, TILT, "Rotation from the command [°]", turned))
    roots = [f"{TENSION}/{who}" for who in ("seecr", "mujoco")]
    gap = drawn.result.difference
    apart = [list(track.apart.values()) for track in drawn.tracks]
    apart[0] += [getattr(drawn.result.allowance, key) for key in _KEYS.values()]
    apart[0] += [gap.settled_position_m, gap.settled_orientation_rad]
    curves = [plots.log10(np.stack(values, axis=1)) for values in apart]
    titles = [title for title, _colour in _QUANTITIES.values()]
    return [
        *views,
        plots.cables_view(
            "Tension [N]", drawn.tensions, drawn.result.robot.cable_names, drawn.size(TENSION),
            roots,
        ),
        plots.plot(
            "log10 |SEECR - MuJoCo| (crosses: before the polish, lines: limits)",
            [f"{SETTLED}/**", f"{DIFFERENCE}/**", f"{LIMIT}/**"],
            legend_of(curves, titles, drawn.size(DIFFERENCE)),
        ),
    ]  # fmt: skip


def _component_view(drawn: _Drawn, root: str, title: str, names: list[str]) -> rrb.TimeSeriesView:
    """Some components of the deviation; where nothing moves an axis that hides rounding."""
    curves = [
        np.stack([parts[n] for parts in track.deviations.values() for n in names], axis=1)
        for track in drawn.tracks
    ]
    largest = np.nanmax(np.abs(curves[0][:, : len(names)]), initial=0.0)
    legend = (
        Legend(values=(-_STILL, _STILL)) if largest < _NOISE
        else legend_of(curves, names, drawn.size(root))
    )  # fmt: skip
    both = [f"{root}/{who}/{entity_of(name)}" for who in ("seecr", "mujoco") for name in names]
    return plots.plot(title, both, legend)


# --- content ------------------------------------------------------------------------------------


def _draw_scene(recording: Recording, drawn: _Drawn) -> None:
    scene = Scene(recording, drawn.result.robot, drawn.seen, drawn.top)
    scene.surroundings()
    for over in drawn.tracks:
        scene.platform("command", over.index, over.command, COMMAND)
        scene.platform("seecr", over.index, over.seecr.pose, SEECR, solid=True)
        scene.platform("mujoco", over.index, over.mujoco.pose, MUJOCO)
        scene.cables("mujoco", over.index, over.mujoco)
        scene.anchors("mujoco", over.index, over.mujoco.pose, MUJOCO)
    poses = drawn.tracks[0]
    scene.cables("seecr", poses.index, poses.seecr)
    if drawn.result.case.kind == "sweep":
        scene.path("command", poses.command, COMMAND)
        scene.path("seecr", poses.seecr.pose, SEECR)


def _write_track(recording: Recording, drawn: _Drawn, track: _Track) -> None:
    """Deviations from the command, tensions, differences and lanes over a timeline."""
    names = drawn.result.robot.cable_names
    for who, parts in track.deviations.items():
        for name, values in parts.items():
            root = DEVIATION if name in plots.TRANSLATIONS else TILT
            if root in drawn.shares:
                recording.scalars(f"{root}/{who}/{entity_of(name)}", track.index, values)
    for who, states in (("seecr", track.seecr), ("mujoco", track.mujoco)):
        for name, values in zip(names, states.tensions.T, strict=True):
            recording.scalars(f"{TENSION}/{who}/{entity_of(name)}", track.index, values)
    for quantity, values in track.apart.items():
        recording.scalars(f"{DIFFERENCE}/{quantity}", track.index, plots.log10(values))
    slack, differs = track.mujoco.slack, track.mujoco.slack & False
    if track is drawn.tracks[0]:
        # slack for one physics and taut for the other by more than is allowed
        slack, allowed = track.seecr.slack, drawn.result.allowance.tension_N[:, None]
        differs = (slack != track.mujoco.slack) & (
            drawn.result.difference.cable_tension_N > allowed
        )
    both = track.seecr.known & track.mujoco.known
    plots.write_lanes(recording, LANES, track.index, names, plots.lane_states(slack, differs, both))


def _write_limits_and_words(recording: Recording, drawn: _Drawn) -> None:
    """What is allowed, plain settling, verdicts, and the texts."""
    result, poses = drawn.result, drawn.tracks[0]
    for quantity, key in _KEYS.items():
        allowed = plots.log10(getattr(result.allowance, key))
        recording.scalars(f"{LIMIT}/{quantity}", poses.index, allowed)
    for quantity in ("position", "orientation"):
        plain = plots.log10(getattr(result.difference, f"settled_{_KEYS[quantity]}"))
        recording.scalars(f"{SETTLED}/{quantity}", poses.index, plain)
    verdicts = [verdict.name.lower() for verdict in result.verdict]
    plots.lane(recording, VERDICT, poses.index, verdicts)
    guide = suite.guide_text(result, opening(poses.index)[0], drawn.watched)
    recording.text(READ_ME, guide)
    numbers = [suite.pose_numbers_text(result, i, pose) for i, pose in enumerate(poses.seecr.pose)]
    recording.texts(NOW, poses.index, numbers)
    if drawn.motion is not None:
        over = drawn.tracks[1]
        slack = [suite.slack_names(result.robot, which) for which in over.mujoco.slack]
        away = np.stack([over.apart["position"], over.apart["orientation"]], axis=1)
        times, kinetic = drawn.motion.t_s.tolist(), drawn.motion.kinetic_energy.tolist()
        moments = zip(times, kinetic, away, slack, strict=True)
        recording.texts(NOW, over.index, [suite.instant_text(*moment) for moment in moments])


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
