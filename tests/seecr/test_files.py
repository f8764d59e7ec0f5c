"""Reading files of the user's: one line about what is wrong."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import pytest

from seecr.errors import InputFileError
from seecr.files import plain, read_bytes, read_text


def test_text_is_read_without_its_mark_and_with_plain_line_ends(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_bytes("\ufeffµ\r\nb\rc\n".encode())
    assert read_text(path, "") == "µ\nb\nc\n"
    assert read_bytes(path, "").startswith(b"\xef\xbb\xbf")


def test_what_cannot_be_read_is_named_with_what_was_expected(tmp_path: Path) -> None:
    latin = tmp_path / "latin.txt"
    latin.write_bytes(b"caf\xe9")
    for path, words in (
        (tmp_path / "gone", "no such file; expected a list"),
        (tmp_path, "cannot be read: Is a directory; expected a list"),
        (latin, "is not UTF-8 (byte number 4); expected a list"),
    ):
        with pytest.raises(InputFileError) as caught:
            read_text(path, "expected a list")
        assert str(caught.value) == f"{path}: {words}" and caught.value.exit_status == 2


def test_in_json_a_dataclass_is_its_fields_unless_it_says_itself() -> None:
    @dataclass
    class Part:
        size: float

    @dataclass
    class Whole:
        part: Part
        other: int = 3

        def as_json(self) -> dict[str, object]:
            return {"part": self.part}

    assert plain(Whole(Part(math.inf))) == {"part": {"size": None}}
