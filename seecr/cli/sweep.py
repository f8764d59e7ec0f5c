"""``seecr sweep``: where the platform rests at many commands."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

import click

from seecr.cli.arguments import (
    NumbersCommand,
    axes_of,
    check_count,
    check_places,
    files_of_pictures,
    model_at,
    notes_of,
    picture_options,
    robot_at,
    robot_options,
    turned_option,
)
from seecr.cli.following import after_sweep
from seecr.cli.options import (
    FILE,
    Number,
    WholeNumber,
    json_option,
    made_by,
    out_option,
    progress_bar,
)

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from seecr import BarManifold, Commands, Model, Robot, SlackSpan, Solution


_WANTED = "Lengths are commanded; deviations are from the wanted poses, columns want_*."
# Poses of --line.
_COUNT = 24
# A bar's tilts are compared with the manifold in sweeps of at most so many poses: it takes nearly a
# millisecond for each.
_MOST_TILTS = 10_000
# Zones of slack cables are computed for sweeps with at most so many changes of them.
_MOST_CHANGES = 1000
_COUNTED = "Poses are counted from 0, as the rows of sweep.json are."


@click.command(
    cls=NumbersCommand,
    short_help="Compute where the platform rests at many commands.",
    epilog="""\b
Examples:
  seecr sweep demobot_parallel --line 0.17 0.25 0.1 0.63 0.25 0.1
  seecr sweep robot.xml poses.csv --model model.toml
  seecr sweep robot.xml --grid 0.1:0.7:25 0.25 0.05:0.35:13 --json
  seecr sweep demobot_parallel --line 0.17 0.25 0.1 0.63 0.25 0.1 --method fsolve
