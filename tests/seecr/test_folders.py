"""Folders of results: foreign files stay, and what is read together was written together."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from seecr import InputFileError
from seecr.files import digits_of
from seecr.folders import MANIFEST, check_together, finish_moves, folder_lock, staged


def names_in(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir() if path.name != MANIFEST)


def write(out: Path, contents: dict[str, str], **how: object) -> None:
    with staged(out, **how) as folder:  # type: ignore[arg-type]
        for name, text in contents.items():
            (folder / name).write_text(text)


def test_what_was_read_is_not_overwritten(tmp_path: Path) -> None:
    """A sweep of the commands of sweep.csv, written to its own folder, had lost its readings."""
    measured, other = tmp_path / "sweep.csv", tmp_path / "other.csv"
    measured.write_text("readings")
    refused = pytest.raises(InputFileError, match=r"sweep\.csv: would be overwritten, but was")
    with refused, staged(tmp_path, read=[None, measured]) as folder:
        (folder / "other.csv").write_text("new")
        (folder / "sweep.csv").write_text("new")
    assert measured.read_text() == "readings" and not other.exists()
    other.write_text("poses")
    with refused, staged(tmp_path, read=[other, measured]) as folder:
        (folder / "sweep.csv").write_text("new")


def test_what_was_read_is_not_removed(tmp_path: Path) -> None:
    """`correct` had removed its own input, which only some of its results would have replaced."""
    wanted = tmp_path / "corrected.csv"
    wanted.write_text("poses")
    worked = False
    refused = pytest.raises(InputFileError, match=r"corrected\.csv: would be overwritten, but was")
    read = [None, tmp_path / "no.toml", wanted]
    with refused, staged(tmp_path, sometimes=["corrected.csv"], read=read):
        worked = True
    assert not worked and [file.name for file in tmp_path.iterdir()] == ["corrected.csv"]


@pytest.mark.parametrize("made", ["results", ".unfinished"])
def test_whoever_ends_the_program_as_a_folder_is_made_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, made: str
) -> None:
    """A signal came between the making of the folder and what removes it, once in many runs."""
    make = os.mkdir

    def ended(path: str, mode: int = 0o777) -> None:
        make(path, mode)
        if Path(path).name.startswith(made):
            raise KeyboardInterrupt

    monkeypatch.setattr(os, "mkdir", ended)
    with pytest.raises(KeyboardInterrupt), staged(tmp_path / "results"):
        pytest.fail("nothing is written")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("how", ["names", "sometimes"])
def test_what_no_command_wrote_is_neither_replaced_nor_removed(tmp_path: Path, how: str) -> None:
    mine = tmp_path / "sweep.png"
    mine.write_text("mine")
    write(tmp_path, {"sweep.csv": "1"}, sometimes=["sweep.png"])
    assert mine.read_text() == "mine"
    refused = pytest.raises(InputFileError, match=r"sweep\.png: would be over.*no command wrote it")
    with refused:
        write(tmp_path, {"sweep.csv": "2", "sweep.png": "theirs"}, **{how: ["sweep.png"]})
    assert mine.read_text() == "mine" and (tmp_path / "sweep.csv").read_text() == "1"
    assert names_in(tmp_path) == ["sweep.csv", "sweep.png"]


def test_a_file_that_will_be_written_is_refused_before_the_work(tmp_path: Path) -> None:
    (tmp_path / "a.json").write_text("mine")
    (tmp_path / "b.json").write_text("mine")
    refused = pytest.raises(InputFileError, match=r"a\.json: would.*\(also b\.json\); move it away")
    with refused, staged(tmp_path, names=["a.json", "b.json"]):
        pytest.fail("no work is done")
    assert names_in(tmp_path) == ["a.json", "b.json"]


def test_an_older_result_is_replaced_and_what_it_alone_had_is_removed(tmp_path: Path) -> None:
    write(tmp_path, {"a.json": "1", "a.png": "1"})
    write(tmp_path, {"a.json": "2"}, names=["a.json"], sometimes=["a.png"])
    assert names_in(tmp_path) == ["a.json"] and (tmp_path / "a.json").read_text() == "2"
    assert [*json.loads((tmp_path / MANIFEST).read_text())["files"]] == ["a.json"]


def test_a_result_that_somebody_changed_is_his(tmp_path: Path) -> None:
    write(tmp_path, {"measured.csv": "1", "a.png": "1"})
    for name in ("measured.csv", "a.png"):
        (tmp_path / name).write_text("changed by hand")
    with pytest.raises(InputFileError, match="was changed after a command wrote it"):
        write(tmp_path, {"measured.csv": "2"}, sometimes=["a.png"])
    write(tmp_path, {"b.csv": "2"}, sometimes=["a.png"])
    assert names_in(tmp_path) == ["a.png", "b.csv", "measured.csv"]


def test_a_copy_of_what_is_there_already_leaves_it_the_users(tmp_path: Path) -> None:
    (tmp_path / "robot.xml").write_text("robot")
    write(tmp_path, {"robot.xml": "robot", "measured.csv": "1"})
    write(tmp_path, {"measured.csv": "2"}, sometimes=["robot.xml"])
    assert names_in(tmp_path) == ["measured.csv", "robot.xml"]


@pytest.mark.parametrize(
    "manifest", ["", "[]", "{}", '{"files": [1]}', '{"files": {"a": 3}}', "\0"]
)
def test_a_manifest_that_cannot_be_read_owns_nothing(tmp_path: Path, manifest: str) -> None:
    (tmp_path / MANIFEST).write_text(manifest)
    (tmp_path / "a").write_text("mine")
    with pytest.raises(InputFileError, match="no command wrote it"):
        write(tmp_path, {"a": "2"})
    write(tmp_path, {"b": "2"})
    assert names_in(tmp_path) == ["a", "b"]


# Writes a result of two files, and is killed as the file of this name is moved.
_KILLED = """
import os, sys
from pathlib import Path
from seecr.folders import staged
replace = Path.replace
def killed(self, target):
    if Path(target).name == sys.argv[2] and self.parent.name.startswith(".unfinished"):
        os._exit(9)
    return replace(self, target)
