"""``seecr pose``: where the platform rests at one command."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from seecr.cli import options
from seecr.cli.following import after_pose
from seecr.cli.progress import progress_share
from seecr.cli.results import made_by, result_in, untold

if TYPE_CHECKING:
    from seecr import Barrier


@options.command(
    "seecr pose demobot_parallel 0.17 0.25 0.1",
    "seecr pose robot.xml -4.8 0 1.5 --model model.toml",
    "seecr pose robot.xml 0.4 0.25 0.1 0.966 0 0.259 0 --json",
    cls=options.NumbersCommand,
)
@options.robot
@click.argument("coordinates", nargs=-1, type=options.Number(), metavar="X Y Z [QW QX QY QZ]")
@options.option("--alone", "Do not search for other equilibria.")
@options.out_file("pose.json")
@options.as_json
def command(
    robot: Path, coordinates: tuple[float, ...], cable: str | None, model: Path | None,
    alone: bool, out: Path | None, as_json: bool,
) -> int:  # fmt: skip
    """Show where the platform comes to rest when it is sent to a pose, and how each cable pulls.

    ROBOT is an MJCF file or the name of a shipped robot. X Y Z are metres in the base frame, QW
    QX QY QZ a quaternion, scalar first; without one the orientation is that of the reference pose.
    Other stable equilibria of the same command are searched for and listed by energy, with the
    barrier in between, unless effects with a history decide where it rests. For a bar on two
    cables, all tilts at which it is in balance are listed, with their stability; for two pairs of
    parallel cables in a plane, the paper's point V or H.

    \b
    Exit status: 0 at rest, 2 bad input, 3 no equilibrium found, or a platform that is free to move
    there.
    """
    import numpy as np

    from seecr import bar_balances, barriers, equilibria, midline_points, solve, spread_of
    from seecr.cli.arguments import model_at, notes_of, pose_of, robot_at
    from seecr.equilibrium.search import elsewhere, on_their_way
    from seecr.files import json_text
    from seecr.show.files import SweepRows
    from seecr.show.pose_words import (
        at_rest,
        bar_lines,
        cable_lines,
        midline_lines,
        other_lines,
        pose_lines,
        softest_words,
        unsought_lines,
    )

    machine = robot_at(robot, cable)
    own = model_at(model, machine)
    command = pose_of(coordinates, machine)
    with progress_share("solving") as tell:
        solution = solve(machine, command, effects=own or ())
        lasting = [] if alone or own is None else on_their_way(machine, command, own)
        tell("other equilibria", 0.1)
        others = None if alone or lasting else equilibria(machine, command, effects=own or ())
        tell("barriers", 0.6)
        passes: tuple[Barrier, ...] = ()
        if others is not None and solution.converged[0]:
            passes = barriers(solution, others.rows(elsewhere(solution, others)))
        spread = None if own is None else spread_of(machine, command, own)
        tell("solved", 1.0)
    status = 0 if at_rest(solution) else 3
    # the closed form knows no effects
    bars = [
        bar_balances(machine, pose) if own is None and np.isfinite(pose).all() else None
        for pose in (solution.pose[0], solution.command[0])
    ]
    met = midline_points(solution)
    notes = list(notes_of(own, solution))
    unsought = list(unsought_lines(lasting))
    text = json_text({
        "made": made_by(machine.source, model), "exit_status": status,
        "robot": machine.name, "cables": machine.cable_names,
        **SweepRows(solution, spread=spread).as_json()[0], "sentence": solution.sentence(0),
        "slack_cables": int(solution.slack[0].sum()) if solution.converged[0] else None,
        "midline_point": None if met is None else met.name,
        "bar": None if bars[1] is None else {"at_rest": bars[0], "at_command": bars[1]},
        "softest_direction": softest_words(solution), "frequencies_Hz": solution.frequencies[0],
        "equilibria": None if others is None else SweepRows(others), "barriers": passes,
        "notes": [*notes, *unsought],
    })  # fmt: skip
    with result_in(out, "pose.json") as keep:
        keep(text)
    lines = [
        *untold(notes), *pose_lines(solution, spread=spread),
        *cable_lines(solution, spread=spread),
        *midline_lines(solution), *bar_lines(*bars), *other_lines(solution, others, passes),
        *unsought, after_pose(solution, robot, coordinates[3:], cable, own),
    ]  # fmt: skip
    click.echo(text if as_json else "\n".join(lines))
    return status
