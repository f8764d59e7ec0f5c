"""Remake the paper's figures, and the table of numbers in docs/paper.md.

    python scripts/make_paper.py            pictures and table
    python scripts/make_paper.py --numbers  the table alone

A test runs :func:`with_table` and goes red where the page is out of date.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from paper_search import METHODS, search
from paper_stiffness import HEAD, stiffness_rows

from seecr.description.mjcf import CABLES, load_robot, model_path
from seecr.description.robot import Robot
from seecr.equilibrium.solving import solve
from seecr.pose import Array, transform_points
from seecr.show.colours import COLOURS
from seecr.show.figures import figure
from seecr.statics.solution import Solution
from seecr.workspace.margins import slack_zones, tension_margin
from seecr.workspace.planar import bar_equilibria, bar_tilt, midline_point, solution_manifold

ROOT = Path(__file__).resolve().parents[1]
PAGE, PICTURES = ROOT / "docs" / "paper.md", ROOT / "docs" / "pictures" / "paper"
_HEAD = "| figure | what | paper | here |"
_COUNTS_HEAD = "| robot | method | fewest | median | most | left unbalanced |"
# Unbalanced force over the weight beyond which a search has not found a rest.
_BALANCED = 1e-6
# One and two pairs of slack cables, as the paper colours them.
_ZONES = {1: "#F0E442", 2: "#E69F00", 4: "#D55E00"}
# The ends of its sweep [m], and what its text says was measured there: along z [mm], tilt [deg].
ENDS, SUNK, TILTED = (0.17, 0.63), -15.0, 20.0
_SAID, _PIECE = "parallel, measured at the ends", np.array([-0.015, 0.015])
# Figure 9: a level platform at these x [m].
LEVEL = (("planar_horizontal", 0.25), ("planar_vertical", 0.4), ("planar_vertical", 0.25))
EXITS, HALF = np.array([[0.0, 1.0], [1.0, 1.0]]), 0.1


@cache
def robot(name: str, ea: float = CABLES["vectran"]) -> Robot:
    one = load_robot(model_path(name))
    return replace(one, ea=np.full(one.n_cables, ea))


@cache
def sweep(name: str, z: float, ea: float = CABLES["vectran"], n: int = 93) -> Solution:
    """The paper's trajectory, x from 0.17 to 0.63 m."""
    one = robot(name, ea)
    poses = np.tile(one.reference_pose, (n, 1))
    poses[:, 0], poses[:, 2] = np.linspace(0.17, 0.63, n), z
    return solve(one, poses)


@cache
def drift(x: float, z: float) -> tuple[Array, Array]:
    """k_c from stiff to soft, and where the level bar commanded to x, z rests: x, z, tilt."""
    stiffness = np.geomspace(1e5, 12.0, 60)
    rests = []
    for ea in stiffness:
        one = robot("planar_two_cable", float(ea))
        pose = solve(one, [[x, 0, z, 1, 0, 0, 0]])
        rests.append([*pose.pose[0, [0, 2]], -pose.deviation[0, 4]])
    return stiffness, np.array(rests)


def tilt(solution: Solution) -> Array:
    """About y [deg], the paper's sense in planar figures is the other way round."""
    return np.degrees(solution.deviation[:, 4])


def nothing(value: float, unit: str) -> str:
    """What is rounding, on any machine, or the number."""
    return f"below 10⁻⁹{unit}" if abs(value) < 1e-9 else f"{value:.2g}{unit}"


def width(name: str, z: float, count: int) -> float:
    """Width [mm] of the zone left of the middle with so many slack cables."""
    found = sweep(name, z, n=4601)
    x = found.command[:, 0]
    left = (found.slack.sum(axis=1) == count) & (x < 0.4)
    return 1e3 * float(np.sum(left)) * float(x[1] - x[0])


def figure_3(path: Path) -> None:
    x, y = np.linspace(0.06, 0.94, 89), np.linspace(0.0, 0.96, 97)
    with figure(path, 1, 2, figsize=(9.5, 4.0), sharey=True) as axes:
        for ax, h in zip(axes[0], (0.0, HALF), strict=True):
            angles = np.degrees(solution_manifold(EXITS, x, y, h))
            shown = ax.contourf(x, y, angles, levels=np.arange(-90, 91, 10), cmap="RdBu")
            ax.set_title(f"tilt of a bar of half length {1e3 * h:.0f} mm")
            ax.set_xlabel("x [m]")
            for place in ((0.2, 0.3), (0.3, 0.6), (0.5, 0.45)):
                ax.plot(*place, "o", color="black", markersize=3.5, label="commanded", zorder=4)
                if h:
                    _drift(ax, place)
        _legend(axes[0, 1], loc="lower right", frameon=True, framealpha=0.9)
        axes[0, 0].set_ylabel("y [m]")
        axes[0, 0].figure.colorbar(shown, ax=list(axes[0]), label="tilt θ [°]")


