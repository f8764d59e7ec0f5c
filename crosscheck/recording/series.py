"""Plots and lanes of a case, over its poses and over the time of one settling."""

from __future__ import annotations

import numpy as np
import rerun.blueprint as rrb
from numpy.typing import NDArray

from crosscheck.recording.material import Material
from crosscheck.suite.verdicts import UNSOLVED, Verdict
from seecr.curves import alike, joined
from seecr.pose import Array, pose_difference
from seecr.recording import colours, layout, plots
from seecr.recording.colours import Rgba
from seecr.recording.legends import Legend, legend_of
from seecr.recording.stream import Index, Recording, entity_of

DEVIATION, TILT, TENSION = "plot/deviation", "plot/tilt", "plot/tension"
DIFFERENCE, SETTLED, LIMIT = "plot/difference", "plot/plain_settling", "plot/limit"
LANES = "lanes"
VERDICT = f"{LANES}/Verdict"
# A component of the deviation below this part of the largest one is not plotted.
_UNSEEN = 1e-6
# Smaller motions [mm or degrees] count as zero, and are shown on an axis of the second size.
_NOISE, _STILL = 1e-6, 0.1
_GREEN: Rgba = (24, 92, 60, 255)
_RED: Rgba = (215, 45, 45, 255)
_YELLOW: Rgba = (150, 120, 20, 255)
_PURPLE: Rgba = (110, 50, 120, 255)
_COMPONENTS: dict[str, Rgba] = {
    "dx": colours.SKY,
    "dy": colours.GREEN,
    "dz": colours.ORANGE,
    "about x": colours.SKY,
    "about y": colours.ORANGE,
    "about z": colours.GREEN,
    "tilt": colours.SILVER,
}
_QUANTITIES: dict[str, tuple[str, Rgba]] = {
    "position": ("position [m]", colours.SKY),
    "orientation": ("orientation [rad]", colours.ORANGE),
    "tension": ("tension [N]", colours.GREEN),
}
_QUANTITY_NAMES = [name for name, _colour in _QUANTITIES.values()]
# Heights of the plots in parts of the column; its size in points of a window of 1920 by 1080.
_PARTS = {DEVIATION: 2.8, TILT: 3.0, TENSION: 3.8, DIFFERENCE: 3.6}
_WIDTH, _HEIGHT = 640.0, 1000.0


