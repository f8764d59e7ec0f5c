"""The waterfall: errors on runs left out, from the model as it stood down to the noise."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from crosscheck.diagnosis.path import Stage
from crosscheck.diagnosis.result import Diagnosis
from crosscheck.diagnosis.words import noise_is_other
from crosscheck.fit.least_squares.problem import Kind, kinds_read
from crosscheck.fit.reasons import DiagnosisVerdict
from crosscheck.inference.held_out import rms_by_block
from crosscheck.report.drawing import (
    AFTER,
    BEFORE,
    CALM,
    GREY,
    INK,
    NOISE,
    blank,
    grid,
    image,
    plain_log,
    styled,
)
from seecr.units import short

# Errors this many times the noise need a logarithmic axis for both to be seen.
_FAR = 12.0
# More runs than this are shown by their range alone.
_MOST_TICKS = 24
# An error above the noise by this part is not explained.
_ABOVE = 1.15


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
        panels[0].set_yticks(range(len(stages)), [_label(stage, found) for stage in stages])
        panels[0].set_ylim(len(stages) - 0.45, -0.75)
        return image(figure, "Errors on held-out runs, model by model, compared with the noise")


def _label(stage: Stage, found: Diagnosis) -> str:
    rivals = [f.rivals for f in found.missing if f.effect == stage.added]
    if rivals and rivals[0]:
        more = f" or {len(rivals[0])} more" if len(rivals[0]) > 1 else f"\nor {rivals[0][0].name}"
        return stage.label + more
    return stage.label


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
    for row, (stage, value, runs) in enumerate(zip(stages, values, blocks, strict=True)):
        in_sample = _in_sample(stage, kind)
        (_point if logarithmic else _bar)(axes, row, stage, value, _colour(stage, found))
        # beside a dot, which would hide it, and on a bar
        _runs(axes, row + 0.3 * logarithmic, runs)
        if stage.added and in_sample is not None:
            axes.plot(
                [in_sample] * 2, [row - 0.3, row + 0.3], color="#b9c0c7", linewidth=1.4, zorder=4
            )
        reach = max(value, float(np.nanmax(runs, initial=0.0)))
        words = f"{short(value)} {kind.unit}"
        if row == len(stages) - 1 and value > _ABOVE * floor > 0 and not _is_noise(found):
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


def _is_noise(found: Diagnosis) -> bool:
    """Whether the last model leaves noise, of whatever size."""
    return found.verdict in (DiagnosisVerdict.EFFECTS_FOUND, DiagnosisVerdict.NO_EFFECT_MISSING)


def _in_sample(stage: Stage, kind: Kind) -> float | None:
    value = stage.rms[kind.key]
    return None if value is None else value * kind.factor


def _colour(stage: Stage, found: Diagnosis) -> str:
    if not stage.added:
        return CALM if found.verdict is DiagnosisVerdict.NO_EFFECT_MISSING else BEFORE
    return AFTER


def _point(axes: Axes, row: int, stage: Stage, value: float, colour: str) -> None:
    """Where the axis has no zero to begin a bar at."""
    axes.plot(
        value, row, marker="o", markersize=11, markeredgewidth=1.6, zorder=2,
        markeredgecolor=colour, markerfacecolor=colour,
    )  # fmt: skip


def _bar(axes: Axes, row: int, stage: Stage, value: float, colour: str) -> None:
    axes.barh(
        row, value, height=0.52, zorder=2,
        color=colour, edgecolor=colour,
        linewidth=0.8,
    )  # fmt: skip


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
