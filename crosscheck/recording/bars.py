"""Bars of the errors, model by model, compared with the noise; the current one is bright."""

from __future__ import annotations

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from crosscheck.diagnosis.path import Stage
from crosscheck.diagnosis.result import Diagnosis
from crosscheck.fit.least_squares.problem import Kind, kinds_read
from crosscheck.fit.reasons import DiagnosisVerdict
from seecr.recording import colours, layout
from seecr.recording.colours import Rgba
from seecr.recording.stream import Recording
from seecr.units import short

ROOT = "bars"
# The drawing is 100 wide; y points down, with one row per model.
_LEFT, _RIGHT, _ROW, _HEAD = 31.0, 82.0, 4.4, 5.6
_DIM, _LABEL = 0.45, 2.2
# Screen points per unit of the drawing, of the title, of a column; largest part of a column.
_POINTS, _TITLE, _COLUMN, _MOST = 5.2, 32.0, 1010.0, 0.6


def write_bars(
    recording: Recording, index: rr.TimeColumn, found: Diagnosis, stages: list[Stage]
) -> None:
    """One block per kind of reading: bars from half the noise to the error on held-out runs."""
    assert found.path is not None
    for block, kind in enumerate(kinds_read(found.path.problem)):
        _block(recording, index, found, stages, kind, block * _block_height(len(stages)))


def view(found: Diagnosis, stages: list[Stage]) -> rrb.Spatial2DView:
    """The bars' view."""
    assert found.path is not None
    height = _height(found, stages)
    return rrb.Spatial2DView(
        name="rms error on held-out runs, logarithmic; the line is the noise",
        origin=ROOT,
        background=rrb.Background(color=layout.GROUND),
        visual_bounds=rrb.VisualBounds2D(x_range=(0.0, 100.0), y_range=(-1.0, height)),
    )


def share(found: Diagnosis, stages: list[Stage]) -> float:
    """Height relative to a column in a window of 1080 points, with room for the labels.

    The viewer's letters keep their size whatever the size of the drawing.
    """
    return min((_POINTS * _height(found, stages) + _TITLE) / _COLUMN, _MOST)


def _height(found: Diagnosis, stages: list[Stage]) -> float:
    assert found.path is not None
    return len(kinds_read(found.path.problem)) * _block_height(len(stages))


def _block_height(rows: int) -> float:
    return _HEAD + rows * _ROW + 1.5


def _block(
    recording: Recording,
    index: rr.TimeColumn,
    found: Diagnosis,
    stages: list[Stage],
    kind: Kind,
    top: float,
) -> None:
    values = np.array([kind.factor * (s.held_out.rms[kind.key] or 0.0) for s in stages])
    floor = kind.factor * (found.floor.get(kind.key) or 0.0)
    ends = _places(values, values, floor)
    rows = top + _HEAD + _ROW * (np.arange(len(stages)) + 0.5)
    lit = np.array([_lit(stage, found) for stage in stages], dtype=np.uint8)
    root = f"{ROOT}/{kind.name}"
    strips = [np.array([[_LEFT, y], [x, y]]) for x, y in zip(ends, rows, strict=True)]
    thick = 0.3 * _ROW
    # the viewer draws 2D boxes as outlines only, so bars are thick lines
    dim = (_DIM * lit).astype(np.uint8)
    dim[:, 3] = 255
    recording.always(
        f"{root}/all", rr.LineStrips2D(strips, radii=thick, colors=dim, draw_order=20.0)
    )
    columns = rr.LineStrips2D.columns(strips=strips, colors=lit)
    recording.rows(f"{root}/now", index, columns.partition([1] * len(stages)))
    recording.always(f"{root}/now", rr.LineStrips2D.from_fields(radii=[thick], draw_order=40.0))
    place = float(_places(np.array([floor]), values, floor)[0])
    line = [[place, rows[0] - 0.6 * _ROW], [place, rows[-1] + 0.6 * _ROW]]
    recording.always(
        f"{root}/noise",
        rr.LineStrips2D([line], radii=0.18, colors=colours.COMMAND, draw_order=50.0),
    )
    names = [s.label for s in stages]
    _words(recording, f"{root}/names", [(0.5 * _LEFT, y) for y in rows], names)
    numbers = [f"{short(v)} {kind.unit}" for v in values]
    _words(recording, f"{root}/numbers", [(x + 8.0, y) for x, y in zip(ends, rows, strict=True)],
           numbers)  # fmt: skip
    title = f"{kind.name} [{kind.unit}], noise {short(floor)}"
    _words(recording, f"{root}/title", [(0.5 * (_LEFT + _RIGHT), top + 0.55 * _HEAD)], [title])


def _places(values: np.ndarray, every: np.ndarray, floor: float) -> np.ndarray:
    """Ends of the bars: logarithmic from half the noise, or linear without noise."""
    if floor <= 0.0:
        return _LEFT + (_RIGHT - _LEFT) * values / max(float(every.max()), 1e-300)
    low = np.log(0.5 * min(floor, float(every[every > 0].min(initial=floor))))
    high = np.log(max(float(every.max()), 2.0 * floor))
    part = (np.log(np.maximum(values, 1e-300)) - low) / (high - low)
    return np.asarray(_LEFT + (_RIGHT - _LEFT) * np.clip(part, 0.01, 1.0))


def _lit(stage: Stage, found: Diagnosis) -> Rgba:
    if not stage.added:
        calm = found.verdict is DiagnosisVerdict.NO_EFFECT_MISSING
        return colours.SILVER if calm else colours.VERMILION
    return colours.SKY


def _words(
    recording: Recording, entity: str, places: list[tuple[float, float]], words: list[str]
) -> None:
    # the viewer draws labels below their points
    places = [(x, y - _LABEL) for x, y in places]
    points = rr.Points2D(places, radii=0.01, colors=colours.COMMAND, labels=words, show_labels=True)
    recording.always(entity, points)