Path.replace = killed
with staged(sys.argv[1], sometimes=["old"]) as folder:
    (folder / "a.csv").write_text("new")
    (folder / "a.toml").write_text("new")
"""


@pytest.mark.parametrize("at", ["moves.json", "a.csv", "a.toml", MANIFEST])
@pytest.mark.parametrize("then", ["write", "read"])
def test_a_kill_leaves_the_old_result_or_the_new_one(tmp_path: Path, at: str, then: str) -> None:
    write(tmp_path, {"a.csv": "old", "a.toml": "old", "old": "old"})
    done = subprocess.run([sys.executable, "-c", _KILLED, str(tmp_path), at], check=False)
    assert done.returncode == 9
    if then == "write":
        write(tmp_path, {"b": "1"})
        (tmp_path / "b").unlink()
    else:
        check_together(tmp_path / "a.csv", tmp_path / "a.toml")
    finished = at != "moves.json"
    kept = ["a.csv", "a.toml"] if finished else ["a.csv", "a.toml", "old"]
    assert names_in(tmp_path) == kept
    assert {(tmp_path / name).read_text() for name in kept} == {"new" if finished else "old"}
    write(tmp_path, {"a.csv": "newest"})  # it is still known as ours


def test_a_disk_that_fails_as_files_are_moved_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write(tmp_path, {"a.csv": "old", "a.toml": "old"})
    replace = Path.replace

    def broken(self: Path, target: Path) -> Path:
        if Path(target) == tmp_path / "a.toml":
            raise OSError(5, "Input/output error")
        return replace(self, target)

    monkeypatch.setattr(Path, "replace", broken)
    with pytest.raises(InputFileError, match=r"not all files .* Input/output error; the next comm"):
        write(tmp_path, {"a.csv": "new", "a.toml": "new"})
    monkeypatch.undo()
    check_together(tmp_path / "a.csv", tmp_path / "a.toml")
    assert (tmp_path / "a.toml").read_text() == (tmp_path / "a.csv").read_text() == "new"
    assert names_in(tmp_path) == ["a.csv", "a.toml"]


def test_a_folder_that_is_being_written_is_left_alone(tmp_path: Path) -> None:
    with staged(tmp_path) as folder:
        (folder / "a").write_text("half")
        write(tmp_path, {"b": "1"})
        check_together(tmp_path / "b")
        assert (folder / "a").read_text() == "half"
    assert names_in(tmp_path) == ["a", "b"]


def test_files_of_two_results_are_not_read_together(tmp_path: Path) -> None:
    write(tmp_path, {"a.csv": "1"})
    write(tmp_path, {"a.toml": "2"})
    with pytest.raises(InputFileError, match=r"a\.csv: a\.csv and a\.toml belong to two results"):
        check_together(tmp_path / "a.csv", tmp_path / "a.toml")
    (tmp_path / "a.toml").write_text("somebody's own")
    check_together(tmp_path / "a.csv", tmp_path / "a.toml", tmp_path / "none")


_MANY = """
import sys
import threading
import time
from seecr.folders import staged
for turn in range(12):
    with staged(sys.argv[1], sometimes=["maybe"]) as folder:
        for name in ("one", "two", "maybe")[: 2 + turn % 2]:
            (folder / name).write_text(f"{sys.argv[2]} {turn}")
