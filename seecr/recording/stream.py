"""One recording file: written beside its place, put there when complete."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import ArrayLike

from seecr.files import written
from seecr.pose import Array

POSE, SETTLING, MODEL_STEP = "pose", "settling_time", "model_step"


class Recording:
    """A recording being written; errors of the data raise instead of being logged.

    Attributes:
        stream: Rerun's.
    """

    def __init__(self, stream: rr.RecordingStream) -> None:
        self.stream = stream

    def always(self, entity: str, *archetypes: Any) -> None:
        """Something that holds at every time."""
        self.stream.log(entity, *archetypes, static=True, strict=True)

    def rows(self, entity: str, index: rr.TimeColumn, columns: Iterable[Any]) -> None:
        """Rows over a timeline, sent as columns: faster and smaller than row by row."""
        self.stream.send_columns(entity, [index], columns, strict=True)

    def scalars(self, entity: str, index: rr.TimeColumn, values: ArrayLike) -> None:
        """Numbers (n,) over a timeline, in double precision."""
        self.rows(entity, index, rr.Scalars.columns(scalars=np.asarray(values, dtype=float)))


def pose_index(count: int) -> rr.TimeColumn:
    """The timeline over poses, counted from 1 as in the text and the tables."""
    return rr.TimeColumn(POSE, sequence=range(1, count + 1))


def settling_index(t_s: Array) -> rr.TimeColumn:
    """The timeline over simulated time (k,) [s] of one settling."""
    return rr.TimeColumn(SETTLING, duration=[float(t) for t in t_s])


@contextmanager
def recording_file(path: str | Path, name: str, blueprint: rrb.Blueprint) -> Iterator[Recording]:
    """Write a recording; nothing is left at ``path`` unless all of it was written.

    Args:
        path: the ``.rrd`` file.
        name: what the viewer calls the recording; it is its identity too, so that a newer one of
            the same case takes its place in the viewer.
        blueprint: the layout, embedded.

    Raises:
        InputFileError: the file cannot be written.
    """
    stream = rr.RecordingStream(_application(name), recording_id=name)
    with written(Path(path), failure="cannot write the recording") as (partial,):
        try:
            partial.touch()  # Rerun reports a folder that cannot be written only in its log
            stream.save(partial, default_blueprint=blueprint)
            stream.send_recording_name(name)
            yield Recording(stream)
            stream.flush()
        finally:
            stream.disconnect()


def _application(name: str) -> str:
    """An application of its own for each recording, in letters that Rerun takes as they are.

    The viewer keeps one layout per application, and several recordings may be open together.
    """
    return "crosscheck-" + re.sub(r"[^A-Za-z0-9_-]", "-", name)
