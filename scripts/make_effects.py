"""Write the tables of docs/effects.md from the sources: effects, and what they can edit.

    python scripts/make_effects.py

A test runs :func:`with_tables` and goes red where a table is out of date.
"""

from __future__ import annotations

import inspect
import json
import sys
from dataclasses import fields
from pathlib import Path

import numpy as np

from crosscheck.show.effects import EACH
from seecr.effects import BUILT_IN, PLACES, Effect
from seecr.effects.setup import QUANTITIES, History

PAGE = Path(__file__).resolve().parents[1] / "docs" / "effects.md"
NUMBERS = PAGE.parent / "pictures" / "effects" / "numbers.json"


def quantities() -> str:
    """One Markdown table: what each quantity of a setup is, its shape and its plain value."""
    lines = ["| quantity | shape | unit | plain | what it is |", "|---|---|---|---|---|"]
    for name, item in QUANTITIES.items():
        shape = ", ".join({"rows": "n", "cables": "m"}.get(str(s), str(s)) for s in item.shape)
        plain = f"the robot's `{item.plain}`" if isinstance(item.plain, str) else f"{item.plain:g}"
        history = "" if item.history is History.NONE else f"; history: {item.history.value}"
        lines.append(
            f"| `{name}` | {f'({shape})' if shape else 'one'} | {item.unit} | {plain} | "
            f"{item.what}{history} |"
        )
    return "\n".join([*lines, ""])


def effects() -> str:
    """One Markdown table per place: name, parameters, own docstring; then their pictures."""
    lines = []
    for place in PLACES:
        lines += [f"### {place}", "", "| effect | parameters | what it is |", "|---|---|---|"]
        for effect in BUILT_IN:
            if effect.place == place:
                lines.append(f"| `{effect.name}` | {_parameters(effect)} | {_words(effect)} |")
        lines.append("")
        lines += [_picture(effect) for effect in BUILT_IN if effect.place == place]
    return "\n".join(lines)


def with_tables(page: str) -> str:
    """The page with fresh tables between their marks."""
    for name, table in (("quantities", quantities()), ("effects", effects())):
        begin, end = f"<!-- {name}: begin -->", f"<!-- {name}: end -->"
        before, rest = page.split(begin)
        page = f"{before}{begin}\n\n{table}\n{end}{rest.split(end)[1]}"
    return page


def _parameters(effect: type[Effect]) -> str:
    parts = []
    for item in fields(effect):
        meta = item.metadata
        unit = meta["unit"].replace("_per_", "/") or "no unit"
        notes = [unit + EACH[meta["size"]]]
        if meta["null"] != 0.0:
            notes.append(f"{'start' if meta['shape'] else 'absent at'} {meta['null']:g}")
        limits = [b for b in meta["bounds"] if not callable(b)]
        if len(limits) == 2 and np.all(np.isfinite(limits)):
            notes.append(f"{limits[0]:g} to {limits[1]:g}")
        if meta["shape"]:
            notes.append("shapes the others")
        parts.append(f"`{item.name}` ({'; '.join(notes)})")
    return "<br>".join(parts)


def _picture(effect: type[Effect]) -> str:
    """What it does to a sweep, drawn by draw_effects.py, and in words."""
    found = json.loads(NUMBERS.read_text(encoding="utf-8"))[effect.name]
    size = "at its expected size" if found["times"] == 1 else "at ten times its expected size"
    kinds = (("position_mm", "mm"), ("orientation_deg", "°"), ("tension_N", "N"))
    most = " and ".join(f"{found[k]:.2g} {unit}" for k, unit in kinds if k in found)
    most = most.replace(" °", "°")
    said = f"**`{effect.name}`** {size} on `{found['robot']}`: up to {most}."
    drawn = f"pictures/effects/{effect.name}.svg"
    return f"{said}\n\n![What {effect.name} does to a sweep along x]({drawn})\n"


def _words(effect: type[Effect]) -> str:
    paragraphs = (inspect.getdoc(effect) or "").split("\n\n")
    return "<br>".join(" ".join(p.split()) for p in paragraphs).replace("|", "\\|")


if __name__ == "__main__":
    fresh = with_tables(PAGE.read_text(encoding="utf-8"))
    part = PAGE.with_suffix(".md.part")
    part.write_text(fresh, encoding="utf-8")
    part.replace(PAGE)
    sys.stdout.write(f"{PAGE.name}: {len(BUILT_IN)} effects\n")
