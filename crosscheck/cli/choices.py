"""Options of the commands that compare a model with measurements, and what they keep."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack
from copy import copy
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from seecr.cli import options, results

if TYPE_CHECKING:
    from crosscheck import Addition, Calibrated, Comparison, Diagnosis, Measurements, Plan
    from seecr import Model, Robot
    from seecr.files import Made


robot_and_data = options.together(
    click.argument("robot", type=options.FILE, metavar="ROBOT.xml"),
    click.argument("data", type=options.FILE, nargs=-1, required=True, metavar="DATA.csv..."),
    options.fix,
    options.passive,
)
# what is said of the files in place of their TOML
sigma = options.together(
    options.option(
        "--sigma KIND=0.1mm",
        "Noise of a kind of reading (position, orientation, tension) or of the commanded lengths "
        "(length); may be repeated; overrides [sigma] in the TOML.",
        name="sigmas",
        multiple=True,
    ),
    options.columns,
)
tolerance = options.option(
    "--tolerance 0.1mm",
    "Unexplained errors beyond the noise matter from this rms size on, such as 0.1mm, 0.05deg or "
    "1N; may be repeated.  [default: half the noise]",
    name="tolerances",
    multiple=True,
)
considered = options.together(
    options.words_option(
        "--only EFFECT,...",
        "Consider only these effects, in addition to those of the model; may be repeated.",
    ),
    options.words_option("--exclude EFFECT,...", "Do not consider these effects."),
)
grown_model = options.option(
    "--model M.toml", "The model; created if it does not exist.", required=True
)
workers = options.together(
    options.option(
        "--jobs N",
        "Number of parallel processes.  [default: one per processor]",
        options.WholeNumber(min=1),
    ),
    options.scheduler,
)
figures = options.option("--figures DIR", "Folder for the page's figures, as SVG and PNG.")


def check_effects(*names: Sequence[str]) -> None:
    """Check that there are effects of all these names.

    Raises:
        InputError: there is none of a name; the known ones are listed, nearest first.
    """
    from seecr import effect_named

    for name in (name for some in names for name in some):
        effect_named(name)


def measured_by(
    robot: Path, data: Sequence[Path], sigmas: Sequence[str]
) -> tuple[Robot, Measurements]:
    """The robot and the measurements of a command, with the noise of ``--sigma``."""
    from crosscheck import Sigma, load_measurements
    from seecr.cli.arguments import robot_at

    machine = robot_at(robot)
    return machine, load_measurements(data, machine, sigma=Sigma.parsed(sigmas))


def keep_page(
    found: Comparison | Diagnosis | Plan, folder: Path, name: str, text: Iterable[str], made: Made,
    figures: Path | None, recorded: bool = False,
) -> None:  # fmt: skip
    """Write a result's files into a folder: its JSON, its page and, if any, its recording.

    The page's figures are kept elsewhere too, if anywhere: all of them or none.
    """
    from crosscheck.show.figures import keeping
    from crosscheck.show.pictures import write_page
    from seecr.files import write_text
    from seecr.folders import staged

    write_text(folder / f"{name}.json", text)
    with ExitStack() as meanwhile:
        if figures is not None:
            meanwhile.enter_context(keeping(meanwhile.enter_context(staged(figures, "--figures"))))
        write_page(found, folder / f"{name}.html", made)
        if recorded:
            found.save_recording(folder / f"{name}.rrd")


def model_or_new(path: Path, robot: Robot) -> Model:
    """The model that a file holds; one without effects if there is no such file."""
    from seecr import load_model, new_model

    return load_model(path, robot) if path.exists() else new_model(robot)


def untold(found: Any) -> Any:
    """The same result without the notes about the robot, which were told before."""
    out = copy(found)
    object.__setattr__(out, "notes", type(found.notes)(results.untold(found.notes)))
    return out


def keep_grown(
    found: Addition | Calibrated, model: Path, replaces: str, written: bool, made: Made,
    keep: Callable[[str], None], more: Mapping[str, Any],
) -> str:  # fmt: skip
    """Keep what was found, and the model if it is ``written``; returns the JSON that was kept.

    Args:
        found: with its model. model: the file for that; replaces: its state when it was read.
        made: of the files as they were read.
        keep: keeps the JSON, see :func:`seecr.cli.results.result_in`. more: for the JSON too.
    """
    from crosscheck import save_model
    from seecr.files import json_text

    said = {"made": made, "written": written, "model": str(model), **found.as_json(), **more}
    text = json_text(said)
    keep(text)
    if written:
        save_model(model, found.model, replaces)
    return text