"""


def test_commands_at_once_in_one_folder_leave_one_result(tmp_path: Path) -> None:
    many = [
        subprocess.Popen([sys.executable, "-c", _MANY, str(tmp_path), str(i)]) for i in range(6)
    ]
    assert [one.wait() for one in many] == [0] * 6
    assert set(names_in(tmp_path)) <= {"one", "two", "maybe"}
    assert len({path.read_text() for path in tmp_path.glob("[otm]*")}) == 1


def test_output_folder_is_complete_or_untouched(tmp_path: Path) -> None:
    out = tmp_path / "a" / "b"
    with pytest.raises(RuntimeError), staged(out) as folder:
        (folder / "x").write_text("half")
        raise RuntimeError
    assert not (tmp_path / "a").exists()
    with staged(out) as folder:
        (folder / "x").write_text("whole")
    assert names_in(out) == ["x"]
    with pytest.raises(RuntimeError), staged(out) as folder:
        (folder / "x").write_text("half")
        raise RuntimeError
    assert names_in(out) == ["x"]
    assert (out / "x").read_text() == "whole"


def test_a_command_waits_while_another_moves_its_files(tmp_path: Path) -> None:
    """One of 100 commands, 8 at once, was told that the other's file was not this program's."""
    out = tmp_path / "out"
    with staged(out, names={"a.txt"}) as folder:
        (folder / "a.txt").write_text("first")
    ended = []

    def other() -> None:
        with staged(out, names={"a.txt"}) as folder:
            (folder / "a.txt").write_text("third")
        ended.append(True)

    with folder_lock(out):
        (out / "a.txt").write_text("second")  # it is moved, and the manifest is not yet
        thread = threading.Thread(target=other)
        thread.start()
        time.sleep(0.2)
        manifest = json.loads((out / MANIFEST).read_text())
        manifest["files"]["a.txt"]["sha256"] = digits_of(out / "a.txt")
        (out / MANIFEST).write_text(json.dumps(manifest))
    thread.join(10.0)
    assert ended == [True] and (out / "a.txt").read_text() == "third"
    assert sorted(path.name for path in out.iterdir()) == [MANIFEST, "a.txt"]


def test_nobody_takes_a_folder_just_made_for_a_dead_one(tmp_path: Path, monkeypatch) -> None:
    """Between making the folder and locking it, another command could remove it."""
    out, seen = tmp_path / "out", []
    whole = Path.mkdir

    def mkdir(path: Path, *given, **named) -> None:
        whole(path, *given, **named)
        if path.parent == out:
            thread = threading.Thread(target=lambda: (finish_moves(out), seen.append(path)))
            thread.start()
            thread.join(0.2)

    monkeypatch.setattr(Path, "mkdir", mkdir)
    with staged(out, names={"a.txt"}) as folder:
        (folder / "a.txt").write_text("whole")
    assert (out / "a.txt").read_text() == "whole"
