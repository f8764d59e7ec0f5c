"""Maps in parts on disk: the same numbers as in memory, and no part is computed twice."""

from __future__ import annotations

from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from called import BARE, as_json, ran, refused_in_a_line
from pyarrow import parquet

import seecr
from seecr.workspace import stored
from seecr.workspace.stored import boxes

ROBOT = seecr.load_robot("demobot_parallel")
AXES = np.linspace(0.04, 0.6, 5), np.linspace(0.1, 0.3, 4), np.array([0.1, 0.2, 0.4])


@pytest.fixture
def small_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stored, "_POSES", 7)


@pytest.mark.parametrize(
    ("shape", "most", "count"),
    [((5, 4, 3), 7, 10), ((5, 4, 3), 2, 40), ((5, 4, 3), 24, 3), ((5, 4, 3), 100, 1)],
)
def test_boxes_are_the_grid_in_its_order(
    shape: tuple[int, int, int], most: int, count: int
) -> None:
    number = np.arange(np.prod(shape)).reshape(shape)
    every = boxes(shape, most)
    cut = [number[box].ravel() for box in every]
    assert len(every) == count and max(map(len, cut)) <= most
    assert np.concatenate(cut).tolist() == sorted(np.concatenate(cut).tolist())


@pytest.mark.parametrize("elastic", [True, False])
def test_a_map_in_parts_has_the_rows_of_one_in_memory(
    small_parts: None, tmp_path: Path, elastic: bool
) -> None:
    done: list[int] = []
    found = seecr.store_map(ROBOT, *AXES, tmp_path, elastic=elastic, progress=done.append)
    whole = seecr.workspace_map(ROBOT, *AXES, elastic=elastic)
    rows = pa.concat_tables([parquet.read_table(file) for file in found.files])
    expected = pa.table(whole.columns())
    assert rows.column_names == expected.column_names
    for name in rows.column_names:
        ours, theirs = rows[name].to_numpy(), expected[name].to_numpy()
        if ours.dtype.kind == "f":
            np.testing.assert_allclose(ours, theirs, rtol=1e-5, atol=1e-9)
        else:
            np.testing.assert_array_equal(ours, theirs)
    told = whole.as_json()
    assert sum(done) == found.sum("poses") == 60 and found.computed == len(found.files) == 10
    assert found.sum("feasible") == told["feasible"]
    assert found.sum("rests") == told["rests"]
    assert found.sum("size_feasible") == pytest.approx(told["size_feasible"])
    head, *others = str(found).splitlines()
    size = f"{told['size_feasible']:.4g} m^3"
    assert head == f"demobot_parallel: {told['feasible']} of 60 poses can be held, {size}"
    assert others[-1] == f"10 parts in {tmp_path / 'parts'}"
    if elastic:
        worst = max(row["deviation_m"] for row in found.records() if row["deviation_m"] is not None)
        assert worst == pytest.approx(told["worst_where_feasible"]["deviation_m"])
        (free,) = (line for line in others if "(singular)" in line)
        assert free.startswith(f"not at rest at {told['not_at_rest'][0]['poses']} (singular): ")
    else:
        assert len(others) == 1


def test_what_is_there_is_not_computed_again(small_parts: None, tmp_path: Path) -> None:
    first = seecr.store_map(ROBOT, *AXES, tmp_path)
    kept = {file.name: file.read_bytes() for file in first.files}
    first.files[3].unlink()
    with ThreadPoolExecutor(2) as executor:
        again = seecr.store_map(ROBOT, *AXES, tmp_path, executor=executor)
    assert again.computed == 1 and "9 there already" in str(again)
    assert {file.name: file.read_bytes() for file in again.files} == kept
    assert again.records() == first.records()
    # anything that the numbers depend on makes other parts
    changes = ({"lowest": 0.1}, {"elastic": False}, {"effects": [seecr.Term.of(
        ROBOT, "platform_mass", added_kg=0.1)]}, {"wrenches": [[0.1, 0, 0, 0, 0, 0]]})  # fmt: skip
    for change in changes:
        other = seecr.store_map(ROBOT, *AXES, tmp_path, **change)
        assert other.computed == 10
    assert seecr.store_map(ROBOT, *AXES, tmp_path).computed == 0


def test_a_damaged_part_and_a_folder_of_something_else_are_refused(
    small_parts: None, tmp_path: Path
) -> None:
    found = seecr.store_map(ROBOT, *AXES, tmp_path, elastic=False)
    found.files[2].write_bytes(found.files[2].read_bytes()[:-1])
    with pytest.raises(seecr.InputFileError, match="is a damaged part of a map; remove it, and"):
        seecr.store_map(ROBOT, *AXES, tmp_path, elastic=False)
    (tmp_path / "measured.csv").touch()
    with pytest.raises(seecr.InputFileError, match=r"measured\.csv.*is not of a map; expect"):
        seecr.store_map(ROBOT, *AXES, tmp_path, elastic=False)


# --- seecr map --parts ----------------------------------------------------------------------------

GRID = "--grid 0.04:0.6:5 0.1:0.3:4 0.1:0.4:3"


