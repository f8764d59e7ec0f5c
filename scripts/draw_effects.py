"""Draw what each effect does to a sweep: docs/pictures/effects/, one SVG each, and their numbers.

    python scripts/draw_effects.py

DemoBot goes along x and back, plain and with the effect at its expected size; drawn is what its
sensors then read otherwise. A test compares :func:`numbers` with what was written.
"""

from __future__ import annotations

import io
import json
import re
import sys
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from seecr import Commands, Effect, Readings, Robot, load_robot, model_path, predict
from seecr.effects import BUILT_IN, layout_of
from seecr.pose import Array, quat_conjugate, quat_multiply, rotvec_from_quat

FOLDER = Path(__file__).resolve().parents[1] / "docs" / "pictures" / "effects"
NUMBERS = FOLDER / "numbers.json"
# what a good tracker would not see is drawn for the robot that tilts, or else ten times as large
TRIES = (("demobot_cogiro", 1.0), ("demobot_parallel", 1.0), ("demobot_parallel", 10.0))
VISIBLE_M, VISIBLE_RAD = 3e-5, np.radians(0.02)
COUNT, STEP_S, COLDEST_C, WARMEST_C = 41, 30.0, 15.0, 25.0
# of Okabe and Ito, told apart by the colour-blind; dashes tell them apart in grey
STYLES = (("#0072B2", "-"), ("#D55E00", (0, (5, 1.5))), ("#000000", (0, (1, 1))))


@dataclass(frozen=True, eq=False)
class Change:
    """What an effect does to a sweep.

    Attributes:
        effect: with its values. robot: name of the robot that was swept.
        times: how many expected sizes large.
        x: (n,) [m] commanded, there and back.
        position: (n, 3) [m]; rotation: (n, 3) [rad]; tensions: (n, m) [N]; with less without it.
    """

    effect: Effect
    robot: str
    times: float
    x: Array
    position: Array
    rotation: Array
    tensions: Array

    @property
    def largest(self) -> tuple[float, float, float]:
        """Largest change of position [m], orientation [rad] and of a tension [N]."""
        lengths = [np.linalg.norm(part, axis=1).max() for part in (self.position, self.rotation)]
        return float(lengths[0]), float(lengths[1]), float(np.abs(self.tensions).max())


def sweep() -> Commands:
    """Along x and back at y = 0.25 m, z = 0.1 m, one row every 30 s, getting warmer."""
    x = np.linspace(0.2, 0.6, COUNT)
    x = np.concatenate([x, x[-2::-1]])
    pose = np.zeros((len(x), 7))
    pose[:, 0], pose[:, 1], pose[:, 2], pose[:, 3] = x, 0.25, 0.1, 1.0
    warm = np.linspace(COLDEST_C, WARMEST_C, len(x))
    run = np.zeros(len(x), dtype=np.int64)
    return Commands(pose, run=run, time=STEP_S * np.arange(float(len(x))), temperature=warm)


@cache
def plain(robot: str) -> tuple[Robot, Readings]:
    """A robot, and what its sensors read of the sweep without any effect."""
    machine = load_robot(model_path(robot))
    return machine, predict(machine, sweep()).readings


def sized(kind: type[Effect], robot: Robot, times: float) -> Effect:
    """An effect at so many expected sizes; where it has several values their signs differ."""
    layout = layout_of(kind, robot)
    signs = np.where(np.random.default_rng(1).random(len(layout)) < 0.5, -1.0, 1.0)
    if not layout.groups:
        signs[:] = 1.0
    values = layout.null + signs * times * layout.scale
    values = np.where(values < layout.lower, layout.null + times * layout.scale, values)
    return layout.build(np.where(layout.shape, layout.null, np.minimum(values, layout.upper)))


def change(kind: type[Effect]) -> Change:
    """What an effect does, where it shows."""
    for robot, times in TRIES:
        found = _change(kind, robot, times)
        far, turned, _ = found.largest
        if far > VISIBLE_M or turned > VISIBLE_RAD or "tensions" in kind.needs:
            break
    return found


def _change(kind: type[Effect], robot: str, times: float) -> Change:
    machine, before = plain(robot)
    effect = sized(kind, machine, times)
    after = predict(machine, sweep(), [effect]).readings
    turn = quat_multiply(after.quat_wxyz, quat_conjugate(before.quat_wxyz))
    moved = after.position - before.position
    pulled = after.tensions - before.tensions
    x = sweep().pose[:, 0]
    return Change(effect, robot, times, x, moved, rotvec_from_quat(turn), pulled)


