"""The strip under the 3D view that says what its colours mean."""

from __future__ import annotations

import numpy as np
import rerun as rr

from crosscheck.recording import colours
from crosscheck.recording.stream import Recording

ROOT = "legend"
_SLICES = 48
# The strip is 100 wide and 10 high; y points down.
_BAR = (4.0, 44.0, 5.2)


def write_legend(recording: Recording, top: float) -> None:
    """The tension scale from 0 to ``top`` [N], and whose colour is whose."""
    left, right, y = _BAR
    x = np.linspace(left, right, _SLICES + 1)
    pieces = [np.array([[x[i], y], [x[i + 1], y]]) for i in range(_SLICES)]
    shades = colours.scale_colours(np.linspace(0.0, 1.0, _SLICES), 1.0)
    recording.always(f"{ROOT}/scale", rr.LineStrips2D(pieces, radii=0.9, colors=shades))
    ticks = np.linspace(0.0, 1.0, 3)
    _words(
        recording,
        "ticks",
        [(left + part * (right - left), y + 2.6) for part in ticks],
        [f"{part * top:g} N" for part in ticks],
        [colours.COMMAND] * 3,
    )
    places = [(56.0, y), (68.0, y), (79.0, y), (92.0, y)]
    names = ["slack", "command", "SEECR", "MuJoCo"]
    shades_of = [colours.SLACK, colours.COMMAND, colours.SEECR, colours.MUJOCO]
    for place, name, colour in zip(places, names, shades_of, strict=True):
        strips = [np.array([[place[0] - 2.5 + d, y], [place[0] - 1.5 + d, y]]) for d in (0, 2, 4)]
        dashed = strips if name == "slack" else [np.array([strips[0][0], strips[-1][1]])]
        radius = 0.25 if name == "slack" else 0.7
        line = rr.LineStrips2D(dashed, radii=radius, colors=colour)
        recording.always(f"{ROOT}/{name}", line)
    _words(recording, "names", [(px, y + 2.6) for px, _ in places], names, shades_of)


def _words(
    recording: Recording,
    name: str,
    places: list[tuple[float, float]],
    words: list[str],
    shades: list[colours.Rgba],
) -> None:
    points = rr.Points2D(places, radii=0.01, colors=shades, labels=words, show_labels=True)
    recording.always(f"{ROOT}/{name}", points)
