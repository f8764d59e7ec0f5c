"""Draw README's first picture: the error of a robot as each missing effect is added.

    python scripts/draw_fall.py

The robot is the MuJoCo twin of README's example. The numbers stand beside the picture in
`fall.json`, and a test holds them against the example's.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import crosscheck
import seecr
from seecr.pose import Array

PICTURE = Path(__file__).resolve().parents[1] / "docs" / "pictures" / "fall.png"
NUMBERS = PICTURE.with_suffix(".json")
ROBOT, SEED = "demobot_parallel", 13
# of Okabe and Ito, told apart by the colour-blind
COLOURS = ("#D55E00", "#0072B2", "#009E73")


def steps(
    robot: Path, measured: crosscheck.Measurements, found: crosscheck.Diagnosis
) -> dict[str, crosscheck.Comparison]:
    """The plain model, and the model after each effect in the order of adding, against the data."""
    out = {"plain SEECR": crosscheck.compare(robot, measured)}
    for k, one in enumerate(found.missing, start=1):
        fitted = crosscheck.add_effects(robot, measured, [m.term for m in found.missing[:k]])
        out[f"+ {one.effect}"] = crosscheck.compare(robot, measured, fitted.terms)
    return out


def numbers(ways: dict[str, crosscheck.Comparison]) -> dict[str, Any]:
    """The rms errors that are drawn: of the models, and of noise alone."""
    last = list(ways.values())[-1]
    return {name: _rms(one.rms) for name, one in ways.items()} | {"noise alone": _rms(last.floor)}


def _rms(errors: Any) -> dict[str, float]:
    position, turned = errors["position_rms_m"], errors["orientation_rms_rad"]
    return {
        "position_mm": float(f"{1e3 * position:.3g}"),
        "orientation_deg": float(f"{np.degrees(turned):.3g}"),
    }


def figure(ways: dict[str, crosscheck.Comparison]) -> Figure:
    """Rms errors of each row, model beside model, falling to the noise; shown 830 pixels wide."""
    drawn = Figure(figsize=(8.3, 3.4), layout="constrained")
    left, right = drawn.subplots(1, 2)
    _draw(left, ways, "position", 1e3, "mm")
    _draw(right, ways, "orientation", float(np.degrees(1.0)), "deg")
    return drawn


def _draw(
    axes: Axes, ways: dict[str, crosscheck.Comparison], kind: str, factor: float, unit: str
) -> None:
    said = numbers(ways)
    axes.set_yscale("log")
    for k, (one, colour) in enumerate(zip(ways.values(), COLOURS, strict=False)):
        # of the three components, as the numbers and the noise are
        errors: Array = factor * one.errors_of(kind) / np.sqrt(3.0)
        axes.plot(k + np.linspace(-0.36, 0.36, len(errors)), errors, ".", color=colour, ms=4)
    values = [said[name][f"{kind}_{unit}"] for name in ways]
    axes.set_xticks(range(len(ways)), [
        f"{name}\n{value:#.2g} {unit}" for name, value in zip(ways, values, strict=True)
    ], fontsize=10)  # fmt: skip
    for tick, colour in zip(axes.get_xticklabels(), COLOURS, strict=False):
        tick.set_color(colour)
    floor = said["noise alone"][f"{kind}_{unit}"]
    axes.axhspan(1e-9, floor, color="#e5e7eb", zorder=0)
    axes.text(-0.42, floor * 0.93, "noise", color="#4b5563", va="top", fontsize=10)
    axes.set_ylim(0.08 * floor, None)
    axes.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.set_title(f"rms {kind} error of each pose [{unit}]", fontsize=11, loc="left")
    axes.spines[["top", "right"]].set_visible(False)


if __name__ == "__main__":
    path = seecr.model_path(ROBOT)
    data = crosscheck.make_twin(path, seed=SEED).measured
    fall = steps(path, data, crosscheck.diagnose(path, data))
    part = PICTURE.with_suffix(".part.png")
    figure(fall).savefig(part, dpi=200)
    part.replace(PICTURE)
    NUMBERS.write_text(json.dumps(numbers(fall), indent=1) + "\n", encoding="utf-8")
    sys.stdout.write(f"{PICTURE.name}: {len(fall)} models\n")