def _legend(ax: Any, **more: Any) -> None:
    """Each name once."""
    handles, labels = ax.get_legend_handles_labels()
    named = dict(zip(labels, handles, strict=True))
    ax.legend(named.values(), named, fontsize=8, **more)


def _drift(ax: Any, place: tuple[float, float]) -> None:
    """Where cables bring the level bar from there, from stiff to soft, with k_c at both ends."""
    stiffness, rests = drift(*place)
    start = np.array([place, rests[0, :2]])
    ax.plot(start[:, 0], start[:, 1], ":", color="black", linewidth=1.0)
    ax.plot(rests[:, 0], rests[:, 1], color="black", linewidth=1.4)
    look: dict[str, Any] = {"color": "white", "markeredgecolor": "black", "linestyle": ""}
    for k, word, mark in ((0, "stiff", "s"), (-1, "soft", "v")):
        said = f"at rest, {word}: k_c = {stiffness[k]:,.0f} N"
        ax.plot(*rests[k, :2], mark, markersize=6, label=said, **look)


def figure_4(path: Path) -> None:
    one = robot("planar_two_cable", 100.0)
    x = np.linspace(0.15, 0.85, 15)
    with figure(path, 1, 2, figsize=(9.5, 3.6)) as axes:
        place, angle = axes[0]
        for k, z in enumerate((0.2, 0.5, 0.75)):
            poses = np.tile(one.reference_pose, (len(x), 1))
            poses[:, 0], poses[:, 2] = x, z
            found = solve(one, poses)
            colour = COLOURS[k]
            place.plot(x, np.full_like(x, z), "+", color=colour)
            place.plot(found.pose[:, 0], found.pose[:, 2], "o-", color=colour, markersize=3)
            at_command = np.degrees(bar_tilt(EXITS, np.column_stack([x, np.full_like(x, z)]), HALF))
            angle.plot(x, at_command, "--", color=colour)
            angle.plot(found.pose[:, 0], -tilt(found), "o-", color=colour, markersize=3,
                       label=f"commanded y = {z:g} m")  # fmt: skip
        place.set(xlabel="x [m]", ylabel="y [m]", title="+ commanded, ● at rest (k_c = 100 N)")
        place.set_ylim(0.0, 0.8)
        angle.set(xlabel="x [m]", ylabel="tilt θ [°]", title="- - at the command, ● at rest")
        angle.legend(fontsize=8)


def _zones(ax: Any, x: Array, solution: Solution) -> None:
    edges = np.concatenate([[x[0]], 0.5 * (x[1:] + x[:-1]), [x[-1]]])
    said = set[int]()
    for zone in slack_zones(solution):
        if zone.slack in _ZONES:
            label = None if zone.slack in said else f"{zone.slack} slack"
            said.add(zone.slack)
            ax.axvspan(
                edges[zone.first], edges[zone.last + 1], color=_ZONES[zone.slack], alpha=0.3, lw=0,
                label=label,
            )  # fmt: skip


def _along(path: Path, name: str, z: float, workspace: bool, tops: tuple[str, ...] = ()) -> None:
    """Platform poses at rest with the cables that pull; tensions along the sweep."""
    one, found = robot(name), sweep(name, z)
    x = found.command[:, 0]
    with figure(path, 1, 2, figsize=(11.4, 3.9)) as axes:
        left, right = axes[0]
        if workspace:
            _feasible(left, one)
        for k in np.linspace(0, len(found) - 1, 7).astype(int):
            ends = transform_points(found.pose[k], one.anchor_points)
            for exit_point, end, slack in zip(one.exit_points, ends, found.slack[k], strict=True):
                way = np.array([exit_point, end])
                colour, style = ("0.75", ":") if slack else (COLOURS[0], "-")
                left.plot(way[:, 0], way[:, 2], style, lw=0.6, color=colour)
            half = np.maximum(np.ptp(one.anchor_points, axis=0)[[0, 2]] / 2, 0.018)
            corners = half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]])
            box = np.column_stack([corners[:, 0], 0 * corners[:, 0], corners[:, 1]])
            edge = transform_points(found.pose[k], box)
            left.fill(edge[:, 0], edge[:, 2], color=COLOURS[1], alpha=0.9, lw=0)
            left.plot(found.command[k, 0], z, "+", color="black", markersize=5)
            for _ in tops:
                point = midline_point(one.exit_points[:, [0, 2]], ends[:, [0, 2]])
                left.plot(*point, "x", color=COLOURS[4], markersize=5)
        left.set(xlabel="x [m]", ylabel="z [m]", aspect="equal", ylim=(0.0, 0.52))
        shown = ["at rest", "+ commanded", *(f"× point {name}" for name in tops)]
        left.set_title("; ".join([*shown, "green: can be held"] if workspace else shown))
        _zones(right, x, found)
        names: dict[str, str] = {}
        for k, cable in enumerate(one.cable_names):
            same = next((n for n in names if np.allclose(found.tensions[:, int(n)],
                        found.tensions[:, k], atol=1e-6)), str(k))  # fmt: skip
            names[same] = f"{names[same]}, {cable[5:]}" if same in names else cable
        for i, (k, label) in enumerate(names.items()):
            right.plot(x, found.tensions[:, int(k)], color=COLOURS[i], label=label)
        right.set(xlabel="commanded x [m]", ylabel="tension [N]")
        right.legend(fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))


