"""What schemes of control would do on the paper's robots: tables and figure of docs/paper.md.

python scripts/paper_control.py            figure and tables, and what a calibration is worth
python scripts/paper_control.py --sweeps   without the twins, which take most of the time
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from make_paper import PAGE, PICTURES, robot, with_table

import crosscheck
import seecr
from crosscheck.twin.hidden import choose
from seecr.description.mjcf import CABLES
from seecr.pose import Array
from seecr.show.colours import COLOURS
from seecr.show.figures import figure

LOOP = "elastic+pose_feedback"
SCHEMES = ("geometric", "elastic", "pose_feedback", LOOP, "stiffness", "tension_feedback")
# Those whose errors no others share: they distribute tensions otherwise, and positions alike.
_DRAWN = 4
# A pose counts as kept within this: a tenth of what the paper's authors saw [m], [rad].
KEPT_M, KEPT_RAD = 1e-3, np.radians(1.0)
POSES, STEPS, HIGHEST = 24, 100, 5.0
FIRST = "elastic, position first"
HEAD = f"| robot, cable | z | {' | '.join((*SCHEMES, FIRST))} |"
ERROR_HEAD = (
    "| what the controller does not know | geometric | elastic | elastic+pose_feedback | "
    "steps | spectral radius | largest gain |"
)
# One or two of each kind of effect; sizes are drawn as for twins.
KINDS = (
    "cable_length_offset", "initial_pose_error", "drum_gain", "pulley_radius", "exit_point_error",
    "stiffness", "hysteresis", "platform_mass", "centre_of_mass", "tracker_frame",
)  # fmt: skip
TWINS = range(1, 11)
# What they may hide: what moves the platform in the base frame, which a tracker's errors do not.
HIDDEN = (
    "cable_length_offset", "initial_pose_error", "drum_gain", "length_scale", "drum_eccentricity",
    "pulley_radius", "exit_point_error", "anchor_point_error", "stiffness", "cable_stiffness",
    "winch_side_length", "cable_weight", "frame_compliance", "platform_mass", "centre_of_mass",
    "external_wrench", "gravity_tilt",
)  # fmt: skip
TWIN_HEAD = (
    "| twin | hides | found | elastic: plain | diagnosed | its band | true | feedback: plain | "
    "readings | diagnosed | readings |"
)


def line(z: float, ends: tuple[float, float] = (0.17, 0.63)) -> Array:
    """The paper's trajectory: level, x between the ends."""
    poses = np.tile(robot("demobot_cogiro").reference_pose, (POSES, 1))
    poses[:, 0], poses[:, 1], poses[:, 2] = np.linspace(*ends, POSES), 0.25, z
    return poses


@cache
def swept(name: str, cable: str, z: float) -> Any:
    """All schemes on the trajectory, with a controller that knows the robot exactly."""
    given: dict[str, Any] = {"steps": STEPS, "highest": HIGHEST}
    one = robot(name, CABLES[cable])
    found = dict(seecr.control(one, line(z), scheme=SCHEMES, **given).schemes)
    first = seecr.control(one, line(z), scheme="elastic", prefer="position", **given)
    return {**found, FIRST: first["elastic"]}


def sweep_rows() -> Iterator[tuple[str, ...]]:
    """How many poses are kept on the line, and the worst of the others."""
    for name in ("demobot_cogiro", "demobot_parallel"):
        for cable in ("vectran", "fishing"):
            for z in (0.1, 0.2):
                found = swept(name, cable, z)
                cells = map(_kept, found.values())
                yield (f"{name.removeprefix('demobot_')}, {cable}", f"{z} m", *cells)


def _kept(one: Any) -> str:
    off = one.solution.deviation
    away, turned = (np.linalg.norm(off[:, part], axis=1) for part in (slice(3), slice(3, 6)))
    kept = (away < KEPT_M) & (turned < KEPT_RAD) & one.settled
    # what does not settle swings on, elsewhere on every machine
    worst = f"{_mm(away[one.settled].max())}, {_deg(turned[one.settled].max())}"
    lost = int(np.sum(~one.settled))
    return f"{kept.sum()} of {POSES}; {worst}" + (f"; {lost} do not settle" if lost else "")


def _mm(size: float) -> str:
    return "0 mm" if size < 5e-9 else f"{1e3 * size:.2g} mm"


def _deg(size: float) -> str:
    return "0°" if size < 1e-7 else f"{np.degrees(size):.2g}°"


def error_rows() -> Iterator[tuple[str, ...]]:
    """Effects that the controller does not know, where the parallel robot can be held."""
    one = robot("demobot_parallel")
    poses = line(0.1, (0.33, 0.47))
    for kind in KINDS:
        random = np.random.default_rng([1, *kind.encode()])
        true = choose(one, random, [kind])
        given: dict[str, Any] = {
            "steps": STEPS,
            "true": true,
            "scheme": ("geometric", "elastic", LOOP),
        }
        found: Any = seecr.control(one, poses if kind != "hysteresis" else poses[::4], **given)
        loop = found[LOOP]
        steps = (
            f"{loop.steps.max()}"
            if loop.settled.all()
            else f"{loop.settled.sum()} of {len(loop)} settle"
        )
        rms = (
            f"{_mm(one.position_rms)}, {_deg(one.orientation_rms)}" if one.settled.all() else "–"
            for one in found.schemes.values()
        )
        known = np.isfinite(loop.radius)
        radius, gain = (
            f"{one:.3f}" if np.isfinite(one) else "none"
            for one in (np.max(loop.radius[known]), np.min(loop.gain[known]))
        )
        yield (f"`{kind}`", *rms, steps, radius, gain)


