"""One recording file: written beside its target, and renamed when complete."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import ArrayLike

from seecr.files import written
from seecr.pose import Array
from seecr.show.colours import COMMAND, Rgba

POSE, SETTLING, MODEL_STEP = "pose", "settling_time", "model_step"
Index: TypeAlias = rr.TimeColumn | Sequence[rr.TimeColumn]
# Positions on a timeline are rounded by less than this part of a step.
_ROUNDED = 0.03


class Recording:
    """A recording being written; errors in the data are raised instead of logged.

    Attributes:
        stream: Rerun's.
    """

    def __init__(self, stream: rr.RecordingStream) -> None:
        self.stream = stream

    def always(self, entity: str, *archetypes: Any) -> None:
        """Log something that holds at every time."""
        self.stream.log(entity, *archetypes, static=True, strict=True)

    def text(self, entity: str, text: str) -> None:
        """Show a text in Markdown at every time."""
        self.always(entity, rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN))

    def texts(self, entity: str, index: Index, texts: Sequence[str]) -> None:
        """Show texts (n,) in Markdown over timelines."""
        kinds = [str(rr.MediaType.MARKDOWN)] * len(texts)
        self.rows(entity, index, rr.TextDocument.columns(text=texts, media_type=kinds))

    def labels(
        self, entity: str, places: ArrayLike, words: Sequence[str],
        shades: Sequence[Rgba] | Rgba = COMMAND,
    ) -> None:  # fmt: skip
        """Words at places (n, 2) of a drawing; the viewer draws them below their points."""
        points = rr.Points2D(places, radii=0.0, colors=shades, labels=words, show_labels=True)
        self.always(entity, points)

    def rows(self, entity: str, index: Index, columns: Iterable[Any]) -> None:
        """Log rows over timelines, sent as columns: faster and smaller than row by row."""
        timelines = [index] if isinstance(index, rr.TimeColumn) else index
        self.stream.send_columns(entity, timelines, columns, strict=True)

    def scalars(self, entity: str, index: Index, values: ArrayLike) -> None:
        """Log numbers (n,), or (n, k) for k lines, over timelines, in double precision."""
        numbers = np.asarray(values, dtype=float)
        columns = rr.Scalars.columns(scalars=numbers.ravel())
        several = numbers.ndim > 1
        lengths = [numbers.shape[1]] * len(numbers) if several else None
        self.rows(entity, index, columns.partition(lengths) if lengths else columns)


def entity_of(name: str) -> str:
    """The part of an entity's path that stands for a name of the user's, such as a cable's."""
    return str(rr.escape_entity_path_part(name.replace(" ", "_")))


def pose_index(count: int) -> rr.TimeColumn:
    """The timeline over poses, counted from 0 as in a terminal and in every file of results."""
    return rr.TimeColumn(POSE, sequence=range(count))


def sweep_index(poses: Array) -> list[rr.TimeColumn]:
    """Timelines over commanded poses (n, 7): numbers, and positions of a line along an axis.

    Rerun's timelines are whole numbers: the position is in millimetres, or in micrometres if these
    are not fine enough. The timeline to open is the last one.
    """
    index = [pose_index(len(poses))]
    moves = np.ptp(poses[:, :3], axis=0) if len(poses) > 1 else np.zeros(3)
    axis = int(np.argmax(moves))
    steps = np.diff(poses[:, axis])
    along = moves[axis] > 0.0 and np.all(np.delete(moves, axis) < 1e-6 * moves[axis])
    if not along or not (np.all(steps > 0.0) or np.all(steps < 0.0)):
        return index
    more = place_index("xyz"[axis], poses[:, axis])
    return index if more is None else [*index, more]


def place_index(axis: str, places: Array) -> rr.TimeColumn | None:
    """The timeline over places (n,) [m] along an axis; None if micrometres are not fine enough."""
    least = np.abs(np.diff(places)).min()
    for unit, factor in (("mm", 1e3), ("um", 1e6)):
        ticks = factor * places
        if np.abs(ticks - ticks.round()).max() < _ROUNDED * factor * least:
            return rr.TimeColumn(f"{axis}_{unit}", sequence=ticks.round().astype(int))
    return None


def opening(index: Sequence[rr.TimeColumn]) -> tuple[str, float]:
    """The timeline that a recording opens with, and its step between two poses.

    Time plays at its own speed.
    """
    name = str(index[-1].timeline_name())
    if name == SETTLING:
        return name, 1.0
    steps = np.abs(np.diff(index[-1].as_arrow_array().to_numpy(zero_copy_only=False)))
    return name, float(np.median(steps)) if len(steps) else 1.0


def settling_index(t_s: Array) -> rr.TimeColumn:
    """The timeline over simulated time (k,) [s] of one settling."""
    return rr.TimeColumn(SETTLING, duration=[float(t) for t in t_s])


@contextmanager
def recording_file(path: str | Path, name: str, blueprint: rrb.Blueprint) -> Iterator[Recording]:
    """Write a recording; nothing is left at ``path`` unless all of it was written.

    Its name in the viewer is its identity, too: a newer one of the same case replaces it there.

    Raises:
        InputFileError: the file cannot be written.
    """
    # the viewer keeps one layout per application, and several recordings may be open together
    application = "crosscheck-" + re.sub(r"[^A-Za-z0-9_-]", "-", name)
    stream = rr.RecordingStream(application, recording_id=name)
    # in memory first: on a full disk Rerun's own files end anywhere, and it may wait for ever
    memory = stream.memory_recording()
    stream.send_blueprint(blueprint, make_active=False, make_default=True)
    stream.send_recording_name(name)
    with written(Path(path), failure="cannot write the recording") as (partial,):
        try:
            partial.touch()  # a folder that is not writable is told before the work
            yield Recording(stream)
            stream.flush()
            partial.write_bytes(memory.drain_as_bytes() or b"")
        finally:
            stream.disconnect()
