"""Files are read with the place of what is wrong, and written whole or not at all."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

import numpy as np
import pytest

from seecr import solve
from seecr.errors import InputFileError
from seecr.files import (
    check_writable,
    json_text,
    plain,
    read_bytes,
    read_text,
    read_toml,
    with_toml,
    write_text,
    write_texts,
    written,
)
from seecr.show.sweep_recording import write_sweep_recording


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


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ("[" * 3000 + "]" * 3000, "nests too deeply; expected a model"),
        ("1" * 5000, "has a whole number of thousands of digits; expected a model"),
    ],
)
def test_toml_that_no_reader_can_take_is_refused(tmp_path: Path, value: str, words: str) -> None:
    path = tmp_path / "a.toml"
    path.write_text(f"a = {value}\n")
    with pytest.raises(InputFileError) as caught:
        read_toml(path, "expected a model")
    assert str(caught.value) == f"{path}: {words}"


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


def test_toml_knows_the_lines_of_keys_and_tables(tmp_path: Path) -> None:
    path = tmp_path / "a.toml"
    path.write_text("# size = 0\nother_size = 1\n\n[big]\nsize = 2\ninline = { deep = 3 }\n")
    toml = read_toml(path, "")
    assert toml.content["big"]["inline"] == {"deep": 3}
    lines = {key: toml.line_of(key) for key in ("size", "big", "deep", "other_size", "absent")}
    assert lines == {"size": 5, "big": 4, "deep": 6, "other_size": 2, "absent": None}
    assert str(toml.error("too much", "size")) == f"{path}: line 5: too much"
    assert str(toml.error("too much")) == f"{path}: too much"


def test_broken_toml_names_its_line_and_what_was_expected(tmp_path: Path) -> None:
    path = tmp_path / "a.toml"
    path.write_text("a = 1\nb = \n")
    with pytest.raises(InputFileError, match=r"a\.toml: is not TOML: .*line 2.*; expected sizes$"):
        read_toml(path, "expected sizes")


def test_files_written_together_are_all_old_or_all_new(tmp_path: Path) -> None:
    first, second = tmp_path / "a", tmp_path / "b"
    write_texts({first: "old\n", second: "old µ\n"})
    assert second.read_bytes() == "old µ\n".encode()
    with pytest.raises(ZeroDivisionError), written(first, second) as (part, _other):
        part.write_text("new")
        raise ZeroDivisionError
    blocked = tmp_path / "folder"
    blocked.mkdir()
    with pytest.raises(InputFileError, match="folder: cannot do it: Is a directory"):
        write_texts({first: "new", blocked: "new"}, failure="cannot do it")
    assert first.read_text() == second.read_text().replace(" µ", "") == "old\n"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a", "b", "folder"]


def test_a_folder_that_is_not_there_is_said(tmp_path: Path) -> None:
    with pytest.raises(InputFileError, match=r"gone/a: cannot be written: No such file"):
        write_text(tmp_path / "gone" / "a", "text")


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="Linux's own folder")
def test_what_permissions_allow_may_still_not_be_written() -> None:
    with pytest.raises(InputFileError, match=r"cannot be written: /proc is no"):
        check_writable(Path("/proc/none/model.toml"))


class Colour(Enum):
    """Values are what people read, names what files hold."""

    PALE_BLUE = "a pale blue"


class Thing:
    """Says itself what it is."""

    def as_json(self) -> dict[str, object]:
        return {"colour": Colour.PALE_BLUE, "size": np.float64("inf")}


def test_json_has_null_for_what_is_not_finite() -> None:
    document = {
        "array": np.array([[1.0, np.nan], [-np.inf, 2.5]]),
        "scalar": np.float32(0.5),
        "flag": np.bool_(True),
        "mixed": (1, "ä", None, float("nan")),
        3: Thing(),
    }
    read = json.loads(json_text(document))
    assert read["array"] == [[1.0, None], [None, 2.5]]
    assert (read["scalar"], read["flag"]) == (0.5, True)
    assert read["mixed"] == [1, "ä", None, None]
    assert read["3"] == {"colour": "pale_blue", "size": None}
    assert "ä" in json_text(document) and "\n" not in json_text(document, indent=None)
    assert plain(np.array(["a"])) == ["a"]


def test_commands_are_read_with_the_toml_beside_them() -> None:
    assert with_toml(None) == []
    assert with_toml(Path("a/poses.csv")) == [Path("a/poses.csv"), Path("a/poses.toml")]


# --- On a full disk nothing is half written, and the whole results of before stay


_SWEEP = "seecr sweep planar_vertical --line 0.3 0 0.2 0.5 0 0.2 --count 5 --out"


@pytest.fixture
def small(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Path]:
    """A disk of so many kB."""
    words = ["mount", "-t", "tmpfs", "-o", f"size={request.param}k", "tmpfs", str(tmp_path)]
    try:
        done = subprocess.run(words, capture_output=True, check=False).returncode
    except OSError:
        done = 1
    if done:
        pytest.skip("no disk of a given size may be mounted here")
    try:
        yield tmp_path
    finally:
        subprocess.run(["umount", str(tmp_path)], check=False)


@pytest.mark.slow
@pytest.mark.parametrize("small", [100, 200, 340], indirect=True)
def test_a_full_disk_is_said_and_leaves_nothing(small: Path) -> None:
    words = [sys.executable, "-m", *_SWEEP.split(), str(small / "o")]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 2, done.stderr
    last = done.stderr.splitlines()[-1]
    assert (last.startswith(f"seecr: {small}/o/sweep.") and "disk full" in last) or "space" in last
    assert list(small.iterdir()) == []


def test_a_recording_that_cannot_be_written_replaces_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.rrd"
    found = solve("planar_vertical", [[0.4, 0, 0.2, 1, 0, 0, 0]])
    write_sweep_recording(found, path, True)
    whole = path.read_bytes()
    write = Path.write_bytes

    def full(part: Path, data: bytes) -> int:
        write(part, data[: len(data) // 2])
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(InputFileError, match=r"a\.rrd: cannot write the recording: No space left"):
        write_sweep_recording(found, path, True)
    assert path.read_bytes() == whole and [*tmp_path.iterdir()] == [path]
