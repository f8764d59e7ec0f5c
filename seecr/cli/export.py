"""``seecr export``: a calibrated robot as MJCF."""

from __future__ import annotations

from pathlib import Path

import click

from seecr.cli import options
from seecr.cli.following import following
from seecr.cli.results import made_by, untold


@options.command(
    "seecr export robot.xml calibrated.xml --model model.toml",
    "seecr export robot.xml calibrated.xml 0.3 0.2 0.15 --model model.toml",
    cls=options.NumbersCommand,
)
@options.robot
@click.argument("out", type=options.FILE, metavar="OUT.xml")
@click.argument("coordinates", nargs=-1, type=options.Number(), metavar="[X Y Z [QW QX QY QZ]]")
@options.option(
    "--firmware [reprap|klipper|maslow]",
    "Also write its exit points as settings of that firmware, beside OUT.xml.",
)
@options.option("--out DIR", "Write OUT.xml into this folder.", name="folder")
@options.as_json
def command(
    robot: Path, out: Path, coordinates: tuple[float, ...], cable: str | None, model: Path | None,
    firmware: str | None, folder: Path | None, as_json: bool,
) -> int:  # fmt: skip
    """Write a robot with the effects of its model as MJCF, as far as MJCF can express them.

    OUT.xml is a robot's description, which every command reads: given the same rest lengths, MuJoCo
    brings it to rest where seecr predicts. Pulleys, sag and the like need bodies that a description
    does not have: these go into OUT-mujoco.xml, for MuJoCo alone, at the pose X Y Z (by default the
    reference pose), with the equilibrium as its keyframe. The program lists what is not in any
    file. Firmware knows exit points alone: seecr correct --grid writes a table of lengths.

    \b
    Exit status: 0 all well, 2 bad input, 3 no equilibrium at the pose to export at.
    """
    from seecr import InputError, export
    from seecr.cli.arguments import model_at, pose_of, robot_at
    from seecr.columns.plausible import scalar_last
    from seecr.files import check_writable, json_text, write_texts
    from seecr.importing.firmware import firmware_text, settings_beside

    machine = robot_at(robot, cable)
    out = out if folder is None else folder / out
    if out.suffix.lower() not in (".xml", ".mjcf"):
        raise InputError(f"{out}: expected the name of an MJCF file to write, such as out.xml")
    beside = out.with_name(f"{out.stem}-mujoco{out.suffix}")
    for file in (out, beside):
        if file.exists() and machine.source is not None and file.samefile(machine.source):
            raise InputError(f"{file}: is the robot's own file; expected another file to write")
    own = model_at(model, machine)
    found = export(machine, own or (), pose_of(coordinates, machine) if coordinates else None)
    if coordinates and found.mujoco_text is None and not found.softens:
        raise InputError(
            f"X Y Z is the pose for {beside.name}, and the model's effects need no such file; "
            "leave it out"
        )
    check_writable(out)
    files = {out: found.text} | ({beside: found.mujoco_text} if found.mujoco_text else {})
    if firmware is not None:
        settings = settings_beside(firmware, out)
        files[settings] = firmware_text(firmware, found.robot.exit_points)
    out.parent.mkdir(parents=True, exist_ok=True)
    write_texts(files, "cannot write the MJCF")
    slip = scalar_last(machine, coordinates[3:])
    notes = [*machine.notes, *(own.notes if own else ()), *slip]
    if beside not in files and beside.is_file():
        notes.append(_without(beside))
    document = {
        "made": made_by(machine.source, model), "exit_status": 0, "notes": notes,
        "files": [str(path) for path in files], **found.as_json(),
    }  # fmt: skip
    place = [f"{value + 0.0:g}" for value in coordinates or machine.reference_pose[:3]]
    then = following("seecr", "pose", out, *place)
    lines = [*untold(notes), *found.lines(out.name, beside.name)]
    lines += [] if firmware is None else [f"{settings.name} has the exit points for {firmware}"]
    lines.append(then)
    click.echo(json_text(document) if as_json else "\n".join(lines))
    return 0


def _without(beside: Path) -> str:
    """Remove the file for MuJoCo of an earlier export, which is of another model; what was done.

    A file of that name that no export wrote is the user's own.
    """
    from seecr.exported.export import wrote

    if not wrote(beside):
        return f"{beside.name} is of no export: it stays, though no such file is needed now"
    try:
        beside.unlink()
    except OSError as error:
        return f"{beside.name} is of an earlier export and cannot be removed: {error.strerror}"
    return f"{beside.name} of an earlier export removed: now no such file is needed"
