"""``crosscheck run``: the suite, its reports and its verdict."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from crosscheck.cli import choices
from seecr.cli import options
from seecr.cli.following import following, passive_lines
from seecr.cli.progress import executor_of, progress_bar, say_duration
from seecr.cli.results import made_by

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from crosscheck import Case, CaseResult, Run, Thresholds
    from crosscheck.suite.effects import EffectCase


@options.command(
    "crosscheck run",
    "crosscheck run --case 'parallel-*' --out results",
    "crosscheck run --robot my_robot.xml",
    "crosscheck run --robot nominal.xml --mujoco-robot as_built.xml",
    "crosscheck run --json > results.json",
)
@options.option(
    "--case NAME",
    "Run only this case, or a pattern such as 'cogiro-*'; may be repeated. See --list.",
    name="patterns",
    multiple=True,
)
@options.option("--list", "List the cases and exit.", name="list_only")
@options.option(
    "--robot FILE.xml",
    "Instead of the shipped robots: your own MJCF, along a sweep and at random poses.",
)
@options.fix
@options.passive
@options.option(
    "--mujoco-robot FILE.xml",
    "With --robot: another MJCF for MuJoCo, to see what a difference between the two does.",
)
@options.option(
    "--thresholds FILE.toml",
    "TOML with the allowed differences. Each run saves the file it used with its results: copy "
    "and edit that.",
    name="thresholds_file",
)
@options.option("--seed N", "Seed of the random numbers.", options.WholeNumber(min=0), default=0)
@choices.workers
@options.option("--no-recordings", "Do not write recordings (.rrd).")
@options.out("crosscheck-results")
@options.as_json
def command(
    patterns: tuple[str, ...], list_only: bool, robot: Path | None, mujoco_robot: Path | None,
    thresholds_file: Path | None, seed: int, jobs: int | None, scheduler: str | None,
    no_recordings: bool, out: Path, as_json: bool,
) -> int:  # fmt: skip
    """Solve each pose with SEECR, settle it in MuJoCo, and compare the difference with thresholds.

    The shipped cases: DemoBot in the Cogiro and the parallel configuration, with Vectran cables and
    with fishing line, along the paper's sweeps (x 0.17 to 0.63 m at z 0.1 and 0.2 m), turned on the
    way, and at 200 random poses each; two tilted commands at which the parallel one can rest at two
    poses, each started so that both are reached; three planar robots; a DemoBot with uneven cables
    and one with its centre of mass off; robots of other sizes and kinds, cogiro-large, ipanema and
    camera, along a sweep and at random poses; three with a line that no winch drives, a band, a
    spring that also pushes, a counterweight. Then the group 'effects': every effect on both
    DemoBots, compared with a robot in MuJoCo that really has it (--case effects runs only these).

    A pose where the platform is free to move, or has two stable equilibria that both physics
    confirm, is a finding: it is listed, and fails its case only if the thresholds' [findings] do
    not allow it.

    \b
    Writes into --out:
      results.json     every number, pose by pose
      junit.xml        one test per case, for continuous integration
      summary.md       the table, failures and findings
      CASE.rrd         a recording per case: open it with 'rerun CASE.rrd'
      worst_pose.xml   the pose nearest to its threshold, for MuJoCo's viewer
      thresholds.toml  the thresholds of this run

    \b
    Exit status: 0 all agree, 1 a threshold exceeded, 2 bad input, 3 a solve did not converge
    (and nothing exceeded a threshold).
    """
    from crosscheck import load_thresholds, user_cases
    from crosscheck.show.suite import print_run
    from crosscheck.suite.cases import select
    from crosscheck.suite.run import every_shipped, shipped_like
    from crosscheck.suite.write import RESULTS
    from seecr.cli.arguments import robot_at
    from seecr.parallel import processors

    if mujoco_robot is not None and robot is None:
        raise click.UsageError("--mujoco-robot needs --robot: the MJCF that SEECR reads")
    if passive_lines() and robot is None:
        raise click.UsageError("--passive needs --robot: the shipped robots say it themselves")
    thresholds = load_thresholds(thresholds_file)
    if robot is None:
        chosen = shipped_like(every_shipped(seed), patterns, "--case")
    else:
        machine = robot_at(robot)
        chosen = list(select(user_cases(machine, mujoco_robot, seed=seed), patterns, "--case"))
    if list_only:
        _list(chosen)
        return 0
    at_once = jobs or processors()
    say_duration("run", sum(map(len, chosen)), "poses", as_json, at_once=at_once)
    with executor_of(scheduler) as executor:
        run = _run(chosen, thresholds, seed, at_once, not no_recordings, out, executor)
    for note in run.notes:
        click.echo(f"note: {note}", err=True)
    if as_json:
        click.echo((out / RESULTS).read_text(encoding="utf-8"), nl=False)
    else:
        print_run(run, out)
        if run.results and not no_recordings:
            click.echo(following("rerun", out / f"{run.results[0].case.name}.rrd"))
    return run.outcome.exit_status


def _list(chosen: list[Case | EffectCase]) -> None:
    from crosscheck import Case
    from seecr.counted import counted

    width = max(len(case.name) for case in chosen)
    for case in chosen:
        what = counted(len(case.poses), "pose", "4d") if isinstance(case, Case) else "    effect"
        click.echo(f"{case.name:{width}s} {what}  {case.model}")


def _run(
    chosen: list[Case | EffectCase], thresholds: Thresholds, seed: int, jobs: int,
    recordings: bool, out: Path, executor: Executor | None,
) -> Run:  # fmt: skip
    from crosscheck import run_suite, write_run
    from crosscheck.suite.write import FILE_NAME, RESULTS
    from seecr.folders import staged

    # effects alone have no worst pose
    every = {f"{case.name}.rrd" for case in chosen}
    names = {RESULTS, "junit.xml", "summary.md", "thresholds.toml", *(every if recordings else ())}
    where: dict[str, Any] = {"sometimes": {FILE_NAME, *every}, "made": made_by()}
    with staged(out, names=names, **where) as folder:
        with progress_bar("compiling", sum(map(len, chosen))) as advance:
            run = run_suite(
                chosen, thresholds, seed=seed, jobs=jobs,
                record=partial(_record, folder=folder) if recordings else None,
                progress=lambda result: advance(len(result), result.case.name), executor=executor,
            )  # fmt: skip
        write_run(run, folder)
    return run


def _record(result: CaseResult, folder: Path) -> str:
    """Write the recording of a case into a folder; its name."""
    name = f"{result.case.name}.rrd"
    result.save_recording(folder / name)
    return name