def figure_9(path: Path) -> None:
    """Why the horizontal arrangement stays level and the vertical one tilts."""
    with figure(path, 1, 3, figsize=(12.0, 3.0), sharey=True) as axes:
        for ax, (name, x) in zip(axes[0], LEVEL, strict=True):
            _midlines(ax, robot(name), x)
        axes[0, 0].set_ylabel("z [m]")
        _legend(axes[0, 2], loc="center left", bbox_to_anchor=(1.0, 0.5))


def _midlines(ax: Any, one: Robot, x: float) -> None:
    """The level platform there, its cables with their midlines, and the line of its weight."""
    ends = one.anchor_points[:, [0, 2]] + [x, 0.2]
    exits = one.exit_points[:, [0, 2]]
    for way in np.stack([exits, ends], axis=1):
        ax.plot(*way.T, lw=1.2, color=COLOURS[0], label="cables")
    ax.fill_between([ends[:, 0].min(), ends[:, 0].max()], 0.182, 0.218, color=COLOURS[1], lw=0)
    met = midline_point(exits, ends)
    for pair in (slice(0, 2), slice(2, 4)):
        middles = np.array([exits[pair].mean(axis=0), ends[pair].mean(axis=0), met])
        ax.plot(*middles.T, "--", lw=1.0, color=COLOURS[4], label="midlines of parallel cables")
    ax.plot(*met, "x", color=COLOURS[4], markersize=7, mew=2, zorder=5, label="where they meet")
    ax.plot([x, x], [0.05, 0.3], ":", color="black", label="line of the weight")
    ax.plot(x, 0.2, "o", color="black", markersize=3.5, label="centre of mass")
    point, off = ("V" if "vertical" in one.name else "H"), 1e3 * (met[0] - x)
    side = "right" if off > 0.0 else "left"
    where = "on" if abs(off) < 1e-6 else f"{abs(off):.0f} mm {side} of"
    ax.set_title(f"{point} {where} the line of the weight", fontsize=9)
    ax.set(xlabel="x [m]", aspect="equal", xlim=(0.0, 0.8), ylim=(0.05, 0.52))


def _feasible(ax: Any, one: Robot) -> None:
    """The static-feasible workspace in the plane of the sweep, platform level."""
    x, z = np.linspace(0.05, 0.75, 141), np.linspace(0.0, 0.47, 95)
    grid = np.stack(np.meshgrid(x, z), axis=-1).reshape(-1, 2)
    poses = np.tile(one.reference_pose, (len(grid), 1))
    poses[:, 0], poses[:, 2] = grid.T
    margin = np.clip(tension_margin(one, poses), -1, 1).reshape(len(z), len(x))
    ax.contourf(x, z, margin, levels=[0.0, 2.0], colors=["#009E73"], alpha=0.25)


def figure_12(path: Path) -> None:
    with figure(path, 2, 2, figsize=(10, 5.6), sharex=True) as axes:
        for column, z in enumerate((0.1, 0.2)):
            for row, values in enumerate((lambda s: 1e3 * s.deviation[:, 2], tilt)):
                ax = axes[row, column]
                for k, name in enumerate(("cogiro", "parallel")):
                    for style, (cable, ea) in zip(("-", "--"), CABLES.items(), strict=True):
                        found = sweep(f"demobot_{name}", z, ea)
                        ax.plot(found.command[:, 0], values(found), style, color=COLOURS[k],
                                label=f"{name}, {cable}")  # fmt: skip
            axes[0, column].set_title(f"z = {z:g} m")
            for end, sign in zip(ENDS, (1, -1), strict=True):
                for ax, value in zip(axes[:, column], (SUNK, sign * TILTED), strict=True):
                    ax.plot(end + _PIECE, [value] * 2, color="black", lw=2.0, label=_SAID)
            axes[1, column].set_xlabel("commanded x [m]")
        axes[0, 0].set_ylabel("deviation along z [mm]")
        axes[1, 0].set_ylabel("rotation about y [°]")
        _legend(axes[1, 1])


