"""Write docs/api.md: every public name of both packages, from their own docstrings.

    python scripts/make_api.py

A test runs :func:`page` and goes red where the page is out of date.
"""

from __future__ import annotations

import inspect
import re
import sys
from collections.abc import Iterator
from enum import Enum
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

from link_words import with_links

PAGE = Path(__file__).resolve().parents[1] / "docs" / "api.md"
PACKAGES = ("crosscheck", "seecr")

_HEAD = """# Names for Python

What `import crosscheck` and `import seecr` give; a module is imported when one of its names is
first used. Every result prints as a few readable lines, shows itself in a notebook, and gives a
data frame with `to_frame()`: pyarrow's `Table`, or pandas' `DataFrame` where there is no pyarrow.
SI and radians throughout; quaternions are scalar first.

Paths and loaded objects both work. `GivenRobot` is a `Robot`, the path of its MJCF, or the name of
a shipped one; `GivenModel` and `GivenEffects` are a `Model`, the path of its TOML, or a list of
`Term`s; `GivenData` is `Measurements`, their file, or several files; `GivenCommands` is poses
(n, 7), a file of commands, or what was read from it; `GivenCase` is a case of the suite, the name
of shipped ones or a pattern such as `"cogiro-*"`, or a robot.

Written by `scripts/make_api.py` from the docstrings. Words that are ours are in the
[glossary](glossary.md).
"""
# Sections of a docstring, each with lines "name: words".
_SECTIONS = ("Args", "Attributes", "Raises", "Returns", "Yields")


def page() -> str:
    """The page's text."""
    parts = [_HEAD]
    for package in PACKAGES:
        face = import_module(package)
        parts += [f"## {package}\n", *_entries(face)]
    return with_links("\n".join(parts))


def _entries(face: ModuleType) -> Iterator[str]:
    """Functions first, then classes, each by name."""
    names = sorted(face.__all__, key=lambda name: (inspect.isclass(getattr(face, name)), name))
    for name in names:
        found = getattr(face, name)
        yield f"### {face.__name__}.{name}\n"
        if not inspect.isclass(found):
            yield f"```python\n{name}{_signature(found)}\n```\n"
        yield from _words(inspect.getdoc(found) or "")
        if inspect.isclass(found) and issubclass(found, Enum):
            yield "".join(f"- `{one.name}`: {one.value}\n" for one in found)
        elif inspect.isclass(found):
            yield from _members(found)


def _signature(function: Any) -> str:
    """A function's parameters, one on each line where they are many."""
    signature = inspect.signature(function)
    out: list[str] = []
    for one in signature.parameters.values():
        if one.kind is one.KEYWORD_ONLY and "*" not in out:
            out.append("*")
        out.append(_parameter(one))
    result = f" -> {_plain(signature.return_annotation)}"
    short = f"({', '.join(out)}){result}"
    return short if len(short) < 80 else "(\n" + "".join(f"    {o},\n" for o in out) + f"){result}"


def _parameter(one: inspect.Parameter) -> str:
    if one.default is one.empty:
        return f"{one.name}: {_plain(one.annotation)}"
    default = "..." if callable(one.default) else repr(one.default)
    return f"{one.name}: {_plain(one.annotation)} = {default}"


def _plain(annotation: Any) -> str:
    """An annotation as it is written in the source."""
    return annotation if isinstance(annotation, str) else getattr(annotation, "__name__", "None")


def _words(docstring: str) -> Iterator[str]:
    """A docstring as Markdown: paragraphs as they are, sections as lists."""
    for paragraph in docstring.split("\n\n"):
        head, _, rest = paragraph.partition("\n")
        if head.rstrip(":") in _SECTIONS and head.endswith(":"):
            yield from () if head in ("Args:", "Attributes:") else (f"{head}\n",)
            yield "\n".join(_items(rest)) + "\n"
        else:
            yield _linked(inspect.cleandoc(paragraph)) + "\n"


def _items(text: str) -> list[str]:
    """List items of a section; a line that is indented further goes on with its item."""
    items: list[str] = []
    for line in inspect.cleandoc(text).split("\n"):
        if line.startswith(" ") and items:
            items[-1] += f" {line.strip()}"
            continue
        name, colon, words = line.partition(":")
        items.append(f"- `{name}`:{words}" if colon else f"- {line}")
    return [_linked(item) for item in items]


def _linked(text: str) -> str:
    """Markdown for what Sphinx writes otherwise."""
    text = re.sub(r":\w+:`~?([^`]*)`", r"`\1`", text)
    return text.replace("``", "`")


def _members(found: type) -> Iterator[str]:
    """What a class has beside its attributes, with the first line of each."""
    lines = []
    for name, member in sorted(vars(found).items()):
        function = member.fget if isinstance(member, property) else member
        function = getattr(function, "__func__", function)
        words = inspect.getdoc(function) if callable(function) else None
        if name.startswith("_") or not words:
            continue
        call = "" if isinstance(member, property) else "()"
        lines.append(f"- `.{name}{call}`: {_linked(words.split(chr(10))[0])}")
    if lines:
        yield "\n".join(lines) + "\n"


if __name__ == "__main__":
    part = PAGE.with_suffix(".md.part")
    part.write_text(page(), encoding="utf-8")
    part.replace(PAGE)
    names = sum(len(import_module(package).__all__) for package in PACKAGES)
    sys.stdout.write(f"{PAGE.name}: {names} names\n")