""",
)
@robot_options
@click.argument("poses", type=FILE, metavar="[POSES.csv]", required=False)
@click.option(
    "--line",
    nargs=6,
    type=Number(),
    metavar="X Y Z X Y Z",
    help="From one position to another [m].",
)
@click.option(
    "--count",
    type=WholeNumber(min=1),
    metavar="N",
    help=f"Poses of --line.  [default: {_COUNT}]",
)
@click.option(
    "--grid",
    nargs=3,
    metavar="X Y Z",
    help="Each FIRST:LAST:COUNT or one number [m]; z varies fastest.",
)
@click.option(
    "--follow",
    is_flag=True,
    help="Follow the commanded path from the reference pose, and report where the platform jumps.",
)
@click.option(
    "--method",
    type=click.Choice(["newton", "fsolve", "least_squares"]),
    help="Solve by this method, and report its time and how often it evaluates the equations: the "
    "compiled one, or one of the paper's two, from SciPy.",
)
@turned_option("--line and --grid")
@picture_options
@out_option("seecr-sweep")
@json_option
def command(
    robot: Path,
    poses: Path | None,
    cable: str | None,
    model: Path | None,
    follow: bool,
    method: str | None,
    figure: str,
    no_recording: bool,
    out: Path,
    as_json: bool,
    **ways: Any,
) -> int:
    """Show where the platform comes to rest at each of many commands.

    ROBOT is an MJCF file or the name of a shipped robot. POSES.csv holds commands in the same
    format as a file of measurements: cmd_x_m ... or length_1_m ..., with run, t_s and temperature_C
    for effects that depend on them. Or poses come from --line or --grid. Each command is solved by
    itself, unless --follow or a model with history requires solving along the path.

    Poses are named by their line in POSES.csv; those of --line and --grid are counted from 0.

    Zones are the stretches of the commanded way with the same slack cables; between poses their
    edges are searched for, to a micrometre; with history they are half way between poses.
    On two pairs of parallel cables in a plane, the paper's point V or H is given, too; of a bar on
    two cables its tilt beside those at which it is in balance, the paper's manifold.

    Writes sweep.json, sweep.csv, a figure and sweep.rrd. Also writes sweep.toml if lengths are told
    lengths or runs begin at their first row, so that every command reads sweep.csv as these
    commands.

    \b
    Exit status: 0 all at rest, 2 bad input, 3 a pose without an equilibrium, or where the platform
    is free to move.
    """
    from seecr import midline_points, spread_of
    from seecr.files import check_replaces, json_text, staged, with_toml, write_text
    from seecr.show.batch_words import jump_lines, span_lines, sweep_lines
    from seecr.show.files import SweepRows, toml_beside
    from seecr.show.pose_words import at_rest
    from seecr.show.sweep_figure import sweep_figure

    machine = robot_at(robot, cable)
    own = model_at(model, machine)
    given = _Commanded(**ways)
    commands, more, said, wanted = _commands(machine, poses, given)
    check_replaces(out, ("sweep.csv", "sweep.toml"), "sweep.json", read=with_toml(poses))
    sometimes = ("sweep.toml", *files_of_pictures("sweep"))
    with staged(out, sometimes=sometimes, read=with_toml(poses)) as folder:
        with progress_bar("solving", len(commands)) as tell:
            solution, search = _solved(machine, commands, own, follow, method)
            if own is not None:
                tell(0, "errors")
            spread = None if own is None else spread_of(machine, commands, own)
            tell(len(commands), "solved")
        rows = SweepRows(solution, commands.lengths, more, spread, wanted, commands.loads)
        commanded = commands.lengths is None or rows.aimed
        bar, too_many = _bar(solution, commands, own, commanded)
        rows = replace(rows, bar=bar)
        status = 0 if at_rest(solution) else 3
        runs = _runs(machine, given, more)
        spans, why_not = _spans(solution, commands, own, runs)
        gave_up = _gave_up(solution, method)
        met = midline_points(solution)
        if rows.aimed:
            said = (*said, _WANTED)
        notes = [*notes_of(own, solution, commands), *said, *gave_up, *why_not, *too_many]
        document = {
            "made": made_by(machine.source, poses, model),
            "exit_status": status,
            "robot": machine.name,
            "cables": machine.cable_names,
            "model": None if own is None else own.names,
            "notes": notes,
            **({} if search is None else {"search": search}),
            "zones": spans,
            "midline_point": None if met is None else met.name,
            "rows": rows,
        }
        text = json_text(document)
        write_text(folder / "sweep.json", text + "\n")
        write_text(folder / "sweep.csv", rows.csv_text())
        if beside := toml_beside(commands.told, commands):
            write_text(folder / "sweep.toml", beside)
        if figure != "none":
            sweep_figure(
                folder / f"sweep.{figure}", solution, commanded, rows.aimed, runs, spread,
                zones=spans or (), bar=bar,
            )  # fmt: skip
        if not no_recording:
            # takes a second or two to import
            from seecr.show.sweep_recording import write_sweep_recording

            write_sweep_recording(solution, folder / "sweep.rrd", commanded)
    if as_json:
        click.echo(text)
        return status
    lines = [
        *sweep_lines(solution, commanded, spread), *span_lines(spans or ()), *jump_lines(solution),
        *(() if met is None else met.lines()), *(() if bar is None else bar.lines()),
    ]  # fmt: skip
    if search is not None:
        lines.append(search.words)
    then = after_sweep(solution, commands, robot, poses, cable, own)
    for line in [*notes, *lines, f"Results in {out}/", then]:
        click.echo(line)
    return status


_Columns = dict[str, Sequence[Any]]
"""Further values of each row, by the column's name."""


@dataclass(frozen=True)
class _Commanded:
    """The options that say where the platform is commanded to, as typed."""

    line: tuple[float, ...] | None
    count: int | None
    grid: tuple[str, ...] | None
    turned: tuple[float, ...] | None


@dataclass(frozen=True)
class Effort:
    """What solving n poses took: evaluations of the equations and time, one pose's [s]."""

    method: str
    fewest: int
    median: float
    most: int
    seconds_per_pose: float

    @property
    def words(self) -> str:
        """For people."""
        return (
            f"{self.method}: {self.fewest} to {self.most} evaluations of the equations per pose, "
            f"{self.median:g} the median; {1e3 * self.seconds_per_pose:.2g} ms per pose"
        )


def _solved(
    robot: Robot, commands: Commands, model: Model | None, follow: bool, method: str | None
) -> tuple[Solution, Effort | None]:
    """Where the commands lead, and what the search took, if its method was asked for."""
    import numpy as np

    from seecr import InputError, predict, solve

    effects = model or ()
    if method is None:
        return solve(robot, commands, effects=effects, follow=follow), None
    first = commands.rows(np.arange(1))
    if follow or predict(robot, first, effects).has_history:
        beside = "--follow" if follow else "a model with history, which is solved along the path"
        raise InputError(
            f"--method needs every command to be solved by itself; got it together with {beside}; "
            "leave one of them out"
        )
    # what is compiled or imported at the first call is no part of the search
    solve(robot, first, effects=effects, method=method)
    begin = perf_counter()
    found = solve(robot, commands, effects=effects, method=method)
    seconds = (perf_counter() - begin) / len(found)
    counts = found.iterations
    counted = int(counts.min()), float(np.median(counts)), int(counts.max())
    return found, Effort(method, *counted, seconds)


