"""The recording of a workspace: the poses that can be held as points, coloured by their margin.

With an elastic map, further tabs show where the platform comes to rest, slice by slice on a
timeline, with the colours' ends of the figure.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from seecr.counted import counted
from seecr.pose import Array
from seecr.show import colours, layout
from seecr.show.map_figure import Layer, elastic_layers
from seecr.show.scene import LEGEND, ROOT, Scene, extent, write_scale
from seecr.show.stream import POSE, Recording, opening, place_index, recording_file
from seecr.workspace.grid import Workspace, across_of, directions_words, evenly_picked

# Viewers do not turn more points than these smoothly.
_MOST_POINTS = 200_000
# A pose is unsure if the probability that it can be held is between these.
_SURELY_NOT, _SURELY = 0.05, 0.95


def write_map_recording(found: Workspace, path: str | Path, edge: Array | None = None) -> None:
    """Write the robot, the positions at which its platform can be held, and the edge (k, 7) of
    these.

    Raises:
        InputFileError: the file cannot be written.
    """
    robot, name = found.robot, f"{found.robot.name} workspace"
    places = found.places[found.feasible]
    margins = found.margin[found.feasible]
    step = 1 + len(places) // _MOST_POINTS
    places, margins = places[::step], margins[::step]
    finite = margins[np.isfinite(margins)]
    top = colours.round_up(float(np.quantile(finite, 0.95)) if len(finite) else 1.0)
    corners = np.tile(robot.reference_pose, (2, 1))
    every = found.places.reshape(-1, 3)
    corners[:, :3] = every.min(axis=0), every.max(axis=0)
    low, high = extent(robot, corners)
    contents = ("$origin/**", f"- /{HIDDEN}")
    view = layout.scene_view(robot, low, high, name, 1.9, contents)
    held = rrb.Vertical(view, layout.legend(LEGEND), row_shares=[0.9, 0.1], name="Can be held")
    elastic = Elastic(found) if np.any(found.rests) else None
    root = held if elastic is None else rrb.Tabs(held, *elastic.tabs(low, high))
    opens = (POSE, 1.0) if elastic is None else elastic.opening
    with recording_file(path, name, layout.blueprint(root, timeline=opens)) as recording:
        scene = Scene(recording, robot, corners, top)
        scene.surroundings()
        scene.axes()
        words = "how far inside their limits all tensions can stay"
        more = "" if found.chance is None else "; red: the model is not certain"
        write_scale(recording, top, words + more)
        points = rr.Points3D(
            places,
            radii=0.004 * scene.size,
            colors=colours.scale_colours(np.minimum(margins, top), top),
        )
        recording.always(f"{ROOT}/held", points)
        if found.chance is not None:
            # the model leaves open whether these can be held
            open_ = found.places[(found.chance > _SURELY_NOT) & (found.chance < _SURELY)]
            some = open_[:: 1 + len(open_) // _MOST_POINTS]
            red = rr.Points3D(some, radii=0.006 * scene.size, colors=colours.VERMILION)
            recording.always(f"{ROOT}/unsure", red)
        if edge is not None:
            some = edge[:: 1 + len(edge) // _MOST_POINTS, :3]
            dots = rr.Points3D(some, radii=0.002 * scene.size, colors=colours.VERMILION)
            recording.always(f"{ROOT}/edge", dots)
        if elastic is not None:
            elastic.write(recording, scene)


# Most positions of each quantity, in all slices, and most arrows of one slice.
_MOST, _MOST_ARROWS = 60_000, 2_500
_ELASTIC, _SHOWN = f"{ROOT}/elastic", "shown"
# What the view of poses that can be held leaves out.
HIDDEN = f"{_ELASTIC}/**"
_ALONE = ("frame", "exit_points", "cable_names", "axes")
# Width over height of one of three views beside each other.
_ASPECT = 0.72
# Height of the camera over its distance where slices are level: from low they are lines.
_FROM_ABOVE = 1.8
# Length of the softest direction's arrows [grid's step], and radius of points.
_LONG, _WIDE = 0.9, 0.45


@dataclass(frozen=True, eq=False)
class Elastic:
    """The elastic map of a workspace, as it is recorded."""

    found: Workspace

    @cached_property
    def layers(self) -> tuple[Layer, ...]:
        """The quantities that are shown beside each other."""
        return elastic_layers(self.found)

    @property
    def across(self) -> int:
        """The axis that slices are normal to."""
        return across_of(self.found)

    @cached_property
    def picked(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Indices of the slices, and of the poses of each, counted along the other two axes."""
        count = len(self.found.axes[self.across])
        size = self.found.margin.size // count
        each = evenly_picked(size, _MOST) if size > _MOST else np.arange(size)
        return evenly_picked(count, max(1, _MOST // len(each))), each

    @cached_property
    def index(self) -> rr.TimeColumn | None:
        """The timeline along the slices; None if there is only one, which is then always there."""
        slices, _ = self.picked
        name, places = self.found.axis_names[self.across], self.found.axes[self.across][slices]
        if len(slices) == 1:
            return None
        along = place_index(name, places)
        return along or rr.TimeColumn(f"slice_{name}", sequence=slices)

    @property
    def opening(self) -> tuple[str, float]:
        """The timeline that the recording opens with, and its step from slice to slice."""
        return (POSE, 1.0) if self.index is None else opening([self.index])

    def number(self, of_slice: int) -> NDArray[np.intp]:
        """Indices, in the flattened grid, of the poses of a slice at which the platform rests."""
        shape = self.found.margin.shape
        whole = np.arange(self.found.margin.size).reshape(shape)
        own = np.take(whole, of_slice, self.across).ravel()[self.picked[1]]
        return np.asarray(own[self.found.rests.ravel()[own]])

    def sentences(self) -> Iterator[str]:
        """What is shown, and what is not."""
        found, (slices, each) = self.found, self.picked
        count = len(found.axes[self.across])
        name = found.axis_names[self.across]
        one = f"One slice, at {name} = {1e3 * found.axes[self.across][0]:.4g} mm."
        many = f"Slices normal to {name}: {len(slices)} of {counted(count, 'value')} of {name}."
        yield one if count == 1 else many
        if found.directions is not None:
            yield f"The grid has {directions_words(found.directions)}."
        size = found.margin.size // count
        if len(each) < size:
            yield f"Of each slice {len(each)} of {counted(size, 'pose')}, evenly spread."
        if len(slices) > 1:
            yield "The timeline goes from slice to slice."
        if lost := _lost_words(found):
            yield f"Without a point: {lost}."
        ends = [_end_words(layer) for layer in self.layers if layer.unit]
        yield (
            f"Colours end at {' and '.join(ends)}, as in the figure: 95 % of the "
            "poses that can be held are below. Points are at the commands; white arrows lead from "
            "there to where the platform rests."
        )
        if max(len(self.number(k)) for k in slices) > _MOST_ARROWS:
            yield f"A slice has at most {_MOST_ARROWS} arrows of each kind, evenly spread."

    def write(self, recording: Recording, scene: Scene) -> None:
        """Log slices, arrows, legends and words."""
        rows = [self.number(k) for k in self.picked[0]]
        places = self.found.places.reshape(-1, 3)
        radius = _WIDE * self._step or 0.01 * scene.size
        for layer in self.layers:
            shades = colours.scale_colours(np.nan_to_num(layer.values.ravel()), layer.top)
            points = rr.Points3D.columns(
                positions=np.concatenate([places[own] for own in rows]),
                colors=np.concatenate([shades[own] for own in rows]),
                radii=np.full(sum(map(len, rows)), radius),
            )
            self._log(recording, f"{_ELASTIC}/{layer.name}/points", points, rows)
            write_scale(recording, layer.top, _scale_words(layer), layer.unit, _legend_of(layer))
        few = [own[evenly_picked(len(own), _MOST_ARROWS)] if len(own) else own for own in rows]
        away = self.found.deviation.reshape(-1, 3).astype(float)
        white = f"{_ELASTIC}/away/arrows", away, colours.COMMAND
        for entity, vectors, shade in (white, *self._softest()):
            arrows = rr.Arrows3D.columns(
                origins=np.concatenate([places[own] for own in few]),
                vectors=np.concatenate([vectors[own] for own in few]),
                colors=np.tile(np.array(shade, np.uint8), (sum(map(len, few)), 1)),
                radii=np.full(sum(map(len, few)), 0.15 * radius),
            )
            self._log(recording, entity, arrows, few)
        recording.always(_SHOWN, rr.TextDocument(" ".join(self.sentences())))

    def _log(
        self, recording: Recording, entity: str, columns: rr.ComponentColumnList,
        rows: list[NDArray[np.intp]],
    ) -> None:  # fmt: skip
        """One row of the timeline for each slice; a single slice holds at all times."""
        parts = columns.partition([len(own) for own in rows])
        index: list[rr.TimeColumn] = [] if self.index is None else [self.index]
        recording.rows(entity, index, parts)

    @property
    def _step(self) -> float:
        """Smallest step of the grid within a slice [m]; 0 if it has none."""
        steps = [
            float(np.abs(np.diff(axis)).min())
            for k, axis in enumerate(self.found.axes)
            if k != self.across and len(axis) > 1
        ]
        return min(steps, default=0.0)

    def _softest(self) -> Iterator[tuple[str, Array, colours.Rgba]]:
        """Arrows of the softest direction: the motion, and the axis of the rotation."""
        found, robot = self.found, self.found.robot
        whole = found.softest.reshape(-1, 6).astype(float) * np.repeat([1.0, robot.length], 3)
        long = (_LONG * self._step or 0.05 * robot.length) * whole
        yield f"{_ELASTIC}/softest/moves", long[:, :3], colours.SKY
        if robot.turns:
            yield f"{_ELASTIC}/softest/turns", long[:, 3:], colours.ORANGE

    def tabs(self, low: Array, high: Array) -> list[rrb.Container]:
        """The tabs of the layout: the quantities beside each other, and the softest direction."""
        aspect = 3.0 * _ASPECT / len(self.layers)
        views = [
            rrb.Vertical(
                self._view(low, high, layer.name, layer.label[0].upper() + layer.label[1:], aspect),
                layout.legend(_legend_of(layer)),
                row_shares=[0.9, 0.1],
            )
            for layer in self.layers
        ]
        # a view has one place in the layout
        words = [layout.text("Shown", _SHOWN) for _ in range(2)]
        soft = "Softest direction, a grid step long. Blue: moves along"
        if self.found.robot.turns:
            soft += ", orange: turns about"
        return [
            rrb.Vertical(
                rrb.Horizontal(*views), words[0], row_shares=[0.88, 0.12], name="Where it rests"
            ),
            rrb.Vertical(
                self._view(low, high, "softest", soft, 2.0 * _ASPECT), words[1],
                row_shares=[0.88, 0.12], name="Softest direction",
            ),
        ]  # fmt: skip

    def _view(
        self, low: Array, high: Array, name: str, title: str, aspect: float
    ) -> rrb.Spatial3DView:
        entities = [f"{ROOT}/{one}" for one in _ALONE]
        contents = [ROOT, *entities, f"{_ELASTIC}/{name}/**"]
        robot = self.found.robot
        level = abs(self.found.along_axes(robot.up)[self.across]) > 0.5
        above = _FROM_ABOVE if level else None
        return layout.scene_view(robot, low, high, title, aspect, contents, above)


def _lost_words(found: Workspace) -> str:
    """At how many commands the platform is not at rest; nothing if there are none."""
    whys = {"does not come to rest": ~found.rests & ~found.free, "is free to move": found.free}
    numbers = {why: int(poses.sum()) for why, poses in whys.items()}
    return " and ".join(
        f"{counted(number, 'command')} where it {why}" for why, number in numbers.items() if number
    )


def _legend_of(layer: Layer) -> str:
    return f"{LEGEND}_{layer.name}"


def _end_words(layer: Layer) -> str:
    """The end of its colours, with the unit."""
    return f"{layer.top:.4g}{'' if layer.unit == '°' else ' '}{layer.unit}"


def _scale_words(layer: Layer) -> str:
    """What its scale shows, and that it ends before the largest values do."""
    beyond = layer.unit and np.nanmax(layer.values, initial=0.0) > layer.top
    return f"{layer.title}{'; the last colour: or more' if beyond else ''}"