FIGURES = {
    "figure-3": figure_3,
    "figure-4": figure_4,
    "figure-7": lambda path: _along(path, "planar_vertical", 0.2, False, ("V",)),
    "figure-8": lambda path: _along(path, "planar_horizontal", 0.2, False, ("H",)),
    "figure-9": figure_9,
    "figure-10": lambda path: _along(path, "demobot_cogiro", 0.1, True),
    "figure-11": lambda path: _along(path, "demobot_parallel", 0.1, True),
    "figure-12": figure_12,
}


def rows() -> Iterator[tuple[str, str, str, str]]:
    """Figure, what, the paper, ours."""
    yield from _two_cables()
    yield from _four_cables()
    yield from _eight_cables()


def _two_cables() -> Iterator[tuple[str, str, str, str]]:
    here = np.array([0.3, 0.5])
    limit, bar = (np.degrees(bar_tilt(EXITS, here, h)) for h in (0.0, HALF))
    yield (
        "3",
        "tilt at (0.3, 0.5) m, bar of no length / half length 0.1 m",
        "one value",
        (f"{limit:.2f}° / {bar:.2f}°"),
    )
    stable = [one.theta for one in bar_equilibria(EXITS, here, HALF)]
    yield "3", "equilibrium tilts there, stable or unstable", "unique", f"{len(stable)}"
    _, rests = drift(0.2, 0.3)
    yield (
        "3",
        "commanded (0.2, 0.3) m: equilibria for k_c from 10⁵ N to 12 N",
        ("lower and towards the middle"),
        f"({rests[0, 0]:.3f}, {rests[0, 1]:.3f}) to ({rests[-1, 0]:.3f}, {rests[-1, 1]:.3f}) m",
    )
    off = np.degrees(bar_tilt(EXITS, rests[:, :2], HALF)) - np.degrees(rests[:, 2])
    yield (
        "3",
        "that path lies on the manifold, to within",
        "yes",
        (nothing(np.abs(off).max(), "°")),
    )
    soft = solve(robot("planar_two_cable", 100.0), [[0.2, 0, 0.5, 1, 0, 0, 0]])
    at = np.degrees(bar_tilt(EXITS, [0.2, 0.5], HALF))
    yield (
        "4",
        "commanded (0.2, 0.5) m, k_c = 100 N: tilt at the command / at rest",
        ("differ; also a lateral motion"),
        f"{at:.1f}° / {-tilt(soft)[0]:.1f}°, {1e3 * soft.deviation[0, 0]:.0f} mm sideways",
    )


def _midlines_off(found: Solution) -> Array:
    """Sideways from the centre of mass to where the midlines meet, V or H (n,) [m]."""
    ends = transform_points(found.pose, found.robot.anchor_points)
    point = midline_point(found.robot.exit_points[:, [0, 2]], ends[..., [0, 2]])
    return np.asarray(point[:, 0] - found.pose[:, 0])


