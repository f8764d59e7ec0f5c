"""On a full disk nothing is half written, and the whole results of before stay."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from seecr import InputFileError, solve
from seecr.show.stream import recording_file
from seecr.show.sweep_recording import write_sweep_recording

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


def test_a_recording_without_its_end_replaces_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.rrd"
    write_sweep_recording(solve("planar_vertical", [[0.4, 0, 0.2, 1, 0, 0, 0]]), path, True)
    whole = path.read_bytes()
    import rerun as rr

    cut = rr.RecordingStream.disconnect

    def half(stream: rr.RecordingStream) -> None:
        cut(stream)
        (part,) = tmp_path.glob(".*.part")
        part.write_bytes(part.read_bytes()[:-40])

    monkeypatch.setattr(rr.RecordingStream, "disconnect", half)
    with (
        pytest.raises(InputFileError, match=r"a\.rrd: cannot write the recording: it is incomp"),
        recording_file(path, "a", rr.blueprint.Blueprint()) as recording,
    ):
        recording.text("note", "half")
    assert path.read_bytes() == whole and [*tmp_path.iterdir()] == [path]
