"""``seecr sweep``: where the platform rests at many commands."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

import click

from seecr.cli import options
from seecr.cli.following import after_sweep
from seecr.cli.progress import progress_bar
from seecr.cli.results import files_of_pictures, made_by, untold

if TYPE_CHECKING:
    from seecr import BarManifold, Commands, Model, Robot, SlackSpan, Solution


# A bar's tilts are compared with the manifold in sweeps of at most so many poses: it takes nearly a
# millisecond for each.
_MOST_TILTS = 10_000
# Zones of slack cables are computed for sweeps with at most so many changes of them.
_MOST_CHANGES = 1000
_WANTED = "Lengths are commanded; deviations are from the wanted poses, columns want_*."


@options.command(
    "seecr sweep demobot_parallel --line 0.17 0.25 0.1 0.63 0.25 0.1",
    "seecr sweep robot.xml poses.csv --model model.toml",
    "seecr sweep robot.xml --grid 0.1:0.7:25 0.25 0.05:0.35:13 --json",
    "seecr sweep demobot_parallel --line 0.17 0.25 0.1 0.63 0.25 0.1 --method fsolve",
    cls=options.NumbersCommand,
)
@options.robot
@click.argument("poses", type=options.FILE, metavar="[POSES.csv]", required=False)
@options.option("--line X Y Z X Y Z", "From one position to another [m].", options.Number())
@options.option("--count N", "Poses of --line.  [default: 24]", options.WholeNumber(min=1))
@options.option("--grid X Y Z", "Each FIRST:LAST:COUNT or one number [m]; z varies fastest.")
@options.option(
    "--follow",
    "Follow the commanded path from the reference pose, and report where the platform jumps.",
)
@options.option(
    "--method [newton|fsolve|least_squares]",
    "Solve by this method, and report its time and how often it evaluates the equations: the "
    "compiled one, or one of the paper's two, from SciPy.",
)
@options.turned("--line and --grid")
@options.columns
@options.pictures
@options.out("seecr-sweep")
@options.as_json
def command(
    robot: Path, poses: Path | None, cable: str | None, model: Path | None, follow: bool,
    method: str | None, figure: str, no_recording: bool, out: Path, as_json: bool, **ways: Any,
) -> int:  # fmt: skip
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

    If another equilibrium of a command is lower than the one reported, and turned against it by
    less than a right angle, the program says so. It solves each command again from poses turned by
    70 degrees: a short search, which may miss some. With effects that have a history there is none.

    Writes sweep.json, sweep.csv, a figure and sweep.rrd. Also writes sweep.toml if lengths are told
    lengths or runs begin at their first row, so that every command reads sweep.csv as these
    commands.

    \b
    Exit status: 0 all at rest, 2 bad input, 3 a pose without an equilibrium, or where the platform
    is free to move.
    """
    from seecr import lower_equilibria, midline_points, spread_of
    from seecr.cli.arguments import commands_of, model_at, notes_of, robot_at
    from seecr.files import json_pieces, with_toml, write_text
    from seecr.folders import check_ours, staged
    from seecr.show.batch_words import jump_lines, span_lines, sweep_lines
    from seecr.show.files import SweepRows, toml_beside
    from seecr.show.pose_words import at_rest
    from seecr.show.sweep_figure import sweep_figure

    machine = robot_at(robot, cable)
    own = model_at(model, machine)
    commands, more, said, wanted, runs = commands_of(machine, poses, **ways)
    made = made_by(machine.source, poses, model)
    pictures, every = files_of_pictures("sweep", figure, no_recording)
    names, sometimes = {"sweep.json", "sweep.csv", *pictures}, {"sweep.toml", *every}
    where: dict[str, Any] = {"read": with_toml(poses), "made": made}
    with staged(out, names=names, sometimes=sometimes, **where) as folder:
        check_ours(out, ["sweep.toml"])  # it would say what sweep.csv beside it is
        with progress_bar("solving", len(commands)) as tell:
            solution, search = _solved(machine, commands, own, follow, method)
            spread = None
            if own is not None:
                tell(0, "errors")
                spread = spread_of(machine, commands, own)
            tell(0, "lower equilibria")
            lower = lower_equilibria(solution)
            tell(len(commands), "solved")
        rows = SweepRows(solution, commands.lengths, more, spread, wanted, commands.loads)
        commanded = commands.lengths is None or rows.aimed
        bar, too_many = _bar(solution, commands, own, commanded)
        rows = replace(rows, bar=bar)
        status = 0 if at_rest(solution) else 3
        spans, why_not = _spans(solution, commands, own, runs)
        gave_up = _gave_up(solution, method)
        met = midline_points(solution)
        if rows.aimed:
            said = (*said, _WANTED)
        notes = [*notes_of(own, solution, commands), *said, *gave_up, *why_not, *too_many]
        document = {
            "made": made, "exit_status": status,
            "robot": machine.name, "cables": machine.cable_names,
            "model": None if own is None else own.names, "notes": notes,
            **({} if search is None else {"search": search}), "zones": spans,
            "midline_point": None if met is None else met.name, "lower": lower,
            "rows": rows.records(),
        }  # fmt: skip
        write_text(folder / "sweep.json", json_pieces(document))
        write_text(folder / "sweep.csv", rows.csv_lines())
        if beside := toml_beside(commands.told, commands):
            write_text(folder / "sweep.toml", beside)
        if figure != "none":
            sweep_figure(
                folder / f"sweep.{figure}", solution, commanded, rows.aimed, runs, spread,
                zones=spans or (), bar=bar,
            )  # fmt: skip
        if not no_recording:
            from seecr.show.sweep_recording import write_sweep_recording

            write_sweep_recording(solution, folder / "sweep.rrd", commanded)
    lines = [
        *untold(notes), *sweep_lines(solution, commanded, spread), *span_lines(spans or ()),
        *jump_lines(solution), *lower.lines(), *(() if met is None else met.lines()),
        *(() if bar is None else bar.lines()), *(() if search is None else [search.words]),
        f"Results in {out}/", after_sweep(lower, commands, robot, poses, cable, own),
    ]  # fmt: skip
    if not as_json:
        click.echo("\n".join(lines))
        return status
    with (out / "sweep.json").open(encoding="utf-8") as file:
        for line in file:
            click.echo(line, nl=False)
    return status


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


def _spans(
    solution: Solution, commands: Commands, model: Model | None, runs: Sequence[Any] | None
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