class Series:
    """Logs a case's numbers; what is compared is in double precision."""

    def __init__(self, recording: Recording, material: Material) -> None:
        self.recording, self.material = recording, material

    @staticmethod
    def views(material: Material) -> list[rrb.TimeSeriesView]:
        """The plots, top to bottom; none of rotations where the platform never turns."""
        moved, turned = _components(material)
        titles = {
            DEVIATION: ("Deviation from the command [mm]", moved),
            TILT: ("Rotation from the command [°]", turned),
        }
        return [
            *(
                layout.plot(
                    title, _both(root, names),
                    _components_legend(material, names, _size(material, root)),
                )
                for root, (title, names) in titles.items()
                if root in _shares(material)
            ),
            _tension_view(material),
            layout.plot(
                "log10 |SEECR - MuJoCo| (crosses: before the polish, lines: limits)",
                [f"{SETTLED}/**", f"{DIFFERENCE}/**", f"{LIMIT}/**"],
                legend_of(_logarithms(material), _QUANTITY_NAMES, _size(material, DIFFERENCE)),
            ),
        ]  # fmt: skip

    @staticmethod
    def shares(material: Material) -> list[float]:
        """Heights of the plots, in parts."""
        return list(_shares(material).values())

    def over_poses(self, index: Index) -> None:
        """Both physics at every pose, their difference and its limits."""
        material = self.material
        for who, states in (("seecr", material.seecr), ("mujoco", material.mujoco)):
            self._deviation(who, index, states.pose, material.command)
            self._tension(who, index, states.tensions)
        self._differences(index)
        both = material.seecr.known & material.mujoco.known
        self._lanes(index, plots.lane_states(material.seecr.slack, material.slack_differs, both))
        verdicts = [verdict.name.lower() for verdict in material.result.verdict]
        plots.lane(self.recording, VERDICT, index, verdicts)
        _verdict_style(self.recording)
        self._style()

    def over_settling(self, index: Index) -> None:
        """MuJoCo's motion, and its distance from SEECR's answer."""
        material, i = self.material, self.material.watched
        assert material.motion is not None
        moving, k = material.settling, len(material.motion.t_s)
        target = np.tile(material.seecr.pose[i], (k, 1))
        self._deviation("seecr", index, target, material.command[i])
        self._deviation("mujoco", index, moving.pose, material.command[i])
        aim = np.tile(material.seecr.tensions[i], (k, 1))
        self._tension("seecr", index, aim)
        self._tension("mujoco", index, moving.tensions)
        for quantity, values in zip(_QUANTITIES, _from_the_answer(material), strict=True):
            self._log(DIFFERENCE, quantity, index, values)
        self._lanes(index, plots.lane_states(moving.slack, moving.slack & False, moving.known))

    def _deviation(self, who: str, index: Index, poses: Array, command: Array) -> None:
        for name, values in plots.deviation(poses, command).items():
            root = DEVIATION if name in plots.TRANSLATIONS else TILT
            if root in _shares(self.material):
                self.recording.scalars(f"{root}/{who}/{entity_of(name)}", index, values)

    def _tension(self, who: str, index: Index, tensions: Array) -> None:
        for name, values in zip(self.material.robot.cable_names, tensions.T, strict=True):
            self.recording.scalars(f"{TENSION}/{who}/{entity_of(name)}", index, values)

    def _differences(self, index: Index) -> None:
        gap, limit = self.material.gap, self.material.result.allowance
        pairs = {
            "position": (gap.position_m, limit.position_m),
            "orientation": (gap.orientation_rad, limit.orientation_rad),
            "tension": (gap.tension_N, limit.tension_N),
        }
        for quantity, (values, allowed) in pairs.items():
            self._log(DIFFERENCE, quantity, index, values)
            self.recording.scalars(f"{LIMIT}/{quantity}", index, plots.log10(allowed))

        self._log(SETTLED, "position", index, gap.settled_position_m)
        self._log(SETTLED, "orientation", index, gap.settled_orientation_rad)

    def _lanes(self, index: Index, states: NDArray[np.object_]) -> None:
        for name, column in zip(self.material.robot.cable_names, states.T, strict=True):
            plots.lane(self.recording, f"{LANES}/{entity_of(name)}", index, list(column))

    def _log(self, root: str, quantity: str, index: Index, values: Array) -> None:
        self.recording.scalars(f"{root}/{quantity}", index, plots.log10(values))

    def _style(self) -> None:
        """Lines for SEECR and dots for MuJoCo, or two kinds of dots if poses are unrelated."""
        for name, colour in _COMPONENTS.items():
            root = DEVIATION if name in plots.TRANSLATIONS else TILT
            if root in _shares(self.material):
                self._pair(root, entity_of(name), name, colour)
        names = self.material.robot.cable_names
        shades = colours.cable_colours(self.material.robot.n_cables)
        said = {group[0]: joined([names[k] for k in group]) for group in _drawn(self.material)}
        for k, (name, colour) in enumerate(zip(names, shades, strict=True)):
            self._pair(TENSION, entity_of(name), said.get(k, name), colour)
            plots.lane_style(self.recording, f"{LANES}/{entity_of(name)}", colour)
        for quantity, (name, colour) in _QUANTITIES.items():
            plots.as_dots(self.recording, f"{DIFFERENCE}/{quantity}", name, colour, 2.5)
            plots.as_crosses(self.recording, f"{SETTLED}/{quantity}", name, colour, 3.5)
            # the same name as the dots: the viewer's legend then lists both once
            plots.as_line(self.recording, f"{LIMIT}/{quantity}", name, colour, 0.8)

    def _pair(self, root: str, entity: str, name: str, colour: Rgba) -> None:
        line, dots = f"{root}/seecr/{entity}", f"{root}/mujoco/{entity}"
        if self.material.is_sweep:
            plots.as_line(self.recording, line, name, colour, 1.5)
        else:
            plots.as_crosses(self.recording, line, name, colour, 4.5)
        plots.as_dots(self.recording, dots, name, colour, 2.5)


def _verdict_style(recording: Recording) -> None:
    """Green for agreement, red where a threshold is exceeded, other colours for findings."""
    shades = {verdict.name.lower(): _YELLOW for verdict in Verdict}
    shades |= {"agrees": _GREEN, "differs": _RED}
    shades |= {verdict.name.lower(): _PURPLE for verdict in UNSOLVED}
    plots.state_colours(recording, VERDICT, shades)


def _shares(material: Material) -> dict[str, float]:
    """Heights of the plots, in parts, by what they plot."""
    return {root: p for root, p in _PARTS.items() if root != TILT or material.robot.turns}


