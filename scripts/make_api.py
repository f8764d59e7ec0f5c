"""Write docs/api.md: every public name of both packages, from their own docstrings.

    python scripts/make_api.py

A test runs :func:`page` and goes red where the page is out of date.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Collection, Iterator
from dataclasses import is_dataclass
from enum import Enum
from functools import cached_property
from importlib import import_module
from inspect import Parameter, cleandoc, get_annotations, getdoc, isclass, signature
from math import inf
from pathlib import Path
from textwrap import dedent
from types import ModuleType
from typing import Any

from link_words import with_links

from seecr.result import Result

PAGE = Path(__file__).resolve().parents[1] / "docs" / "api.md"
PACKAGES = ("crosscheck", "seecr")

_HEAD = """# Names for Python

What `import crosscheck` and `import seecr` give; a module is imported when one of its names is
first used. Every result prints as a few readable lines, shows itself in a notebook, and gives a
data frame with `to_frame()`: pyarrow's `Table`, or pandas' `DataFrame` where there is no pyarrow.
`as_json()` gives a dictionary, and `to_json()` its text, with null where a number does not exist.
SI and radians throughout; quaternions are scalar first.

Paths and loaded objects both work. `GivenRobot` is a `Robot`, the path of its MJCF, or the name of
a shipped one; `GivenModel` and `GivenEffects` are a `Model`, the path of its TOML, or a list of
`Term`s; `GivenSeveral` is names of effects, `Term`s, or a result with `.terms`, such as a
diagnosis; `GivenData` is `Measurements`, their file, or several files; `GivenCommands` is poses
(n, 7), `seecr.Commands`, a file of commands, or what was read from it; `Commanded` is poses (n, 7),
`seecr.Commands`, or `Measurements`; `GivenCase` is a case of the suite, the name of shipped ones
or a pattern such as `"cogiro-*"`, or a robot.

Written by `scripts/make_api.py` from the docstrings. Words that are ours are in the
[glossary](glossary.md).
"""
# Sections of a docstring, each with lines "name: words".
_SECTIONS = ("Args", "Attributes", "Class attributes", "Raises", "Returns", "Yields")
_STARS: dict[Any, str] = {Parameter.VAR_POSITIONAL: "*", Parameter.VAR_KEYWORD: "**"}
_NAMES = re.compile(r"^(\w+(?:, \w+)*): ")


def page() -> str:
    """The page's text."""
    parts = [_HEAD]
    for package in PACKAGES:
        face = import_module(package)
        parts += [f"## {package}\n", *_entries(face)]
    return with_links("\n".join(parts))


def _entries(face: ModuleType) -> Iterator[str]:
    """Functions first, then classes, each by name."""
    names = sorted(face.__all__, key=lambda name: (isclass(getattr(face, name)), name))
    for name in names:
        found = getattr(face, name)
        yield f"### {face.__name__}.{name}\n"
        if not isclass(found) or _is_made_by_hand(found):
            yield f"```python\n{name}{_signature(found)}\n```\n"
        yield from as_markdown(getdoc(found) or "", _own_names(found))
        if isclass(found) and issubclass(found, Enum):
            yield "".join(f"- `{one.name}`: {_meaning(one)}\n" for one in found)
        elif isclass(found):
            yield from _members(found)


def _is_made_by_hand(found: type) -> bool:
    """Whether people make such objects: what functions take, all of whose fields are explained."""
    explained = re.findall(r"\w+(?=[^:\n]*:)", getdoc(found) or "")
    if not is_dataclass(found) or issubclass(found, Result):
        return False
    return bool(signature(found).parameters) and set(signature(found).parameters) <= set(explained)


