"""Several files of one robot as one: days, payloads, trackers set up anew."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from crosscheck.measurements.data import Measurements, Names, Sigma
from crosscheck.measurements.notice import twice
from seecr.commands import Loads
from seecr.errors import InputFileError
from seecr.pose import Array, rxyz_from_quat

# Relative noise of lengths in files that state none, if others do: practically zero.
_EXACT = 1e-6


def together(parts: Sequence[Measurements]) -> Measurements:
    """The measurements of several files, with separate runs, clocks and noise.

    Args:
        parts: each as read from its file.

    Raises:
        InputFileError: a file given twice, or commands of another kind than in the first.
    """
    first = parts[0]
    if len(parts) == 1:
        return first
    _check_alike(parts)
    names = _short_names([part.path for part in parts])
    sigma, ratio, said = _noise(parts, names)
    pairs = zip(parts, names, strict=True)
    notes = [f"{name}: {note}" for part, name in pairs for note in part.notes]
    t_s, lost_times = _of_all("t_s", [part.t_s for part in parts], names)
    free = _free(parts)
    warmth, lost_warmth = _of_all("temperature_C", [part.temperature_C for part in parts], names)
    quat, angles = _orientations(parts)
    whole = Measurements(
        path=Path(" + ".join(names)),
        n_cables=first.n_cables,
        run=_runs(parts, names),
        t_s=t_s,
        command_pose=_stack([part.command_pose for part in parts]),
        command_lengths=_stack([part.command_lengths for part in parts]),
        told=first.told,
        wanted=_wanted(parts),
        position=np.concatenate([part.position for part in parts]),
        quat_wxyz=quat,
        angles_rad=angles,
        tensions=np.concatenate([part.tensions for part in parts]),
        temperature_C=warmth,
        loads=_loads(parts),
        stands=np.concatenate([part.stands for part in parts]),
        free=tuple(free),
        free_in=free,
        sigma=sigma,
        sigma_source=_source(parts),
        sigma_ratio=ratio,
        files=tuple(names),
        origins=tuple(_short_names([part.path.resolve() for part in parts], 2)),
        file=np.repeat(np.arange(len(parts)), [part.n_rows for part in parts]),
        line=np.concatenate([part.line for part in parts]),
        unused_columns=tuple(dict.fromkeys(name for part in parts for name in part.unused_columns)),
        notes=(*notes, *said, *lost_times, *lost_warmth),
    )
    # repetitions within a file are in its own notes already
    own = any(twice(part) for part in parts)
    return whole if own else whole.with_notes(twice(whole))


def _free(parts: Sequence[Measurements]) -> dict[str, tuple[int, ...]]:
    """The files that leave each effect free; each file has values of its own."""
    names = dict.fromkeys(name for part in parts for name in part.free)
    return {name: tuple(k for k, part in enumerate(parts) if name in part.free) for name in names}


def _check_alike(parts: Sequence[Measurements]) -> None:
    first, seen = parts[0], set()
    for part in parts:
        place = part.path.resolve()
        if place in seen:
            raise InputFileError.at(part.path, "is given twice; expected each file once")
        seen.add(place)
        if _commanded_in(part) != _commanded_in(first):
            raise InputFileError.at(
                part.path,
                f"commands {_commanded_in(part)}, but {first.path} {_commanded_in(first)}; "
                "expected files with the same kind of commands; use them one at a time",
            )


def _commanded_in(data: Measurements) -> str:
    if data.command_lengths is None:
        return "poses"
    return "told lengths" if data.told else "absolute lengths"


def _short_names(paths: Sequence[Path], least: int = 1) -> list[str]:
    """Names that tell files apart, with as many folders as necessary."""
    for depth in range(least, max(len(path.parts) for path in paths) + 1):
        names = ["/".join(path.parts[-depth:]) for path in paths]
        if len(set(names)) == len(names):
            return names
    return [str(path) for path in paths]


def _runs(parts: Sequence[Measurements], names: Sequence[str]) -> Names:
    pairs = zip(parts, names, strict=True)
    return np.concatenate([np.char.add(f"{name}: ", part.run) for part, name in pairs])


def _stack(columns: Sequence[Array | None]) -> Array | None:
    there = [column for column in columns if column is not None]
    return np.concatenate(there) if len(there) == len(columns) else None


def _wanted(parts: Sequence[Measurements]) -> Array | None:
    """Wanted poses of all files; NaN in those that state none, None if none does."""
    if all(part.wanted is None for part in parts):
        return None
    blank = [np.full((part.n_rows, 7), np.nan) for part in parts]
    pairs = zip(parts, blank, strict=True)
    return np.concatenate([b if part.wanted is None else part.wanted for part, b in pairs])


def _of_all(
    what: str, columns: Sequence[Array | None], names: Sequence[str]
) -> tuple[Array | None, list[str]]:
    """A column of all files, or None if some file lacks it; and a note about that."""
    without = [name for name, column in zip(names, columns, strict=True) if column is None]
    if not without or len(without) == len(columns):
        return _stack(columns), []
    return None, [f"{', '.join(without)} without {what}: that of the others is not used."]


def _orientations(parts: Sequence[Measurements]) -> tuple[Array | None, Any]:
    """Quaternions, or angles if some file has only these."""
    if any(part.angle_mask.any() for part in parts):
        turned = [
            part.angles_rad if part.quat_wxyz is None else _angles(part.quat_wxyz) for part in parts
        ]
        return None, np.concatenate(turned)
    if all(part.quat_wxyz is None for part in parts):
        return None, None
    blank = [np.full((part.n_rows, 4), np.nan) for part in parts]
    pairs = zip(parts, blank, strict=True)
    return np.concatenate([b if p.quat_wxyz is None else p.quat_wxyz for p, b in pairs]), None


def _angles(quat: Array) -> Array:
    known = np.asarray(np.isfinite(quat).all(axis=1))
    out = np.full((len(quat), 3), np.nan)
    out[known] = rxyz_from_quat(quat[known])
    return out


def _loads(parts: Sequence[Measurements]) -> Loads | None:
    if all(part.loads is None for part in parts):
        return None
    whole, *others = [part.loads or Loads.of(part.n_rows) for part in parts]
    for other in others:
        whole = whole.followed_by(other)
    return whole


def _noise(parts: Sequence[Measurements], names: Sequence[str]) -> tuple[Sigma, Array, list[str]]:
    """Noise of the first file that states it, each row's ratio to it, and notes about gaps."""
    kinds = [item.name for item in fields(Sigma)]
    common: dict[str, float] = {}
    ratios = np.ones((len(parts), len(kinds)))
    notes = []
    for k, kind in enumerate(kinds):
        own = [getattr(part.sigma, kind) for part in parts]
        stated = [i for i, value in enumerate(own) if value is not None]
        if not stated:
            continue
        common[kind] = own[stated[0]]
        otherwise = _EXACT if kind == "length_m" else 1.0
        ratios[:, k] = [otherwise if v is None else v / common[kind] for v in own]
        without = [names[i] for i in range(len(parts)) if i not in stated]
        if without:
            notes.append(_taken_over(kind, without, names[stated[0]]))
    return Sigma(**common), np.repeat(ratios, [part.n_rows for part in parts], axis=0), notes


def _source(parts: Sequence[Measurements]) -> str:
    """A lower bound in any file makes the common noise one."""
    found = [part.sigma_source for part in parts if part.sigma.stated]
    return "dwell_scatter" if "dwell_scatter" in found else next(iter(found), "stated")


def _taken_over(kind: str, without: Sequence[str], other: str) -> str:
    if kind == "length_m":
        return f"{', '.join(without)} without {kind}: these lengths are taken as exact."
    return f"{', '.join(without)} without {kind}: that of {other} is used."
