"""Maps in parts on disk: the same numbers as in memory, and no part is computed twice."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet

import seecr
from seecr.workspace import stored
from seecr.workspace.stored import boxes

ROBOT = seecr.load_robot(seecr.model_path("demobot_parallel"))
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
    assert head == f"demobot_parallel: {told['feasible']} of 60 poses can be held"
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
        other = seecr.store_map(ROBOT, *AXES, tmp_path, **change)  # type: ignore[arg-type]
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
