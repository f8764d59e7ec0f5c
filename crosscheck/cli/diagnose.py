"""``crosscheck diagnose``: which effects are missing."""

from __future__ import annotations

from pathlib import Path

import click

from crosscheck.cli.choices import exclude_option, listed, only_option, sigma_option
from seecr.cli.options import FILE, json_option, out_option, progress_share


@click.command(
    epilog="Example: crosscheck diagnose robot.xml measured.csv --out diagnosis",
)
@click.argument("robot", type=FILE, metavar="ROBOT.xml")
@click.argument("data", type=FILE, nargs=-1, required=True, metavar="DATA.csv...")
@click.option("--model", type=FILE, metavar="M.toml", help="Effects the model has already.")
@only_option
@exclude_option
@sigma_option
@click.option("--no-recording", is_flag=True, help="Write no .rrd.")
@out_option("crosscheck-diagnosis")
@json_option
def command(
    robot: Path,
    data: tuple[Path, ...],
    model: Path | None,
    only: tuple[str, ...],
    exclude: tuple[str, ...],
    sigmas: tuple[str, ...],
    no_recording: bool,
    out: Path,
    as_json: bool,
) -> int:
    """Find which effects a model misses, in the order in which adding them pays.

    ROBOT.xml is the robot's MJCF, DATA.csv its measurements, with sigma in a TOML beside it.
    Writes diagnosis.json, diagnosis.html and diagnosis.rrd.
    """
    from crosscheck import diagnose, load_measurements
    from crosscheck.files import json_text, staged, write_text
    from crosscheck.given import considered
    from crosscheck.measurements.stated import with_stated
    from crosscheck.report import write_report
    from seecr import load_model, load_robot

    considered(listed(only), listed(exclude))  # a wrong name is told before any file is read
    machine = load_robot(robot)
    measured = with_stated(load_measurements(data, machine), sigmas)
    own = load_model(model, machine) if model is not None else ()
    with staged(out) as folder:
        with progress_share("diagnosing") as progress:
            found = diagnose(
                machine, measured, own, progress, only=listed(only), exclude=listed(exclude)
            )
        text = json_text(found.as_json())
        write_text(folder / "diagnosis.json", text + "\n")
        write_report(found, folder / "diagnosis.html")
        if not no_recording and found.search is not None:
            from crosscheck.recording import write_diagnosis_recording

            write_diagnosis_recording(found, folder / "diagnosis.rrd")
    if as_json:
        click.echo(text)
    else:
        from crosscheck.terminal import print_diagnosis

        print_diagnosis(found, out)
    return 0 if found.converged else 3
