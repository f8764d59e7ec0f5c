"""Plots and lanes of a case, over its poses and over the time of one settling."""

from __future__ import annotations

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from crosscheck.recording.material import Material
from crosscheck.suite.verdicts import UNSOLVED, Verdict
from seecr.pose import Array, pose_difference
from seecr.recording import colours, layout, plots
from seecr.recording.colours import Rgba
from seecr.recording.stream import Index, Recording

DEVIATION, TILT, TENSION = "plot/deviation", "plot/tilt", "plot/tension"
DIFFERENCE, SETTLED, LIMIT = "plot/difference", "plot/plain_settling", "plot/limit"
LANES = "lanes"
VERDICT = f"{LANES}/Verdict"
# A component of the deviation below this part of the largest one is left out of the plots.
_UNSEEN = 1e-6
# What moves less than this [mm or degrees] does not move, and is shown on an axis of this.
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


class Series:
    """Logs a case's numbers; what is compared is in double precision."""

    def __init__(self, recording: Recording, material: Material) -> None:
        self.recording, self.material = recording, material

    @staticmethod
    def views(material: Material) -> list[rrb.TimeSeriesView]:
        """The plots, top to bottom."""
        moved, turned = _components(material)
        most, widest = _largest(material, moved), _largest(material, turned)
        return [
            layout.plot("Deviation from the command [mm]", _both(DEVIATION, moved), _still(most)),
            layout.plot("Rotation from the command [°]", _both(TILT, turned), _still(widest)),
            layout.plot("Tension [N]", [f"{TENSION}/**"]),
            layout.plot(
                "log10 |SEECR − MuJoCo| (crosses: before the polish, lines: limits)",
                [f"{SETTLED}/**", f"{DIFFERENCE}/**", f"{LIMIT}/**"],
            ),
        ]

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
        plots.lanes(self.recording, VERDICT, index, verdicts)
        _verdict_style(self.recording)
        self._style()

    def over_settling(self, index: Index) -> None:
        """MuJoCo on its way, and how far it still is from SEECR's answer."""
        material, i = self.material, self.material.watched
        assert material.motion is not None
        moving, k = material.settling, len(material.motion.t_s)
        target = np.tile(material.seecr.pose[i], (k, 1))
        self._deviation("seecr", index, target, material.command[i])
        self._deviation("mujoco", index, moving.pose, material.command[i])
        aim = np.tile(material.seecr.tensions[i], (k, 1))
        self._tension("seecr", index, aim)
        self._tension("mujoco", index, moving.tensions)
        gap = pose_difference(moving.pose, target)
        worst = np.abs(moving.tensions - aim).max(axis=1)
        self._log(DIFFERENCE, "position", index, np.linalg.norm(gap[:, :3], axis=1))
        self._log(DIFFERENCE, "orientation", index, np.linalg.norm(gap[:, 3:], axis=1))
        self._log(DIFFERENCE, "tension", index, worst)
        self._lanes(index, plots.lane_states(moving.slack, moving.slack & False, moving.known))

    def _deviation(self, who: str, index: Index, poses: Array, command: Array) -> None:
        for name, values in plots.deviation(poses, command).items():
            root = DEVIATION if name in plots.TRANSLATIONS else TILT
            self.recording.scalars(f"{root}/{who}/{_entity(name)}", index, values)

    def _tension(self, who: str, index: Index, tensions: Array) -> None:
        for name, values in zip(self.material.robot.cable_names, tensions.T, strict=True):
            self.recording.scalars(f"{TENSION}/{who}/{_entity(name)}", index, values)

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
            plots.lanes(self.recording, f"{LANES}/{_entity(name)}", index, list(column))

    def _log(self, root: str, quantity: str, index: Index, values: Array) -> None:
        self.recording.scalars(f"{root}/{quantity}", index, plots.log10(values))

    def _style(self) -> None:
        """Lines for SEECR and dots for MuJoCo, or two kinds of dots where poses are unrelated."""
        for name, colour in _COMPONENTS.items():
            root = DEVIATION if name in plots.TRANSLATIONS else TILT
            self._pair(root, _entity(name), name, colour)
        shades = colours.cable_colours(self.material.robot.n_cables)
        for name, shade in zip(self.material.robot.cable_names, shades, strict=True):
            colour = (int(shade[0]), int(shade[1]), int(shade[2]), 255)
            self._pair(TENSION, _entity(name), name, colour)
            plots.lane_style(self.recording, f"{LANES}/{_entity(name)}", colour)
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
    """Green where all is well, red where a threshold is exceeded, in between findings."""
    shades = {verdict.name.lower(): _YELLOW for verdict in Verdict}
    shades |= {"agrees": _GREEN, "differs": _RED}
    shades |= {verdict.name.lower(): _PURPLE for verdict in UNSOLVED}
    plots.state_colours(recording, VERDICT, shades)


def _components(material: Material) -> tuple[list[str], list[str]]:
    """Which components are worth a line: those that move at all."""
    parts = plots.deviation(material.seecr.pose, material.command)
    largest = {name: np.nanmax(np.abs(values), initial=0.0) for name, values in parts.items()}
    most = max(largest[n] for n in plots.TRANSLATIONS)
    moved = [n for n in plots.TRANSLATIONS if largest[n] > _UNSEEN * most]
    turned = [n for n in plots.TURNS if largest[n] > _UNSEEN * max(largest["tilt"], 1e-6)]
    return moved or ["dz"], [*turned, "tilt"] if len(turned) != 1 else turned


def _largest(material: Material, names: list[str]) -> float:
    """The largest of some components of the deviation [mm or degrees]."""
    parts = plots.deviation(material.seecr.pose, material.command)
    return max(float(np.nanmax(np.abs(parts[name]), initial=0.0)) for name in names)


def _still(largest: float) -> tuple[float, float] | None:
    """Range of an axis on which nothing moves, lest it show rounding; else the viewer's choice."""
    return (-_STILL, _STILL) if largest < _NOISE else None


def _both(root: str, names: list[str]) -> list[str]:
    return [f"{root}/{who}/{_entity(name)}" for who in ("seecr", "mujoco") for name in names]


def _entity(name: str) -> str:
    return rr.escape_entity_path_part(name.replace(" ", "_"))
