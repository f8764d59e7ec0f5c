"""``crosscheck diagnose``: which effects are missing."""

from __future__ import annotations

from pathlib import Path

import click

from seecr.cli.options import FILE, json_option, out_option, progress_share


@click.command(
    epilog="Example: crosscheck diagnose robot.xml measured.csv --out diagnosis",
)
@click.argument("robot", type=FILE, metavar="ROBOT.xml")
@click.argument("data", type=FILE, metavar="DATA.csv")
@click.option("--model", type=FILE, metavar="M.toml", help="Effects the model has already.")
@click.option("--no-recording", is_flag=True, help="Write no .rrd.")
@out_option("crosscheck-diagnosis")
@json_option
def command(
    robot: Path, data: Path, model: Path | None, no_recording: bool, out: Path, as_json: bool
) -> int:
    """Find which effects a model misses, in the order in which adding them pays.

    ROBOT.xml is the robot's MJCF, DATA.csv its measurements, with sigma in a TOML beside it.
    Writes diagnosis.json, diagnosis.html and diagnosis.rrd.
    """
    from crosscheck import diagnose, load_measurements
    from crosscheck.files import json_text, staged, write_text
    from crosscheck.report import write_report
    from seecr import load_model, load_robot

    machine = load_robot(robot)
    measured = load_measurements(data, machine)
    own = load_model(model, machine) if model is not None else ()
    with staged(out) as folder:
        with progress_share("diagnosing") as progress:
            found = diagnose(machine, measured, own, progress)
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
