"""``seecr new``: a robot's MJCF from a table of points, or from another program's file."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from seecr.cli import options
from seecr.cli.following import following
from seecr.cli.results import made_by

if TYPE_CHECKING:
    from seecr import Robot
    from seecr.importing.draft import Draft

_FILES = {
    "caspr": ("BODIES.xml", "CABLES.xml"), "wirex": ("FILE.wcrfx",), "reprap": ("CONFIG.g",),
    "klipper": ("PRINTER.cfg",), "maslow": ("MASLOW.yaml",),
}  # fmt: skip
_POSE = "X Y Z [QW QX QY QZ]"


class _PoseCommand(options.NumbersCommand):
    """A command whose option ``--at`` takes all numbers after it, three or seven."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Make these numbers one word with the option, which is what click has for a value."""
        words: list[str] = []
        for word in args:
            if words and words[-1].startswith("--at") and _numbers(word):
                words[-1] += f"{' ' if '=' in words[-1] else '='}{word}"
            else:
                words.append(word)
        return super().parse_args(ctx, words)


def _numbers(text: str) -> tuple[float, ...]:
    """The numbers in a text, with blanks or commas between; none if anything else is in it."""
    try:
        return tuple(float(word) for word in text.replace(",", " ").split())
    except ValueError:
        return ()


def _pose(
    _ctx: click.Context, _option: click.Parameter, value: str | None
) -> tuple[float, ...] | None:
    """``--at`` as numbers."""
    if value is None:
        return None
    if len(_numbers(value)) not in (3, 7):
        raise click.BadParameter(f"expected {_POSE}, got {value!r}.")
    return _numbers(value)


@options.command(
    "seecr new hall.xml --points points.csv --mass 25kg --ea 3e5N",
    "seecr new hall.xml --points points.csv --mass 25kg --ea 'steel 7x19 3mm' --at 3 2 1.2",
    "seecr new plotter.xml --points points.csv --mass 800g --ea 3kN --planar xz",
    "seecr new cogiro.xml --from caspr CoGiRo_bodies.xml CoGiRo_cables.xml --ea 3e5N",
    "seecr new ipanema.xml --from wirex IPAnema.wcrfx",
    "seecr new printer.xml --from reprap config.g --mass 5kg --ea 20kN",
    cls=_PoseCommand,
)
@click.argument("out", type=options.FILE, metavar="OUT.xml")
@click.argument("files", nargs=-1, type=options.FILE, metavar="[FILE...]")
@options.option(
    "--points POINTS.csv",
    "A table, one row a cable: exit_x_m exit_y_m exit_z_m in the base frame, anchor_x_m anchor_y_m "
    "anchor_z_m in the platform's, and name, ea_N or stiffness_N_m where cables differ.",
)
@options.option(
    "--from [caspr|wirex|reprap|klipper|maslow]",
    "Read FILE... of that program or firmware instead.",
    name="program",
)
@options.option("--set ID", "Of CASPR's sets of cables, this one.", name="cable_set")
@options.option("--mass KG", "Mass of the platform, such as 25kg.")
@click.option(
    "--ea", "--cable", "ea", metavar="N|ROPE",
    help="E S of all cables, such as 3e5N, or a rope, such as 'steel 7x19 3mm'; known are steel "
    "7x19, steel 6x19, dyneema, vectran, kevlar and polyester.",
)  # fmt: skip
@click.option(
    "--at", metavar=_POSE, callback=_pose,
    help="Reference pose, where winches are zeroed.  [default: the file's, or the frame's middle]",
)  # fmt: skip
@options.option("--com X Y Z", "Centre of mass in the platform's frame.", options.Number())
@options.option(
    "--pretension N",
    "Shorten the cables so that the platform rests at the reference pose exactly, each cable with "
    "at least this tension.  [default: just taut there]",
    options.Number(min=0.0),
)
@click.option(
    "--planar", metavar="[xy|xz|yz]", type=click.Choice(["auto", "xy", "xz", "yz"]),
    is_flag=False, flag_value="auto",
    help="The platform slides and turns in this plane, or in that of all points.",
)  # fmt: skip
@options.option("--free", "It is free, though all points are in one plane.")
@options.option("--force", "Replace OUT.xml if there is one.")
@options.option("--out DIR", "Write OUT.xml into this folder.", name="folder")
@options.as_json
def command(
    out: Path, files: tuple[Path, ...], points: Path | None, program: str | None,
    cable_set: str | None, mass: str | None, ea: str | None, at: tuple[float, ...] | None,
    com: tuple[float, ...] | None, pretension: float | None, planar: str | None, free: bool,
    force: bool, folder: Path | None, as_json: bool,
) -> int:  # fmt: skip
    """Write a robot's MJCF from its points, or from a file of CASPR, WireX or a firmware.

    Rest lengths are the straight lengths at the reference pose. The program says what it deduced
    and what it left out, and whether the platform comes to rest at the reference pose: with a
    certificate, or with the directions in which nothing holds it. At rest some cables may be slack:
    it says which, and whether tensions within the limits could hold the platform there with all of
    them, which is what seecr map asks of each pose.

    \b
    Exit status: 0 at rest, 2 bad input (nothing is written), 3 written, but it does not rest at its
    reference pose.
    """
    from seecr import solve, workspace_map
    from seecr.cli.arguments import notes_of
    from seecr.files import check_writable, json_text
    from seecr.importing.draft import write_robot
    from seecr.show.files import SweepRows
    from seecr.show.pose_words import at_rest, home_lines, open_lines, reason
    from seecr.workspace.grid import own_directions

    out = out if folder is None else folder / out
    _check_out(out, force, [points, *files])
    draft = _draft(points, program, files, cable_set)
    draft = draft.with_options(mass=mass, ea=ea, at=at, com=com, planar=planar, free=free)
    if points is not None:
        draft = replace(draft, name=out.stem)
    robot, notes = draft.robot()
    if pretension is not None:
        robot = _tightened(robot, pretension)
    check_writable(out)
    solution, home = solve(robot, robot.reference_pose), robot.reference_pose[:3]
    along, (lowest, highest) = own_directions(robot), draft.limits
    place = home if along is None else along @ home
    mapped = workspace_map(robot, *place, lowest=lowest, highest=highest, elastic=False)
    held, margin = bool(mapped.feasible.all()), float(mapped.margin.min())
    notes = (*notes, *notes_of(None, solution))
    read = [points, *files]
    made = made_by(*read)
    out.parent.mkdir(parents=True, exist_ok=True)
    write_robot(robot, out, f"{robot.name}; written by {made.command}")
    status = 0 if at_rest(solution) else 3
    document = {
        "made": made, "exit_status": status, "robot": robot.name, "file": str(out),
        "cables": robot.cable_names, "mass_kg": robot.mass, "ea_N": robot.ea,
        "rest_lengths_m": robot.rest_lengths, "reference_pose": robot.reference_pose,
        "joints": [f"{joint.kind} {joint.name}" for joint in robot.joints],
        "tension_limits_N": draft.limits, "notes": notes, "home": SweepRows(solution).as_json()[0],
        "can_be_held": held, "margin_N": margin,
        "why_not": None if status == 0 else reason(solution),
    }  # fmt: skip
    limits = dict(zip(("--lowest", "--highest"), draft.limits, strict=True)).items()
    said = [f"{name}={value:g}" for name, value in limits if 0.0 < value < math.inf]
    lines = [
        f"{out}: {robot!r}", *(f"note: {note}" for note in notes), *home_lines(solution),
        *open_lines(solution, held, draft.limits),
        following("seecr", "map", out, *said),
    ]  # fmt: skip
    click.echo(json_text(document) if as_json else "\n".join(lines))
    return status


