"""``crosscheck study``: many maps, sweeps, diagnoses and twins, on many processors or machines."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from crosscheck.cli import choices
from seecr.cli import options
from seecr.cli.progress import executor_of, progress_bar
from seecr.cli.results import made_by

if TYPE_CHECKING:
    from crosscheck import Tolerance


@options.command(
    "crosscheck study cases.csv --within 1mm --within 2deg",
    "crosscheck study cases.csv --scheduler tcp://10.0.0.1:8786 --out study",
)
@click.argument("cases", type=options.FILE, metavar="CASES.csv")
@options.option(
    "--within SIZE",
    "Also tell which robots come to rest within this of all poses they are sent to, such as 1mm or "
    "2deg; one of each may be given.",
    name="sizes",
    multiple=True,
)
@choices.workers
@options.option("--figure [png|svg|none]", "Kind of figure.", default="png")
@options.out("crosscheck-study")
@options.as_json
def command(
    cases: Path, sizes: tuple[str, ...], jobs: int | None, scheduler: str | None, figure: str,
    out: Path, as_json: bool,
) -> int:  # fmt: skip
    """Do many cases, and only those that are not done yet.

    CASES.csv has a row for each case: the robot, what to do with it (map, sweep, diagnose, or twin:
    make a twin and diagnose it), and what it needs; columns such as exit_2_x_mm, ea_N, mass_kg or
    pulley_radius.radius_m change the robot. docs/formats.md has the list. Files are looked for
    beside the table first.

    \b
    Writes into --out:
      parts/           a Parquet file per case with all its rows, named by the hash of the robot,
                       data, options and version; called again, only missing ones are computed
      study.csv        the table: one row per case
      study.json       the same, with how it was made
      study.png        a figure

    \b
    Exit status: 0 all well, 2 bad input, 3 a case without a result, or workers that ended.
    """
    from crosscheck.show.study import print_study, study_figure
    from crosscheck.studies.cases import read_cases
    from crosscheck.studies.study import studied
    from seecr.columns.csv import table_text
    from seecr.files import json_text, write_text
    from seecr.folders import staged
    from seecr.parallel import processors

    within = _limits(sizes)
    every, data = read_cases(cases)  # mistakes are told before workers are asked for
    made = made_by(cases)
    names = ["study.csv", "study.json"]
    with staged(out, names=names, sometimes=("study.png", "study.svg"), made=made) as folder:
        with (
            executor_of(scheduler, min(jobs or processors(), len(every))) as executor,
            progress_bar("studying", len(every)) as tell,
        ):
            found = studied(every, data, executor, out, within, tell)
        rows, status = found.records(), 3 if found.failed else 0
        write_text(folder / names[0], table_text({k: [row[k] for row in rows] for k in rows[0]}))
        text = json_text({"made": made, "exit_status": status, **found.as_json()})
        write_text(folder / names[1], text + "\n")
        if figure != "none":
            study_figure(found, folder / f"study.{figure}")
    if as_json:
        click.echo(text)
    else:
        print_study(found)
        click.echo(f"Results in {out}/")
    return status


def _limits(sizes: tuple[str, ...]) -> Tolerance | None:
    from crosscheck import CrosscheckError, Tolerance
    from crosscheck.measurements.data import parse_kind

    found = [parse_kind("--within", ("position", "orientation"), text) for text in sizes]
    if len(dict(found)) < len(found):
        raise CrosscheckError("--within: expected one size of each kind, got two")
    units = {"position": "position_m", "orientation": "orientation_rad"}
    return Tolerance(**{units[kind]: size for kind, size in found}) if found else None
