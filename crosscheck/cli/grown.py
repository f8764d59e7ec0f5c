"""Models that a command adds to: read or begun, and kept together with what was found."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from crosscheck import Addition, Calibrated
    from seecr import Model
    from seecr.description.robot import Robot
    from seecr.files import Made


def model_or_new(path: Path, robot: Robot) -> Model:
    """The model that a file holds; one without effects if there is no such file."""
    from seecr import load_model, new_model

    return load_model(path, robot) if path.exists() else new_model(robot)


def keep_grown(
    found: Addition | Calibrated, model: Path, written: bool, made: Made,
    keep: Callable[[str], None], more: Mapping[str, Any] | None = None,
) -> str:  # fmt: skip
    """Keep what was found, and the model if it is ``written``; returns the JSON that was kept.

    Args:
        found: with its model. model: the file for that.
        made: of the files as they were read.
        keep: keeps the JSON, see :func:`crosscheck.cli.choices.result_in`. more: for the JSON too.
    """
    from crosscheck import save_model
    from seecr.files import json_text

    said = {"made": made, "written": written, "model": str(model), **found.as_json()}
    text = json_text({**said, **(more or {})})
    keep(text)
    if written:
        save_model(model, found.model)
    return text