def _four_cables() -> Iterator[tuple[str, str, str, str]]:
    vertical, level = sweep("planar_vertical", 0.2), sweep("planar_horizontal", 0.2)
    x = vertical.command[:, 0]
    yield "7", "tilt at x = 0.17 m", "tilts", f"{tilt(vertical)[0]:.2f}°"
    yield (
        "7",
        "zones from the end: two slack, one slack",
        "both occur",
        " mm, ".join(f"{width('planar_vertical', 0.2, k):.0f}" for k in (2, 1)) + " mm wide",
    )
    off = [_midlines_off(found) for found in (vertical, level)]
    yield (
        "9",
        "point V off the line of the centre of mass, at x = 0.17 m / in the middle",
        ("off, and on its line"),
        " / ".join(f"{1e3 * off[0][i]:+.1f} mm" for i in (0, len(x) // 2)),
    )
    yield (
        "9",
        "point H off the line of the centre of mass, at most",
        "on it",
        nothing(np.abs(off[1]).max(), " m"),
    )
    yield (
        "8",
        "largest tilt of the horizontal arrangement",
        "none",
        (nothing(np.abs(tilt(level)).max(), "°")),
    )
    apart = np.abs(np.diff(level.tensions.reshape(-1, 2, 2), axis=2)).max()
    yield "8", "largest difference between the tensions on one side", "equal", nothing(apart, " N")


def _eight_cables() -> Iterator[tuple[str, str, str, str]]:
    for name, number in (("cogiro", "10"), ("parallel", "11")):
        found = sweep(f"demobot_{name}", 0.1)
        margin = tension_margin(robot(f"demobot_{name}"), found.command)
        yield (
            number,
            "level poses of the sweep at z = 0.1 m that can be held",
            ("all" if name == "cogiro" else "the middle"),
            f"{int((margin >= 0).sum())} of {len(margin)}",
        )
        yield (
            number,
            "largest tilt on that sweep",
            "little" if name == "cogiro" else "about 20°",
            (f"{np.abs(tilt(found)).max():.2f}°"),
        )
        if name == "parallel":
            yield (
                number,
                "zones from the end: four slack, two slack",
                "both occur",
                " mm, ".join(f"{width(f'demobot_{name}', 0.1, k):.0f}" for k in (4, 2))
                + " mm wide",
            )
    for z in (0.1, 0.2):
        ends = [sweep("demobot_parallel", z, ea) for ea in CABLES.values()]
        angles = " / ".join(f"{tilt(one)[0]:.2f}°" for one in ends)
        sunk = " / ".join(f"{1e3 * one.deviation[0, 2]:.1f} mm" for one in ends)
        yield (
            "12",
            f"parallel, x = 0.17 m, z = {z:g} m: tilt, Vectran / fishing line",
            ("measured about 20°"),
            angles,
        )
        yield "12", "… and deviation along z", "measured about −15 mm", sunk


@cache
def counts(every: int = 2) -> list[tuple[str, str, list[int], int, int]]:
    """Robot, method, evaluations at each pose of the sweeps, poses, and those left unbalanced.

    Both heights and both cables, every so many poses.
    """
    out = []
    for name in ("demobot_cogiro", "demobot_parallel"):
        sweeps = [sweep(name, z, ea) for z in (0.1, 0.2) for ea in CABLES.values()]
        for method in METHODS:
            found = [search(robot(name, float(one.robot.ea[0])), one.command[::every], method)
                     for one in sweeps]  # fmt: skip
            calls = [int(call) for one in found for call in one.calls]
            lost = sum(int((one.left > _BALANCED).sum()) for one in found)
            out.append((name, method, calls, len(calls), lost))
        ours = [int(call) for one in sweeps for call in one.iterations[::every]]
        lost = sum(int((~one.converged[::every]).sum()) for one in sweeps)
        out.append((name, "seecr", ours, len(ours), lost))
    return out


def count_rows() -> Iterator[tuple[str, ...]]:
    """Robot, method, fewest, median and most evaluations, poses that are left unbalanced."""
    for name, method, calls, n, lost in counts():
        yield (
            name, method, str(min(calls)), f"{np.median(calls):.0f}", str(max(calls)),
            f"{lost} of {n}",
        )  # fmt: skip


def with_table(
    page: str,
    name: str = "numbers",
    head: str = _HEAD,
    made: Iterable[tuple[str, ...]] | None = None,
) -> str:
    """The page with a table of numbers as computed now: by default that of the figures."""
    begin, end = f"<!-- {name} -->", f"<!-- end of {name} -->"
    before, _, rest = page.partition(begin)
    _, _, tail = rest.partition(end)
    lines = [head, "|" + "---|" * (head.count("|") - 1)]
    lines += ["| " + " | ".join(row) + " |" for row in (rows() if made is None else made)]
    return f"{before}{begin}\n" + "\n".join(lines) + f"\n{end}{tail}"


def main(numbers: bool) -> None:
    """Write the pictures, and the tables into the page; of ``numbers`` only the tables."""
    if not numbers:
        PICTURES.mkdir(parents=True, exist_ok=True)
        for name, draw in FIGURES.items():
            draw(PICTURES / f"{name}.png")
            print(f"{name}.png")
    page = with_table(PAGE.read_text(encoding="utf-8"))
    page = with_table(page, "counts", _COUNTS_HEAD, count_rows())
    page = with_table(page, "stiffness", HEAD, stiffness_rows(sweep))
    PAGE.write_text(page, encoding="utf-8")
    print(PAGE.name)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--numbers", action="store_true", help="the tables only")
    main(parser.parse_args().numbers)