def numbers() -> dict[str, dict[str, float | str]]:
    """Of each effect: the robot, and the largest change that is drawn."""
    out: dict[str, dict[str, float | str]] = {}
    for kind in BUILT_IN:
        found = change(kind)
        far, turned, pulled = found.largest
        out[kind.name] = {"robot": found.robot, "times": found.times}
        if "tensions" in kind.needs:
            out[kind.name]["tension_N"] = float(f"{pulled:.4g}")
        else:
            out[kind.name]["position_mm"] = float(f"{1e3 * far:.4g}")
            out[kind.name]["orientation_deg"] = float(f"{np.degrees(turned):.4g}")
    return out


def picture(found: Change) -> str:
    """The change as SVG: position and orientation against x, or tensions where only they change."""
    # texts stay texts: smaller, and found by a search
    matplotlib.rcParams.update({
        "svg.hashsalt": found.effect.name, "svg.fonttype": "none", "font.sans-serif": "DejaVu Sans"
    })  # fmt: skip
    pulls = "tensions" in found.effect.needs
    figure = Figure(figsize=(6.6, 2.1), layout="constrained")
    if pulls:
        axes = figure.subplots()
        names = [f"cable {i + 1}" for i in range(3)]
        _draw(axes, found.x, found.tensions[:, :3], names, "tension [N]")
    else:
        left, right = figure.subplots(1, 2)
        _draw(left, found.x, 1e3 * found.position, list("xyz"), "position [mm]")
        turned = np.degrees(found.rotation)
        _draw(right, found.x, turned, ["about x", "about y", "about z"], "orientation [deg]")
    out = io.StringIO()
    figure.savefig(out, format="svg", metadata={"Date": None, "Creator": None})
    # numbers of the axes stand between the tags and are kept
    text = re.sub(r"<[^>]*>", lambda tag: _rounded(tag[0]), out.getvalue())
    return _named(re.sub(r' transform="rotate\(-0 [^"]*"', "", text), found.effect.name)


def _rounded(tag: str) -> str:
    """A tag whose places have two digits: a hundredth of a point is finer than any screen."""
    return re.sub(r"(\d\.\d\d)\d+", r"\1", tag)


def _named(svg: str, effect: str) -> str:
    """The SVG with its clips and markers numbered: Matplotlib's names change with rounding."""
    names = dict.fromkeys(re.findall(r' id="([pmC][0-9a-f]{10})"', svg))
    for k, name in enumerate(names):
        svg = svg.replace(name, f"{effect}-{k + 1}")
    return svg


def _draw(axes: Axes, x: Array, values: Array, names: list[str], label: str) -> None:
    there, back = slice(None, COUNT), slice(COUNT - 1, None)
    span = max(float(np.ptp(values)), float(np.abs(values).max()), 1e-4)
    differs = np.abs(values[there] - values[back][::-1]).max() > 0.02 * span
    for k, (name, (colour, dashes)) in enumerate(zip(names, STYLES, strict=True)):
        axes.plot(x[there], values[there, k], color=colour, ls=dashes, lw=1.6, label=name)
        if differs:
            axes.plot(x[back], values[back, k], color=colour, ls=dashes, lw=0.7, marker="<", ms=2.5,
                      markevery=8)  # fmt: skip
    axes.axhline(0.0, color="#888888", lw=0.6)
    # what is mere rounding is drawn as the line that it is
    if np.abs(values).max() < 1e-4:
        axes.set_ylim(-0.01, 0.01)
    axes.set(xlabel="commanded x [m]", ylabel=f"change of {label}")
    axes.xaxis.label.set_fontsize(8)
    axes.yaxis.label.set_fontsize(8)
    axes.tick_params(labelsize=8)
    axes.legend(fontsize=7, frameon=False, ncols=3, loc="best")
    axes.spines[["top", "right"]].set_visible(False)
    axes.margins(y=0.25)


if __name__ == "__main__":
    FOLDER.mkdir(parents=True, exist_ok=True)
    texts = {f"{kind.name}.svg": picture(change(kind)) for kind in BUILT_IN}
    texts[NUMBERS.name] = json.dumps(numbers(), indent=1) + "\n"
    for name, text in texts.items():
        part = FOLDER / f"{name}.part"
        part.write_text(text, encoding="utf-8")
        part.replace(FOLDER / name)
    sys.stdout.write(f"{FOLDER.name}: {len(texts) - 1} pictures\n")
