"""Figures, pages and recordings of results, as their own methods give them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from seecr.inverse.result import Correction
from seecr.show.map_figure import map_figure
from seecr.show.sweep_figure import sweep_figure
from seecr.statics.solution import Solution
from seecr.workspace.grid import Workspace


@dataclass(frozen=True)
class Pictures:
    """What draws a result of one class; None where it has no such picture.

    Attributes:
        plot: of a result and the name of a figure, "" for the first: a Matplotlib figure.
        page, recording: of a result and a path, where it is written.
    """

    plot: Callable[[Any, str], Any] | None = None
    page: Callable[[Any, Any], None] | None = None
    recording: Callable[[Any, Any], None] | None = None


def _commanded(found: Solution) -> bool:
    """Whether poses were commanded: of lengths that differ every command is the reference pose."""
    same, lengths = np.ptp(found.command, axis=0) == 0.0, np.ptp(found.rest_lengths, axis=0)
    return bool(not same.all() or not lengths.any())


def _record_sweep(found: Solution, path: Any) -> None:
    from seecr.show.sweep_recording import write_sweep_recording

    write_sweep_recording(found, path, _commanded(found))


def _record_map(found: Workspace, path: Any) -> None:
    from seecr.show.map_recording import write_map_recording

    write_map_recording(found, path)


PICTURES: Mapping[type, Pictures] = {
    Solution: Pictures(
        plot=lambda found, _name: sweep_figure(None, found, _commanded(found)),
        recording=_record_sweep,
    ),
    Correction: Pictures(
        plot=lambda found, _name: sweep_figure(None, found.solution, wanted=True),
        recording=lambda found, path: _record_sweep(found.solution, path),
    ),
    Workspace: Pictures(plot=lambda found, _name: map_figure(None, found), recording=_record_map),
}
"""By the class of result."""
