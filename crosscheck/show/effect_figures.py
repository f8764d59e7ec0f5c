"""Figures of effects: where each acts, what it explains, what imitates it, how small it can be."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from crosscheck.diagnosis.path import ModelPath, Stage
from crosscheck.diagnosis.result import Diagnosis, MissingEffect
from crosscheck.diagnosis.words import noise_is_other
from crosscheck.fit.algebra import basis, beside, imitated
from crosscheck.fit.problem import Kind, kinds_read
from crosscheck.fit.reasons import DiagnosisVerdict, Why
from crosscheck.inference.about import About
from crosscheck.inference.held_out import rms_by_block
from crosscheck.planning.result import Visible
from crosscheck.show.figures import WIDTH, blank, grid, image, plain_log, styled
from seecr.description.robot import Robot
from seecr.pose import Array, transform_points
from seecr.show.colours import AFTER, BEFORE, CALM, GREY, INK, NOISE
from seecr.units import short

# Errors this many times the noise need a logarithmic axis for both to be seen.
_FAR = 12.0
# More runs than this are shown by their range alone.
_MOST_TICKS = 24
# An error above the noise by this part is not explained, unless the last model leaves noise, of
# whatever size.
_ABOVE = 1.15
_IS_NOISE = (DiagnosisVerdict.EFFECTS_FOUND, DiagnosisVerdict.NO_EFFECT_MISSING)


def waterfall(found: Diagnosis) -> str:
    """One row per model, one panel per kind of reading."""
    assert found.path is not None
    stages = found.path.stages
    kinds = kinds_read(found.path.problem)
    with styled():
        figure = blank(0.42 * len(stages) + 1.05)
        panels = figure.subplots(1, len(kinds), sharey=True, squeeze=False)[0]
        for axes, kind in zip(panels, kinds, strict=True):
            _panel(axes, found, stages, kind)
        labels = {one.effect: _or_rivals(one) for one in found.missing}
        panels[0].set_yticks(
            range(len(stages)), [stage.label + labels.get(stage.added, "") for stage in stages]
        )
        panels[0].set_ylim(len(stages) - 0.45, -0.75)
        return image(figure, "Errors on test runs, model by model, compared with the noise")


def _or_rivals(one: MissingEffect) -> str:
    if len(one.rivals) > 1:
        return f" or {len(one.rivals)} more"
    return "".join(f"\nor {rival.name}" for rival in one.rivals)


def _panel(axes: Axes, found: Diagnosis, stages: Sequence[Stage], kind: Kind) -> None:
    assert found.path is not None
    problem = found.path.problem
    values = [(stage.held_out.rms[kind.key] or 0.0) * kind.factor for stage in stages]
    blocks = [rms_by_block(problem, stage.held_out, kind.key) * kind.factor for stage in stages]
    floor = (found.floor.get(kind.key) or 0.0) * kind.factor
    top = max(*values, *(float(np.nanmax(b, initial=0.0)) for b in blocks), floor)
    logarithmic = floor > 0.0 and top > _FAR * floor
    if logarithmic:
        plain_log(axes)
        left, right = 0.5 * min(floor, *values), top * (top / floor) ** 0.32
    else:
        left, right = 0.0, 1.45 * top
        axes.locator_params(axis="x", nbins=5)
    axes.set_xlim(left, right)
    axes.axvspan(left, floor, color=NOISE, linewidth=0, zorder=0)
    axes.axvline(floor, color=GREY, linewidth=1.0, linestyle=(0, (3, 2)), zorder=1)
    noise = "estimated noise" if noise_is_other(found) else "noise"
    axes.annotate(
        f"{noise} {short(floor)}", (floor, -0.72), xytext=(3, -2), textcoords="offset points",
        color=GREY, fontsize=7.5, va="top",
    )  # fmt: skip
    alone = CALM if found.verdict is DiagnosisVerdict.NO_EFFECT_MISSING else BEFORE
    for row, (stage, value, runs) in enumerate(zip(stages, values, blocks, strict=True)):
        in_sample = stage.rms[kind.key]
        colour = AFTER if stage.added else alone
        if logarithmic:  # the axis has no zero to begin a bar at
            axes.plot(value, row, marker="o", markersize=12.6, color=colour, zorder=2)
        else:
            axes.barh(row, value, height=0.52, zorder=2, color=colour, linewidth=0.8)
        # beside a dot, which would hide it, and on a bar
        _runs(axes, row + 0.3 * logarithmic, runs)
        if stage.added and in_sample is not None:
            ends = [in_sample * kind.factor] * 2, [row - 0.3, row + 0.3]
            axes.plot(*ends, color="#b9c0c7", linewidth=1.4, zorder=4)
        reach = max(value, float(np.nanmax(runs, initial=0.0)))
        words = f"{short(value)} {kind.unit}"
        is_noise = found.verdict in _IS_NOISE
        if row == len(stages) - 1 and value > _ABOVE * floor > 0 and not is_noise:
            words += "\nnot explained"
        axes.annotate(
            words, (reach, row), xytext=(5, 0), textcoords="offset points", va="center",
            fontsize=8.5, color=INK,
        )  # fmt: skip
    scale = ", logarithmic" if logarithmic else ""
    axes.set_xlabel(f"rms {kind.name} error [{kind.unit}]{scale}")
    axes.tick_params(axis="y", length=0)
    axes.spines["left"].set_visible(False)
    grid(axes, "x")


def _runs(axes: Axes, row: float, runs: np.ndarray) -> None:
    """The range over the runs left out, and one tick per run."""
    runs = runs[np.isfinite(runs)]
    if len(runs) < 2:
        return
    axes.plot([runs.min(), runs.max()], [row, row], color=INK, linewidth=0.9, zorder=5)
    shown = runs if len(runs) <= _MOST_TICKS else np.quantile(runs, [0, 0.25, 0.5, 0.75, 1])
    axes.plot(
        shown, [row] * len(shown), linestyle="none", marker="|", markersize=7,
        markeredgewidth=0.9, color=INK, zorder=5,
    )  # fmt: skip


# Effects in the map where some are listed, and where none are.
_FEW, _MANY = 12, 30
# From here on two effects look alike.
ALIKE = 0.9


@dataclass(frozen=True, eq=False)
class Confusion:
    """What could imitate what.

    Attributes:
        names: of the effects. listed: of those, how many the diagnosis lists (they come first).
        part: (k, k) part of the row's signal that the column could imitate.
    """

    names: tuple[str, ...]
    listed: int
    part: Array

    @property
    def alike(self) -> NDArray[np.bool_]:
        """(k, k) which two imitate each other."""
        return (np.minimum(self.part, self.part.T) > ALIKE) & ~np.eye(len(self.part), dtype=bool)

    @property
    def twins(self) -> list[tuple[str, str]]:
        """Pairs that imitate each other."""
        return [(self.names[i], self.names[j]) for i, j in np.argwhere(np.triu(self.alike))]


def confusion_of(found: Diagnosis) -> Confusion | None:
    """Of the effects found, their rivals and the best of the others, at the final model."""
    if found.path is None:
        return None
    columns, about = {}, About(found.path.search.every, found.path.last.fit)
    for name in _names(found):
        own = _columns(found.path, about, name)
        if own is not None and float(np.sum(own**2)) > 0.0:
            columns[name] = own
    kept = tuple(columns)
    if len(kept) < 2:
        return None
    bases = {name: basis(own) for name, own in columns.items()}
    part = np.array([[imitated(columns[a], bases[b]) for b in kept] for a in kept])
    listed = sum(1 for f in found.missing if f.effect in columns)
    return Confusion(kept, listed, part)


def _names(found: Diagnosis) -> list[str]:
    """Listed effects first, then what cannot be told from them, then the best of the others."""
    names = [f.effect for f in found.missing]
    names += [rival.name for f in found.missing for rival in f.rivals]
    names += [
        row.effect
        for row in sorted(found.candidates, key=lambda row: -row.score)
        if not row.why_not.lacking and row.why_not.why is not Why.UNSEEN
    ]
    return list(dict.fromkeys(names))[: _FEW if found.missing else _MANY]


def _columns(path: ModelPath, about: About, name: str) -> Array | None:
    """(N, p) what an effect does beside the base model, by expected sizes."""
    final = path.last.fit
    key = path.search.every.keys_of(final.terms).get(name, name)
    own = about.columns.get(key)
    if own is None:
        return None
    had = np.array([effect in path.base for effect, _key in final.terms.labels], dtype=bool)
    return beside(own, basis(final.jacobian[:, had]))


def draw_confusion(confusion: Confusion) -> str:
    """A matrix: row imitated by column; pairs that imitate each other are framed."""
    names, part = confusion.names, confusion.part
    k = len(names)
    side = min(0.5, 7.2 / k)
    with styled():
        figure = blank(side * k + 1.75, min(WIDTH, side * k + 3.4))
        axes = figure.subplots()
        axes.imshow(part, cmap="Blues", vmin=0.0, vmax=1.25, aspect="equal")
        for i in range(k):
            for j in range(k):
                if i != j and part[i, j] >= 0.005:
                    axes.text(
                        j, i, _words(part[i, j], k), ha="center", va="center",
                        fontsize=7.5 if k <= _FEW else 6.2,
                        color="white" if part[i, j] > 0.75 else INK,
                    )  # fmt: skip
        for i, j in np.argwhere(confusion.alike):
            corner = (j - 0.46, i - 0.46)
            frame = Rectangle(corner, 0.92, 0.92, fill=False, edgecolor=BEFORE, linewidth=1.8)
            axes.add_patch(frame)
        axes.set_xticks(range(k), names, rotation=40, ha="right", rotation_mode="anchor")
        axes.set_yticks(range(k), names)
        for labels in (axes.get_yticklabels(), axes.get_xticklabels()):
            for label in labels[: confusion.listed]:
                label.set_fontweight("bold")
        axes.set_xlabel("could be imitated by")
        axes.tick_params(length=0)
        axes.spines[:].set_visible(False)
        return image(figure, "How much of each effect another could imitate")


def _words(part: float, count: int) -> str:
    if count > _FEW and part < 0.5:
        return ""
    text = f"{100 * np.floor(100 * part) / 100:.0f}"
    return text if part < 0.9995 else "100"


_SIZE_ROW = 0.19


def draw_sizes(effects: tuple[Visible, ...]) -> str:
    """The smallest size that shows and that can be named, in expected sizes, of each effect."""
    shown = [found for found in effects if np.isfinite(found.factor)]
    with styled():
        figure = blank(_SIZE_ROW * len(shown) + 0.9)
        axes = figure.subplots()
        place = np.arange(len(shown))[::-1]
        factor = np.array([found.factor for found in shown])
        named = np.array([np.nan if found.twins else found.identifiable for found in shown])
        axes.hlines(place, factor, np.where(np.isfinite(named), named, factor), color=INK, lw=0.6)
        axes.plot(factor, place, "o", color=AFTER, markersize=5, label="shows")
        axes.plot(named, place, "D", color=BEFORE, markersize=4, label="can be named")
        axes.axvline(1.0, color=INK, linewidth=0.8, linestyle=":")
        axes.set_yticks(place, [found.name for found in shown])
        axes.set_ylim(-0.7, len(shown) - 0.3)
        plain_log(axes)
        axes.set_xlabel("smallest visible size, in expected sizes (dotted: 1)")
        axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2)
        grid(axes, "x")
        return image(figure, "The smallest visible sizes")


# --- the robot at its reference pose, with the culprits marked ------------------------------------

# Size of the drawing [in]; it is as high as the robot needs, within these bounds.
_WIDTH, _LOWEST, _HIGHEST = 4.9, 1.7, 3.6
# From where a spatial robot is seen: turned about the vertical, then looked at from above [rad].
_TURN, _ABOVE = np.radians(-32.0), np.radians(22.0)
# A cable is marked if its value is at least this part of the largest one.
_LARGE = 0.5
_NUMBER = re.compile(r"_(\d+)(?:_|$)")
# What an effect is drawn at, by its name, or else by its place in the catalogue.
_AT = {
    "anchor_point_error": "anchors", "pulley_radius": "exits", "exit_point_error": "exits",
    "winch_side_length": "exits", "exit_friction": "exits", "initial_pose_error": "platform",
    "actuation": "exits", "geometry": "exits", "cable": "cables", "structure": "exits",
    "load": "platform", "sensing": "target",
}  # fmt: skip


def robot_figure(robot: Robot, missing: Sequence[MissingEffect]) -> str:
    """The robot as an element of the page; what is missing is drawn where it acts."""
    exits = robot.exit_points
    anchors = transform_points(robot.reference_pose[None], robot.anchor_points)[0]
    flat = projection(robot, np.concatenate([exits, anchors]))
    a, b = exits @ flat.T, anchors @ flat.T
    wide, high = np.ptp(np.concatenate([a, b]), axis=0)
    with styled():
        figure = blank(float(np.clip(_WIDTH * high / wide, _LOWEST, _HIGHEST)), _WIDTH)
        figure.patch.set_alpha(0.0)
        axes = figure.subplots()
        origin = (robot.reference_pose[:3]) @ flat.T
        _draw_robot(axes, robot, a, b)
        for finding in missing:
            _mark(axes, finding, a, b, origin)
        axes.set_aspect("equal")
        axes.axis("off")
        axes.margins(0.12)
        where = "; marked: " + ", ".join(one.title for one in missing) if missing else ""
        return image(figure, f"The robot at its reference pose{where}")


def projection(robot: Robot, points: Array) -> Array:
    """Two directions (2, 3) of the paper in the base frame: to the right, and upwards.

    A flat robot is seen at right angles to its plane.
    """
    up = robot.up
    spread = points - points.mean(axis=0)
    _u, sizes, axes = np.linalg.svd(spread, full_matrices=False)
    if sizes[-1] <= 0.02 * sizes[0]:
        normal = axes[-1]
        if abs(normal @ up) < 0.9:
            right = np.cross(up, normal)
            right *= np.sign(right[int(np.argmax(np.abs(right)))])
            return np.stack([right / np.linalg.norm(right), up])
        return axes[:2]
    side = np.eye(3)[int(np.argmin(np.abs(up)))]
    first = side - (side @ up) * up
    first /= np.linalg.norm(first)
    second = np.cross(up, first)
    right = np.cos(_TURN) * first + np.sin(_TURN) * second
    away = -np.sin(_TURN) * first + np.cos(_TURN) * second
    return np.stack([right, np.cos(_ABOVE) * up + np.sin(_ABOVE) * away])


def _draw_robot(axes: Axes, robot: Robot, exits: Array, anchors: Array) -> None:
    for start, end in zip(exits, anchors, strict=True):
        axes.plot(*np.stack([start, end]).T, color=GREY, linewidth=0.9, zorder=1)
    try:
        corners = anchors[ConvexHull(anchors).vertices]
        axes.fill(*corners.T, facecolor=NOISE, edgecolor=INK, linewidth=1.0, zorder=2)
    except (QhullError, ValueError):  # a point, or a bar seen from its side
        axes.plot(*anchors.T, color=INK, linewidth=2.5, marker="o", markersize=4, zorder=2)
    axes.plot(*exits.T, linestyle="none", marker="s", markersize=4.5, color=INK, zorder=3)
    middle = exits.mean(axis=0)
    for name, place in zip(robot.cable_names, exits, strict=True):
        right = place[0] > middle[0]
        axes.annotate(
            name, place, xytext=(9 if right else -9, 0), textcoords="offset points",
            ha="left" if right else "right", va="center", fontsize=7, color=GREY,
        )  # fmt: skip


def _mark(axes: Axes, finding: MissingEffect, exits: Array, anchors: Array, origin: Array) -> None:
    effect = finding.layout.effect
    at = _AT.get(finding.effect, _AT.get(effect.place, "platform"))
    which = cables_of(finding, len(exits))
    ring: dict[str, Any] = {
        "linestyle": "none", "marker": "o", "markersize": 12, "markerfacecolor": "none",
        "markeredgewidth": 1.8, "markeredgecolor": BEFORE, "zorder": 4,
    }  # fmt: skip
    if at == "cables":
        for k in which:
            axes.plot(*np.stack([exits[k], anchors[k]]).T, color=BEFORE, linewidth=2.2, zorder=1.5)
    elif at == "platform":
        axes.plot(*origin, **{**ring, "markersize": 22})
    elif at == "target":
        axes.plot(*origin, **{**ring, "marker": "+", "markersize": 18, "markeredgecolor": AFTER})
    else:
        points = exits if at == "exits" else anchors
        axes.plot(*points[which].T, **ring)


def cables_of(finding: MissingEffect, cables: int) -> list[int]:
    """The cables, from 0, whose values are large; all if it has no values for each cable."""
    layout = finding.layout
    size = np.zeros(cables)
    for name, value in zip(layout.names, finding.term.sizes, strict=True):
        number = _NUMBER.search(name)
        if number is not None and 1 <= int(number[1]) <= cables:
            size[int(number[1]) - 1] = max(size[int(number[1]) - 1], abs(float(value)))
    return np.flatnonzero(size >= _LARGE * size.max()).tolist()  # all where all are 0