def _commands(
    robot: Robot, poses: Path | None, given: _Commanded
) -> tuple[Commands, _Columns, tuple[str, ...], NDArray[np.float64] | None]:
    """The commands, what else their file says, notes on it, and the poses that lengths are for."""
    from seecr import Commands, InputError
    from seecr.columns.commands import read_commands

    ways = [name for name in ("line", "grid") if getattr(given, name)]
    if len(ways) + (poses is not None) != 1:
        got = " and ".join([*(["POSES.csv"] if poses else []), *(f"--{w}" for w in ways)])
        raise InputError(f"expected one of POSES.csv, --line, --grid; got {got or 'none'}")
    if poses is not None and given.turned:
        raise InputError(
            "--turned applies to --line and --grid; commands of a file are turned by columns such "
            f"as cmd_rx_deg; leave it out, or add them to {poses}"
        )
    if given.count and not given.line:
        raise InputError(
            f"--count applies to --line, got it together with {poses or '--grid'}, which sets the "
            "number of poses; leave it out"
        )
    if poses is None:
        return Commands(_along(robot, given)), {}, (_COUNTED,), None
    read = read_commands(poses, robot)
    return read.commands, read.conditions, read.notes, read.wanted


def _along(robot: Robot, given: _Commanded) -> NDArray[np.float64]:
    """Poses (n, 7) of --line or --grid."""
    import numpy as np

    from seecr.statics.starts import commanded_poses

    if given.line:
        check_places(given.line, robot)
        count = given.count or _COUNT
        check_count("--count", count)
        places = np.linspace(given.line[:3], given.line[3:], count)
    else:
        axes = axes_of(given.grid or (), robot)
        places = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    turned = given.turned or robot.reference_pose[3:]
    return commanded_poses(np.column_stack([places, np.tile(turned, (len(places), 1))]))


def _spans(
    solution: Solution, commands: Commands, model: Model | None, runs: Sequence[int] | None
) -> tuple[tuple[SlackSpan, ...] | None, tuple[str, ...]]:
    """The zones of slack cables between commanded poses, and why there are none."""
    import numpy as np

    from seecr import slack_spans

    if commands.lengths is not None or len(commands) < 2:
        return None, ()
    changes = np.any(solution.slack[1:] != solution.slack[:-1], axis=1).sum()
    if changes > _MOST_CHANGES:
        return None, (
            f"Zones of slack cables are not computed: more than {_MOST_CHANGES} poses differ from "
            "the one before in which cables are slack.",
        )
    if commands.run is None and runs is not None:
        commands = replace(commands, run=np.unique(runs, return_inverse=True)[1])
    return slack_spans(solution, commands, effects=model or ()), ()


def _gave_up(solution: Solution, method: str | None) -> tuple[str, ...]:
    """That a search of SciPy's gave up where the robot may well rest, and what zones make of it."""
    from seecr import Status
    from seecr.counted import counted

    lost = sum(status is Status.GAVE_UP for status in solution.status)
    if lost == 0:
        return ()
    return (
        f"The search ({method}) gave up at {lost} of {counted(len(solution), 'pose')}, where the "
        "platform may well rest: zones come from the poses that it solved.",
    )


def _bar(
    solution: Solution, commands: Commands, model: Model | None, commanded: bool
) -> tuple[BarManifold | None, tuple[str, ...]]:
    """Of a bar as it is described, the tilts beside the manifold; and why they are not computed."""
    from seecr import bar_manifold
    from seecr.counted import counted

    if model is not None or commands.loads is not None or solution.robot.n_cables != 2:
        return None, ()
    if len(solution) > _MOST_TILTS:
        most = counted(_MOST_TILTS, "pose")
        return None, (f"Tilts of the manifold are not computed: more than {most}.",)
    return bar_manifold(solution, commanded), ()


def _runs(robot: Robot, given: _Commanded, more: _Columns) -> Sequence[int] | None:
    """Which poses follow on each other: a column of --grid, a run of a file; None: all do."""
    if not given.grid:
        return more.get("run")
    counts = [len(axis) for axis in axes_of(given.grid, robot)]
    column = next((n for n in reversed(counts) if n > 1), 1)
    return [k // column for k in range(math.prod(counts))]
