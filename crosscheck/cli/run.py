"""``crosscheck run``: the suite, its reports and its verdict."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING

import click

from crosscheck.cli.options import (
    FILE,
    jobs_option,
    json_option,
    out_option,
    processors,
    progress_bar,
    seed_option,
)

if TYPE_CHECKING:
    from crosscheck.cases import Case
    from crosscheck.results import Run
    from crosscheck.thresholds import Thresholds


@click.command(
    short_help="The cross-check suite.",
    epilog="""\b
Examples:
  crosscheck run
  crosscheck run --case 'parallel-*' --out results
  crosscheck run --robot my_robot.xml
  crosscheck run --robot nominal.xml --mujoco-robot as_built.xml
  crosscheck run --json > results.json
""",
)
@click.option(
    "--case",
    "patterns",
    multiple=True,
    metavar="NAME",
    help="Only this case; may be repeated, and a pattern such as 'cogiro-*'. See --list.",
)
@click.option("--list", "list_only", is_flag=True, help="List the cases and end.")
@click.option(
    "--robot",
    type=FILE,
    metavar="FILE.xml",
    help="Instead of the shipped robots: an MJCF of yours, along a sweep and at random poses.",
)
@click.option(
    "--mujoco-robot",
    type=FILE,
    metavar="FILE.xml",
    help="With --robot: another MJCF for MuJoCo to settle, to see what a difference does.",
)
@click.option(
    "--thresholds",
    "thresholds_file",
    type=FILE,
    metavar="FILE.toml",
    help="How far apart the two may be. Each run leaves the file it used among its results: "
    "copy that and change it.",
)
@seed_option
@jobs_option
@click.option("--no-recordings", is_flag=True, help="Write no .rrd files.")
@out_option("crosscheck-results")
@json_option
def command(
    patterns: tuple[str, ...],
    list_only: bool,
    robot: Path | None,
    mujoco_robot: Path | None,
    thresholds_file: Path | None,
    seed: int,
    jobs: int | None,
    no_recordings: bool,
    out: Path,
    as_json: bool,
) -> int:
    """Solve each pose with SEECR, settle it in MuJoCo, and hold the two against thresholds.

    The shipped cases: DemoBot in the Cogiro and the parallel configuration, on Vectran and on
    fishing line, along the paper's sweeps (x 0.17 to 0.63 m at z 0.1 and 0.2 m) and at 200 random
    poses each; and three planar robots.

    A pose where the platform is free to move, or has two stable equilibria that both physics
    confirm, is a finding: it is listed, and fails nothing.

    \b
    Writes into --out:
      results.json     every number, pose by pose
      junit.xml        one test a case, for continuous integration
      summary.md       the table, failures and findings
      CASE.rrd         a recording a case: open it with 'rerun CASE.rrd'
      worst_pose.xml   the pose nearest to its threshold, for MuJoCo's viewer
      thresholds.toml  what the run was held against

    \b
    Exit status: 0 all agree, 1 a threshold exceeded, 2 bad input, 3 a solve did not converge
    (and nothing exceeded a threshold).
    """
    from crosscheck.cases import select
    from crosscheck.thresholds import load_thresholds

    if mujoco_robot is not None and robot is None:
        raise click.UsageError("--mujoco-robot needs --robot: the MJCF that SEECR reads")
    thresholds = load_thresholds(thresholds_file)
    cases = select(_cases(robot, mujoco_robot, seed), patterns)
    if list_only:
        for case in cases:
            click.echo(f"{case.name:28s} {len(case.poses):4d} poses  {case.model}")
        return 0
    return _run(cases, thresholds, seed, jobs or processors(), not no_recordings, out, as_json)


def _cases(robot: Path | None, mujoco_robot: Path | None, seed: int) -> list[Case]:
    from crosscheck.cases import shipped_cases, user_cases

    if robot is None:
        return shipped_cases(seed)
    from seecr.mjcf import load_robot

    return user_cases(load_robot(robot), robot, mujoco_robot, seed)


def _run(
    cases: list[Case],
    thresholds: Thresholds,
    seed: int,
    jobs: int,
    recordings: bool,
    out: Path,
    as_json: bool,
) -> int:
    from crosscheck.output import staged

    began = time.perf_counter()
    with staged(out) as folder:
        total = sum(len(case.poses) for case in cases)
        with progress_bar("compiling", total) as advance:
            from crosscheck.results import Run
            from crosscheck.suite import run_suite

            results = run_suite(
                cases,
                thresholds,
                jobs=jobs,
                folder=folder if recordings else None,
                progress=lambda result: advance(len(result), result.case.name),
            )
        run = Run(results, thresholds, seed, jobs, time.perf_counter() - began)
        _write(run, folder)
    if as_json:
        from crosscheck.results import results_json

        click.echo(results_json(run), nl=False)
    else:
        from crosscheck.terminal import print_run

        print_run(run, out)
    return run.exit_status


def _write(run: Run, folder: Path) -> None:
    from crosscheck.junit import junit_xml
    from crosscheck.results import results_json
    from crosscheck.summary import summary_md
    from crosscheck.thresholds import thresholds_toml
    from crosscheck.worst import write_worst_pose

    sentence = write_worst_pose(run.results, folder)
    texts = {
        "results.json": results_json(run),
        "junit.xml": junit_xml(run),
        "summary.md": summary_md(run, sentence),
        "thresholds.toml": thresholds_toml(run.thresholds),
    }
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")