def _tightened(robot: Robot, least: float) -> Robot:
    """The robot with rest lengths that hold its reference pose, with at least this tension [N].

    Raises:
        InputError: no such lengths.
    """
    from seecr import InputError, correct

    found = correct(robot, robot.reference_pose[None], lowest=least)
    if not found.reached.all() or found.commands.lengths is None:
        raise InputError(
            f"--pretension {least:g}: the reference pose cannot be held so, {found.why_not[0]}; "
            "expected less, or another pose with --at"
        )
    return replace(robot, rest_lengths=found.commands.lengths[0])


def _check_out(out: Path, force: bool, read: list[Path | None]) -> None:
    """That a new file is written, or an old one replaced on purpose, and none that is read.

    Raises:
        InputError: it has another ending, there is a file already, or it is one of those read.
    """
    from seecr import InputError

    if out.suffix.lower() not in (".xml", ".mjcf"):
        raise InputError(f"{out}: expected the name of an MJCF file to write, such as robot.xml")
    if any(out.exists() and file and file.exists() and out.samefile(file) for file in read):
        raise InputError(f"{out}: is read here; expected the name of another file to write")
    if out.exists() and not force:
        raise InputError(f"{out}: is there already; expected a new name, or --force to replace it")


def _draft(
    points: Path | None, program: str | None, files: tuple[Path, ...], cable_set: str | None
) -> Draft:
    """What the files say.

    Raises:
        UsageError: not one table, or another number of files than a program's robot has.
        InputFileError: the files are not such.
    """
    from seecr.importing.caspr import read_caspr
    from seecr.importing.firmware import read_firmware
    from seecr.importing.points_table import read_points
    from seecr.importing.wirex import read_wirex

    if (points is None) == (program is None):
        got = "none" if points is None else "both"
        raise click.UsageError(
            "expected one of --points POINTS.csv, --from caspr BODIES.xml CABLES.xml and --from "
            f"wirex FILE.wcrfx (or reprap, klipper, maslow), got {got}"
        )
    wanted = _FILES.get(program or "", ())
    if len(files) != len(wanted):
        got = " ".join(map(str, files)) or "none"
        names = " ".join(wanted) or "no further file"
        raise click.UsageError(f"expected {names} after OUT.xml, got {got}")
    if cable_set is not None and program != "caspr":
        raise click.UsageError("--set is for --from caspr; leave it out")
    if program == "caspr":
        return read_caspr(files[0], files[1], cable_set)
    if program is not None:
        return read_wirex(files[0]) if program == "wirex" else read_firmware(program, files[0])
    assert points is not None
    return read_points(points)