def _size(material: Material, root: str) -> tuple[float, float]:
    """Width and height of a plot, in points."""
    shares = _shares(material)
    return _WIDTH, _HEIGHT * shares[root] / sum(shares.values()) - 55.0


def _components(material: Material) -> tuple[list[str], list[str]]:
    """Components that are worth a line: those that move at all."""
    parts = plots.deviation(material.seecr.pose, material.command)
    largest = {name: np.nanmax(np.abs(values), initial=0.0) for name, values in parts.items()}
    most = max(largest[n] for n in plots.TRANSLATIONS)
    moved = [n for n in plots.TRANSLATIONS if largest[n] > _UNSEEN * most]
    turned = [n for n in plots.TURNS if largest[n] > _UNSEEN * max(largest["tilt"], 1e-6)]
    return moved or ["dz"], [*turned, "tilt"] if len(turned) != 1 else turned


def _largest(material: Material, names: list[str]) -> float:
    """The largest value of some components of the deviation [mm or degrees]."""
    parts = plots.deviation(material.seecr.pose, material.command)
    return max(float(np.nanmax(np.abs(parts[name]), initial=0.0)) for name in names)


def _components_legend(material: Material, names: list[str], size: tuple[float, float]) -> Legend:
    """The legend's place for some components of the deviation, over poses and the settling."""
    still = _still(_largest(material, names))
    if still is not None:
        return Legend(values=still)
    ways = [(material.seecr.pose, material.command), (material.mujoco.pose, material.command)]
    over_poses = [plots.deviation(poses, command) for poses, command in ways]
    curves = [np.stack([part[name] for part in over_poses for name in names], axis=1)]
    if material.motion is not None:
        moving = plots.deviation(material.settling.pose, material.command[material.watched])
        curves.append(np.stack([moving[name] for name in names], axis=1))
    return legend_of(curves, names, size)


def _tensions(material: Material) -> list[Array]:
    """(n, m) tensions of both physics over the poses, and those of the settling."""
    moving = [] if material.motion is None else [material.settling.tensions]
    return [material.seecr.tensions, material.mujoco.tensions, *moving]


def _tension_legend(material: Material, groups: list[list[int]]) -> Legend:
    names = material.robot.cable_names
    said = [joined([names[k] for k in group]) for group in groups]
    return legend_of(_tensions(material), said, _size(material, TENSION))


def _drawn(material: Material) -> list[list[int]]:
    """Cables whose tensions coincide, of which the first is drawn, if a legend fits."""
    groups = alike(_tensions(material))
    if _tension_legend(material, groups).fits:
        return groups
    return [[k] for k in range(material.robot.n_cables)]


def _tension_view(material: Material) -> rrb.TimeSeriesView:
    """Tensions, with a legend if there is room for one; lanes have the same colours."""
    groups = _drawn(material)
    legend = _tension_legend(material, groups)
    title = "Tension [N]" + ("" if legend.fits else ", cables in the colours of their lanes")
    first = [material.robot.cable_names[group[0]] for group in groups]
    return layout.plot(title, _both(TENSION, first), legend, listed=legend.fits)


def _logarithms(material: Material) -> list[Array]:
    """Curves of differences and their limits: (n, 8) over the poses, (k, 3) over time."""
    gap, limit = material.gap, material.result.allowance
    out = [
        gap.position_m, gap.orientation_rad, gap.tension_N, gap.settled_position_m,
        gap.settled_orientation_rad, limit.position_m, limit.orientation_rad, limit.tension_N,
    ]  # fmt: skip
    moving = [] if material.motion is None else [np.stack(_from_the_answer(material), axis=1)]
    return [plots.log10(values) for values in (np.stack(out, axis=1), *moving)]


def _from_the_answer(material: Material) -> tuple[Array, Array, Array]:
    """Distance of MuJoCo from SEECR's answer as it settles: (k,) [m], [rad], [N]."""
    moving, i = material.settling, material.watched
    gap = pose_difference(moving.pose, np.tile(material.seecr.pose[i], (len(moving.pose), 1)))
    worst = np.abs(moving.tensions - material.seecr.tensions[i]).max(axis=1)
    return np.linalg.norm(gap[:, :3], axis=1), np.linalg.norm(gap[:, 3:], axis=1), worst


def _still(largest: float) -> tuple[float, float] | None:
    """Range of an axis on which nothing moves, which hides rounding; else the viewer's choice."""
    return (-_STILL, _STILL) if largest < _NOISE else None


def _both(root: str, names: list[str]) -> list[str]:
    return [f"{root}/{who}/{entity_of(name)}" for who in ("seecr", "mujoco") for name in names]