def _signature(function: Any, width: float = 80) -> str:
    """A function's parameters, one on each line where one line is too short for all."""
    called = signature(function)
    out: list[str] = []
    for one in called.parameters.values():
        if one.kind is one.KEYWORD_ONLY and not any(o.startswith("*") for o in out):
            out.append("*")
        if one.name != "self":
            out.append(_parameter(one))
    result = "" if isclass(function) else f" -> {_plain(called.return_annotation)}"
    short = f"({', '.join(out)}){result}"
    if len(short) < width:
        return short
    return "(\n" + "".join(f"    {one},\n" for one in out) + f"){result}"


def _parameter(one: Parameter) -> str:
    named = f"{_STARS.get(one.kind, '')}{one.name}: {_plain(one.annotation)}"
    if one.default is one.empty:
        return named
    default = repr(one.default)
    return f"{named} = {'...' if default[0] == '<' else default}"


def _plain(annotation: Any) -> str:
    """An annotation as it is written in the source."""
    return annotation if isinstance(annotation, str) else getattr(annotation, "__name__", "None")


def _own_names(found: Any) -> Collection[str]:
    """Attributes of a class, parameters of a function."""
    return get_annotations(found) if isclass(found) else signature(found).parameters


def as_markdown(docstring: str, names: Collection[str]) -> Iterator[str]:
    """A docstring as Markdown: paragraphs as they are, sections as lists.

    Args:
        docstring: of a class or function.
        names: of its attributes or parameters; a line may explain several.
    """
    for paragraph in docstring.split("\n\n"):
        head, _, rest = paragraph.partition("\n")
        if head.rstrip(":") in _SECTIONS and head.endswith(":"):
            yield from _section(head, _items(rest, names))
        elif paragraph.startswith("    "):
            yield f"```\n{dedent(paragraph)}\n```\n"
        else:
            yield _linked(cleandoc(paragraph)) + "\n"


def _section(head: str, items: list[str]) -> Iterator[str]:
    """Its items under its head; what is returned, beside it."""
    if head in ("Returns:", "Yields:"):
        yield f"{head} {' '.join(items)}\n"
        return
    if head not in ("Args:", "Attributes:"):
        yield f"{head}\n"
    yield "\n".join(f"- {item}" for item in items) + "\n"


def _items(text: str, names: Collection[str]) -> list[str]:
    """Items of a section; a line that is indented further goes on with its item."""
    one_line = re.sub(r"\n +", " ", dedent(text))
    name = f"(?:{'|'.join(names)})"
    items = re.sub(rf"[.;] ({name}(?:, {name})*: )", r".\n\1", one_line).split("\n")
    return [_linked(_NAMES.sub(_as_code, item)) for item in items]


def _as_code(names: re.Match[str]) -> str:
    return ", ".join(f"`{name}`" for name in names[1].split(", ")) + ": "


def _linked(text: str) -> str:
    """Markdown for what Sphinx writes otherwise."""
    text = re.sub(r":\w+:`~?([^`]*)`", r"`\1`", text)
    return text.replace("``", "`")


def _meaning(one: Enum) -> str:
    """The sentence of a member: its value, or if that is a word of a file what the word means."""
    return str(getattr(one, "meaning", one.value))


def _members(found: type) -> Iterator[str]:
    """What a class has beside its attributes, with the first line of each."""
    lines = []
    for name, member in sorted(vars(found).items()):
        kept = isinstance(member, cached_property)
        function = member.func if kept else getattr(found, name)
        function = member.fget if isinstance(member, property) else function
        text = getdoc(function) if callable(function) else None
        if name.startswith("_") or not text:
            continue
        valued = kept or isinstance(member, property)
        call = "" if valued else _signature(function, inf)
        lines.append(f"- `.{name}{call}`: {_linked(text.split(chr(10))[0])}")
    if lines:
        yield "\n".join(lines) + "\n"


if __name__ == "__main__":
    part = PAGE.with_suffix(".md.part")
    part.write_text(page(), encoding="utf-8")
    part.replace(PAGE)
    names = sum(len(import_module(package).__all__) for package in PACKAGES)
    sys.stdout.write(f"{PAGE.name}: {names} names\n")