@pytest.fixture
def out(small_parts: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path / "out"


def test_the_command_keeps_parts_and_tells_what_the_other_tells(out: Path) -> None:
    Path("model.toml").write_text(
        '[[effect]]\nname = "platform_mass"\nparameters = {added_kg = 0.1}\n'
        "[fitted_to]\nposition_m = [[0.3, 0.1, 0.1], [0.5, 0.3, 0.2]]\ntension_N = [0.0, 9.0]\n"
    )
    words = f"seecr map demobot_parallel {GRID} --model model.toml --out {out}"
    whole, drawn = as_json(words), {path.name for path in out.iterdir()}
    assert {"map.npz", "map.png", "map.rrd"} < drawn and "beyond the data" in whole["notes"][-1]
    parts = as_json(f"{words} --parts")
    # what is not of this result is gone
    assert {path.name for path in out.iterdir()} == drawn - {"map.npz", "map.png", "map.rrd"} | {
        "parts"
    }
    for key in set(whole) - {"made", "cell", "size_feasible", "size_feasible_between"}:
        if key == "softest_where_feasible":
            soft = whole[key].pop("smallest_eigenvalue_N_per_m")
            assert parts[key] == {"smallest_eigenvalue_N_per_m": pytest.approx(soft)}
        elif key == "not_at_rest":
            assert parts[key] == [
                {name: value for name, value in one.items() if name != "first_m"}
                for one in whole[key]
            ]
        else:
            assert parts[key] == whole[key], key
    assert parts["size_feasible"] == pytest.approx(whole["size_feasible"])
    assert sum(part["poses"] for part in parts["parts"]) == 60
    said, again = ran(words, 0).stdout.splitlines(), ran(f"{words} --parts", 0).stdout.splitlines()
    assert again[-3] == f"10 parts in {out / 'parts'}, 10 there already"
    same = ("elastic robot: ", "deviation from ", "next: ", "beyond the data ")
    for line in (line for line in said if line.startswith(same)):
        assert line in again
    assert len(said) == len(again) + 1  # the softest pose; that the files are in parts, for where


def test_a_range_of_data_that_moved_makes_other_parts(out: Path) -> None:
    """How many poses are beyond it is kept with each part."""
    text = "[fitted_to]\nposition_m = [[0.2, -0.05, 0.1], [{}, 0.05, 0.3]]\ntension_N = [0, 9]\n"
    poses = np.array([[x, 0, z, 1, 0, 0, 0] for x in (0.3, 0.4, 0.5, 0.6) for z in (0.1, 0.2, 0.3)])
    held = int(seecr.feasible("planar_vertical", poses).sum())
    for far, beyond in ((0.6, 0), (0.2, held)):
        Path("model.toml").write_text(text.format(far))
        words = "seecr map planar_vertical --grid 0.2:0.6:5 0 0.1:0.3:3 --model model.toml --parts"
        told = as_json(f"{words} --out {out}")
        assert sum(part["beyond"] for part in told["parts"]) == beyond
    assert held > 0


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("--parts --edge 0.1", "leave out --parts, or these"),
        ("--parts --at-least 0.9 --model m.toml", "leave out --parts, or these"),
        (
            "--grid 0:1:1000 0:1:1000 0:1:11",
            "at most 1e+07 poses, got 1.1e+07; with --parts it may",
        ),
        ("--parts --grid 0:1:100000 0:1:100000 0:1:2", "at most 1e+10 poses, got 2.0e+10\n"),
        ("--parts --lowest 90", "no pose of the grid can be held"),
    ],
)
def test_what_parts_cannot_do_is_refused_in_a_line(out: Path, words: str, said: str) -> None:
    line = refused_in_a_line(f"seecr map demobot_cogiro {GRID} {words} --out {out}")
    assert said in line and not (out / "map.json").exists()


class Dying(Executor):
    """It does three tasks, and dies when they are taken."""

    def __init__(self) -> None:
        self.taken, self.begun = 0, list[Future[Any]]()

    def submit(self, function: Any, /, *args: Any, **named: Any) -> Future[Any]:
        self.begun.append(Future())
        if len(self.begun) <= 3:
            self.begun[-1].set_result(function(*args, **named))
        return self.begun[-1]

    def take(self, _poses: int, _now: str) -> None:
        self.taken += 1
        for future in self.begun[3:] if self.taken == 3 else ():
            future.set_exception(BrokenExecutor())


def test_bad_parts_and_lost_workers_end_in_a_sentence_and_the_others_stay(
    out: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    words = f"seecr map demobot_cogiro {GRID} --no-elastic --parts --out {out}"

    executor = Dying()
    with monkeypatch.context() as lost:
        lost.setattr("seecr.cli.workspace.executor_of", lambda *_: nullcontext(executor))
        lost.setattr("seecr.cli.workspace.progress_bar", lambda *_: nullcontext(executor.take))
        said = ran(words, 3).stderr
    assert "the executor ended before its work (BrokenExecutor)" in said
    assert said.endswith(f"; 3 of 10 parts done and kept in {out}: call it again for the others\n")
    kept = {path: path.read_bytes() for path in (out / "parts").iterdir()}
    assert len(kept) == 3 and not (out / "map.json").exists()
    cut = min(kept)
    cut.write_bytes(kept[cut][:-1])
    assert "is a damaged part of a map; remove it, and the next call" in refused_in_a_line(words)
    assert {p: p.read_bytes() for p in (out / "parts").iterdir()} == kept | {cut: kept[cut][:-1]}
    cut.unlink()
    done = ran(f"{words} {BARE}", 0).stdout
    assert f"10 parts in {out / 'parts'}, 2 there already" in done
    assert kept == {path: path.read_bytes() for path in kept}
    foreign = out / "notes.txt"
    foreign.write_text("mine")
    assert "notes.txt: is not of a map" in refused_in_a_line(words)