def twin_rows(seeds: Sequence[int] = TWINS) -> Iterator[tuple[str, ...]]:
    """What a diagnosis is worth in control: Cogiro twins with two effects each, measured once."""
    one, path = robot("demobot_cogiro"), seecr.model_path("demobot_cogiro")
    for seed in seeds:
        names = np.random.default_rng(seed).choice(HIDDEN, 2, replace=False).tolist()
        twin = crosscheck.make_twin(path, seed, effects=names)
        found = crosscheck.diagnose(path, twin.measured)
        hides = ", ".join(f"`{name}`" for name in names)
        said = ", ".join(f"`{item.effect}`" for item in found.missing) or "nothing"
        if found.model is None:
            yield str(seed), hides, str(found.verdict), *8 * ("",)
            continue
        yield str(seed), hides, said, *_worth(one, list(twin.hidden), found.model)
        print(f"twin {seed}", flush=True)


def _worth(one: seecr.Robot, true: list[Any], model: seecr.Model) -> Iterator[str]:
    """Errors in the base frame with the plain, the diagnosed and the true model; readings."""
    poses = line(0.15, (0.25, 0.55))[::3]
    found: dict[str, Any] = {
        name: seecr.control(
            one, poses, scheme=("elastic", LOOP), believes=known, true=true, steps=40
        )
        for name, known in (("plain", ()), ("diagnosed", model), ("true", true))
    }
    spread = seecr.spread_of(one, found["diagnosed"]["elastic"].commands(), model)
    for name in found:
        yield _mm(found[name]["elastic"].position_rms)
        if name == "diagnosed":
            yield "" if spread is None else f"± {_mm(_rms(spread.position))}"
    goal = float(found["diagnosed"]["elastic"].position_rms)
    for name in ("plain", "diagnosed"):
        loop = found[name][LOOP]
        rms = np.array([_rms(step) for step in loop.history[:, :, :3]])
        # a loop begins where elastic is: as good but for rounding is as good
        better = np.flatnonzero(rms <= goal * (1.0 + 1e-6))
        yield _mm(loop.position_rms)
        yield str(better[0]) if len(better) else "none"


def _rms(errors: Array) -> float:
    """Of distances (n, 3), infinite where some are not known."""
    size = np.sum(errors**2, axis=1)
    return float(np.sqrt(np.mean(size))) if np.isfinite(size).all() else np.inf


def draw(path: Path) -> None:
    """Errors of the parallel robot along the trajectory, and where it can be held."""
    found = swept("demobot_parallel", "vectran", 0.1)
    x = 1e3 * line(0.1)[:, 0]
    held = seecr.correct(robot("demobot_parallel"), line(0.1), highest=HIGHEST).held
    with figure(path, 2, 1, sharex=True, figsize=(7.4, 4.6)) as axes:
        for ax, part, size, what in (
            (axes[0, 0], slice(0, 3), 1e3, "from the line [mm]"),
            (axes[1, 0], slice(3, 6), np.degrees(1.0), "tilt [°]"),
        ):
            ax.axvspan(*x[held][[0, -1]], color="0.92", label="static-feasible")
            for k, name in enumerate((*SCHEMES[:_DRAWN], FIRST)):
                one = found[name]
                off = size * np.linalg.norm(one.solution.deviation[:, part], axis=1)
                done = one.settled
                look = {"color": COLOURS[k], "linewidth": 1.3, "label": name}
                ax.plot(x, np.maximum(off, 1e-5), ("-", "-", "-", ":", "--")[k], **look)
                ax.plot(x[done], np.maximum(off[done], 1e-5), "o", markersize=3, color=COLOURS[k])
                ax.plot(x[~done], off[~done], "x", markersize=4, color=COLOURS[k])
            ax.set_yscale("log")
            ax.set_ylabel(what)
        axes[0, 0].legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8)
        axes[0, 0].set_title("parallel, Vectran, z = 0.1 m; x: the loop does not settle")
        axes[1, 0].set_xlabel("wanted x [mm]")


def main(twins: bool) -> None:
    """Write the figure, and the tables into the page."""
    draw(PICTURES / "control.png")
    page = PAGE.read_text(encoding="utf-8")
    page = with_table(page, "control", HEAD, sweep_rows())
    page = with_table(page, "control errors", ERROR_HEAD, error_rows())
    if twins:
        page = with_table(page, "control twins", TWIN_HEAD, list(twin_rows()))
    PAGE.write_text(page, encoding="utf-8")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="What schemes of control would do.")
    parser.add_argument("--sweeps", action="store_true", help="without the twins")
    main(not parser.parse_args().sweeps)
