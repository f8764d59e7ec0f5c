"""``seecr map``: workspaces on a grid."""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from seecr.cli import options
from seecr.cli.following import following
from seecr.cli.progress import executor_of, progress_bar, say_duration
from seecr.cli.results import files_of_pictures, made_by, untold

if TYPE_CHECKING:
    from seecr import Robot, StoredMap, Workspace


@options.command(
    "seecr map demobot_cogiro",
    "seecr map robot.xml --grid 0:0.8:81 0:0.5:51 0.1:0.3:3 --lowest 1 --highest 50",
    "seecr map robot.xml --model model.toml --lowest 1 --at-least 0.95",
    "seecr map demobot_cogiro --lowest 0.1 --edge 0.0001",
    "seecr map robot.xml --grid 0:0.8:800 0:0.5:500 0.1:0.3:200 --parts --out large",
    "seecr map robot.xml --wrench 1 0 0 0 0 0 --wrench -1 0 0 0 0 0 --model model.toml",
    cls=options.NumbersCommand,
)
@options.robot
@options.option(
    "--grid X Y Z",
    "Each FIRST:LAST:COUNT or one number [m]; of a robot in a plane oblique to x, y and z along "
    "the directions u, v and w that are printed.  [default: over the exit points, down to as far "
    "below the reference pose as they are above it, or to the floor of the MJCF]",
)
@options.turned("all poses")
@options.limits
@options.option(
    "--wrench FX FY FZ MX MY MZ",
    "External wrench [N, N m] under which the platform must be held, besides weight; may be "
    "repeated for a set. 0 0 0 0 0 0 is none, and is only in the set if it is given.",
    options.Number(),
    "wrenches",
    multiple=True,
)
@options.option(
    "--at-least P",
    "Also show where poses can be held with this probability, from the model's covariance.",
    options.Number(0.0, 1.0, min_open=True),
)
@options.option(
    "--edge M",
    "Also find the edge of the workspace, to this many metres, between poses of the grid.",
    options.Number(0.0, min_open=True),
    callback=options.check_finite,
)
@options.option("--no-elastic", "Only compute which poses can be held; faster.")
@options.option(
    "--parts",
    "Keep every pose in Parquet files in the folder parts of --out, for grids of any size. Called "
    "again, it computes only the parts that are missing. There is no figure, recording or map.npz.",
)
@options.scheduler
@options.pictures
@options.out("seecr-map")
@options.as_json
def command(
    robot: Path, cable: str | None, model: Path | None, grid: tuple[str, ...] | None,
    turned: tuple[float, ...] | None, lowest: float, highest: float | None,
    wrenches: tuple[tuple[float, ...], ...], at_least: float | None, edge: float | None,
    no_elastic: bool, parts: bool, scheduler: str | None, figure: str, no_recording: bool,
    out: Path, as_json: bool,
) -> int:  # fmt: skip
    """Show on a grid where tensions within limits hold the platform, and where it really comes to
    rest.

    ROBOT is an MJCF file or the name of a shipped robot. The margin is how far inside their limits
    all tensions can stay [N]. The elastic map gives at each command the platform's deviation and
    tilt, the number of slack cables, the stiffness and the softest direction. Robots with fewer
    cables than degrees of freedom are mapped by position, and their orientation is solved for;
    their margin is that of the best orientation found in which the platform stays. With --at-least
    and a calibrated model, each pose gets the probability that it can be held. The edge is that of
    the poses that can be held, or with --at-least of those held with that probability.

    Writes map.npz, map.json, a figure of slices and map.rrd; with --parts map.json, and the poses
    in the folder parts. Where the elastic robot is not at rest, status_names[status] of map.npz
    says why. The recording has the elastic map in further tabs, slice by slice on its timeline; of
    large grids it has some of the slices, and says which.

    \b
    Exit status: 0 all well, 2 bad input, or no pose of the grid can be held, 3 the elastic robot
    comes to rest nowhere on the grid.
    """  # fmt: skip
    import numpy as np

    from seecr import StoredMap, Workspace, boundary, default_axes, store_map, workspace_map
    from seecr.cli.arguments import axes_of, model_at, robot_at
    from seecr.columns.plausible import scalar_last
    from seecr.equilibrium.strange import strange
    from seecr.files import json_text, write_text
    from seecr.folders import staged
    from seecr.show.batch_words import (
        beyond_line,
        edge_line,
        likely_lines,
        sag_lines_of,
        softest_line,
    )  # fmt: skip
    from seecr.show.files import write_arrays
    from seecr.show.map_figure import map_figure
    from seecr.workspace.grid import own_directions
    from seecr.workspace.maps import MOST_POSES, MOST_STORED

    if parts and (edge is not None or at_least is not None):
        raise click.UsageError(
            "--parts keeps poses one part at a time, and --edge and --at-least need all of them; "
            "leave out --parts, or these"
        )
    machine = robot_at(robot, cable)
    own = model_at(model, machine)
    limit = (MOST_STORED, "") if parts else (MOST_POSES, "; with --parts it may have more")
    axes = (
        axes_of(grid, machine, own_directions(machine), *limit)
        if grid
        else list(default_axes(machine, None, turned or None))
    )
    total = math.prod(map(len, axes))
    asked: dict[str, Any] = {
        "lowest": lowest, "highest": np.inf if highest is None else highest,
        "wrenches": wrenches or None, "effects": own or (),
    }  # fmt: skip
    pictures, sometimes = files_of_pictures("map", figure, no_recording)
    made = made_by(machine.source, model)
    # a figure of few axes is not drawn
    names = {"map.json"} if parts else {"map.json", "map.npz", *(pictures & {"map.rrd"})}
    flat, places = sum(len(axis) > 1 for axis in axes) < 2, None
    with staged(out, names=names, sometimes={*sometimes, "map.npz"}, made=made) as folder:
        say_duration("map", total, "poses", as_json)
        with (
            executor_of(scheduler) as executor,
            progress_bar("mapping", total) as tell,
        ):
            compute: Any = partial(store_map, out=out) if parts else workspace_map
            found: StoredMap | Workspace = compute(
                machine, *axes, orientation=turned or None, elastic=not no_elastic,
                chance=at_least is not None, progress=lambda done: tell(done, ""),
                executor=executor, **asked,
            )  # fmt: skip
        told = found.as_json() if isinstance(found, StoredMap) else found.as_json(at_least)
        if told["feasible"] == 0:
            raise _holds_none(machine, total, asked["lowest"], asked["highest"])
        if edge is not None and isinstance(found, Workspace):
            inside = found.feasible if at_least is None else found.likely(at_least)
            pairs = found.crossings(inside)
            places = boundary(machine, *pairs, tolerance=edge, at_least=at_least, **asked)
        notes = [*machine.notes, *strange(machine), *scalar_last(machine, turned or ())]
        if own is not None:
            notes += [*own.notes, *beyond_line(found, own.reach)]
        status = 3 if not no_elastic and told["rests"] == 0 else 0
        text = json_text({
            "made": made, "exit_status": status, "notes": notes, **told,
            "edge": None if places is None else {"tolerance_m": edge, "places": len(places)},
        })  # fmt: skip
        write_text(folder / "map.json", text + "\n")
        if isinstance(found, Workspace):
            write_arrays(folder / "map.npz", found, places)
            if figure != "none" and not flat:
                map_figure(folder / f"map.{figure}", found, edge=places, at_least=at_least)
            if not no_recording:
                from seecr.show.map_recording import write_map_recording

                write_map_recording(found, folder / "map.rrd", places)
    where = [] if grid else [found.region]  # of their own grids people know it
    lines = [*untold(notes), *where, *found.lines()]
    if isinstance(found, Workspace):
        lines += [*softest_line(found), *likely_lines(found, at_least)]
    lines += sag_lines_of(not no_elastic, own.names if own else ())
    if isinstance(found, Workspace) and places is not None and edge is not None:
        lines.append(edge_line(found, places, edge, at_least))
    if isinstance(found, Workspace) and figure != "none" and flat:
        lines.append("no figure: the grid has more than one value along fewer than two axes")
    least = ("--lowest", f"{lowest:g}") if lowest else ()
    most = () if highest is None else ("--highest", f"{highest:g}")
    then = following("crosscheck", "plan", robot, "--rows", 40, *least, *most)
    click.echo(text if as_json else "\n".join([*lines, f"Results in {out}/", then]))
    return status


def _holds_none(robot: Robot, poses: int, lowest: float, highest: float) -> Exception:
    """That no pose of the grid can be held."""
    from seecr import InputError
    from seecr.counted import counted
    from seecr.description.robot import ITS_A_POINT

    what, stays = "no ", ""
    if robot.n_driven < robot.n_dof:
        what, stays = "in no orientation do ", " so that the platform stays"
    cure = "; expected another grid, orientation or wider limits"
    if robot.is_point:
        cure = f": {ITS_A_POINT}"
    return InputError(
        f"no pose of the grid can be held: {what}tensions from {lowest:g} to {highest:g} N balance "
        f"the load{stays} at any of {counted(poses, 'pose')}{cure}"
    )
