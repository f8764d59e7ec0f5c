"""XML as a tree whose elements know their lines, so that errors can name them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

import numpy as np

from seecr.errors import Faults, InputFileError
from seecr.files import no_text, read_bytes
from seecr.pose import Array, all_finite


@dataclass
class Node:
    """An element.

    Attributes:
        tag: its name. values: its attributes. path: of its file. line: where it begins, from 1.
        children: the elements in it. text: what else is in it.
    """

    tag: str
    values: dict[str, str]
    path: Path
    line: int
    children: list[Node] = field(default_factory=list)
    text: str = ""

    def child(self, tag: str) -> Node | None:
        """The first element in it of that name."""
        return next((one for one in self.children if one.tag == tag), None)

    def empty(self, tag: str) -> Node:
        """An element of that name without anything, in place of one that is not in it."""
        return Node(tag, {}, self.path, self.line)

    def error(self, text: str) -> InputFileError:
        """An error at its line."""
        return InputFileError.at(self.path, text, line=self.line)

    def every(self, tag: str) -> Iterator[Node]:
        """All elements of that name, however deep."""
        for one in self.children:
            if one.tag == tag:
                yield one
            yield from one.every(tag)


def read_xml(path: Path, root: str, expected: str) -> Node:
    """The root element of a file. External files that it names are not read.

    Args:
        path: the file. root: the name that its root must have. expected: for the error.

    Raises:
        InputFileError: no such file, no XML, or another root.
    """
    data = read_bytes(path, expected)
    kind = no_text(data)
    if kind and not kind.startswith("UTF-16"):
        raise InputFileError.at(path, f"is {kind}; {expected}")
    top = Node("", {}, path, 0)
    open_ones = [top]
    parser = expat.ParserCreate()

    def start(tag: str, values: dict[str, str]) -> None:
        node = Node(tag, values, path, parser.CurrentLineNumber)
        open_ones[-1].children.append(node)
        open_ones.append(node)

    def end(_tag: str) -> None:
        open_ones.pop()

    def text(words: str) -> None:
        open_ones[-1].text += words

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler = text
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        why = expat.ErrorString(error.code)
        raise InputFileError.at(path, f"is no XML: {why}; {expected}", line=error.lineno) from None
    found = top.children[0]
    if found.tag != root:
        raise found.error(f"begins with <{found.tag}>; {expected}")
    return found


def numbers_in(node: Node, tag: str, count: int, faults: Faults) -> Array:
    """The numbers (count,) in the element ``tag`` of a node; NaN, and a fault, if it has none."""
    place = node.child(tag)
    if place is None:
        faults.add(node.error(f"<{node.tag}>: expected <{tag}> in it, got none"))
        return np.full(count, np.nan)
    return numbers_of(place, place.text, f"<{tag}>", count, faults)


def numbers_of(node: Node, text: str, what: str, count: int, faults: Faults) -> Array:
    """So many numbers in a text of a node; NaN, and a fault, if it holds something else."""
    try:
        values = np.array([float(word) for word in text.replace(",", " ").split()])
    except ValueError:
        values = np.array([])
    if len(values) != count or not all_finite(values):
        plural = "a number" if count == 1 else f"{count} numbers"
        got = repr(" ".join(text.split())[:40])
        faults.add(node.error(f"{what}: expected {plural}, got {got}"))
        return np.full(count, np.nan)
    return values
