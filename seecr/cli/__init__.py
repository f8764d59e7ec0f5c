"""The command line of seecr. Each command lives in its own module, imported when it is used."""

from __future__ import annotations

from seecr.cli.group import LazyGroup

# Command, module in seecr.cli that holds it as `command`, and its line in --help.
COMMANDS: dict[str, tuple[str, str]] = {
    "pose": ("pose", "Where the platform rests at one command, and how each cable pulls."),
    "sweep": ("sweep", "The same for many commands: along a line, on a grid, or from a file."),
    "map": ("workspace", "Workspace: where the platform can be held, and where it comes to rest."),
    "correct": ("correct", "Find the commands that bring the platform to the wanted poses."),
    "new": ("new", "Write a robot's MJCF from a table of points, CASPR, WireX or firmware."),
    "control": ("control", "What the robot does under different schemes of control."),
    "export": ("export", "Write a calibrated robot as MJCF."),
}

main = LazyGroup(
    "seecr.cli",
    COMMANDS,
    "Statics of cable-driven parallel robots with elastic cables: where the platform rests.",
    "ROBOT",
)
