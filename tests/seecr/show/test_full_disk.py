"""On a full disk nothing is half written, and the whole results of before stay."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from seecr import InputFileError, solve
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
