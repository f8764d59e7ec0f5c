"""Workers of dask.distributed, of which one is killed half way."""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from called import as_json, ran

import crosscheck
import seecr
from crosscheck.studies.cases import read_cases
from seecr.parallel import as_done, cluster

distributed = pytest.importorskip("distributed", reason="seecr[cluster] is not installed")
pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore")]

LAYOUTS = [
    {"robot": "demobot_cogiro", "do": "map", "grid": "9", "exit_1_x_mm": 80 + k} for k in range(12)
]


@pytest.fixture(scope="module")
def workers() -> Iterator[Any]:
    three = distributed.LocalCluster(n_workers=3, threads_per_worker=1, dashboard_address=None)
    with three as local:
        yield local


def pids(workers: Any) -> list[int]:
    with distributed.Client(workers.scheduler_address, set_as_default=False) as client:
        client.wait_for_workers(3, timeout=60)
        return list(client.run(os.getpid).values())


def parts_of(out: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in (out / "parts").iterdir()}


def test_a_worker_is_killed_half_way_and_nobody_can_tell(workers: Any, tmp_path: Path) -> None:
    serial = crosscheck.study(LAYOUTS, out=tmp_path / "serial")
    there, done = pids(workers), list[str]()

    def kill(_count: int, name: str) -> None:
        done.append(name)
        if len(done) == len(LAYOUTS) // 2:
            os.kill(there[0], signal.SIGKILL)

    with cluster(workers.scheduler_address, pytest.fail) as executor:
        spread = crosscheck.study(LAYOUTS, executor, out=tmp_path / "spread", progress=kill)
    assert len(done) == 12 and not spread.failed
    assert spread.records() == serial.records()
    assert parts_of(tmp_path / "spread") == parts_of(tmp_path / "serial")
    assert there[0] not in pids(workers)


def test_a_map_is_that_of_this_process_to_the_last_bit(workers: Any) -> None:
    axes = seecr.default_axes("demobot_parallel", 12)
    here, told = seecr.workspace_map("demobot_parallel", *axes), list[int]()
    with cluster(workers.scheduler_address, pytest.fail) as executor:
        there = seecr.workspace_map(
            "demobot_parallel", *axes, executor=executor, progress=told.append
        )
    for name in ("margin", "deviation", "rotation", "slack", "stiffness", "softest", "status"):
        assert getattr(there, name).tobytes() == getattr(here, name).tobytes(), name
    assert sum(told) == 12**3


def test_commands_take_a_scheduler(workers: Any, tmp_path: Path) -> None:
    at = f"--scheduler {workers.scheduler_address}"
    map_at = "seecr map demobot_cogiro --grid 0.3:0.5:9 0.2:0.3:5 0.1 --figure none --no-recording"
    here = as_json(f"{map_at} --out {tmp_path / 'a'}")
    there = as_json(f"{map_at} --out {tmp_path / 'b'} {at}")
    assert {k: v for k, v in here.items() if k != "made"} == {
        k: v for k, v in there.items() if k != "made"
    }
    ran(f"{map_at} --parts --out {tmp_path / 'a'}", 0)
    ran(f"{map_at} --parts --out {tmp_path / 'b'} {at}", 0)
    assert parts_of(tmp_path / "a") == parts_of(tmp_path / "b")
    ran(f"crosscheck run --case planar-two-cable {at} --out {tmp_path / 'c'}", 0)
    assert (tmp_path / "c" / "planar-two-cable.rrd").exists()
    cases = tmp_path / "cases.csv"
    cases.write_text("robot,do,grid\ndemobot_cogiro,map,3\n")
    assert (
        as_json(f"crosscheck study {cases} {at} --out {tmp_path / 'd'}")["rows"][0]["poses"] == 27
    )


def test_data_go_to_each_worker_once(workers: Any) -> None:
    """As one key of the scheduler, which each worker asks for; not with every task."""
    cases = read_cases(LAYOUTS)[0]
    with cluster(workers.scheduler_address, pytest.fail) as executor:
        client = executor._client
        big = "x" * 1_000_000
        before = client.run(lambda dask_worker: dask_worker.state.transfer_incoming_count_total)
        found = dict(as_done(big.count, ["x"] * 30, executor))
        after = client.run(lambda dask_worker: dask_worker.state.transfer_incoming_count_total)
    assert len(cases) == 12 and found == dict.fromkeys(range(30), 1_000_000)
    assert all(after[one] - before.get(one, 0) <= 1 for one in after)


def test_a_scheduler_without_workers_is_said() -> None:
    told: list[str] = []
    none = distributed.LocalCluster(n_workers=0, dashboard_address=None)
    with none as local, cluster(local.scheduler_address, told.append):
        pass
    assert len(told) == 1 and "has no workers yet" in told[0]


def test_a_worker_that_dies_of_its_task_each_time_ends_it(workers: Any) -> None:
    pids(workers)
    began = time.monotonic()
    words = r"ended before its work \(KilledWorker\)"
    with (
        cluster(workers.scheduler_address, pytest.fail) as executor,
        pytest.raises(seecr.ExecutorError, match=words),
    ):
        list(as_done(signal.raise_signal, [signal.SIGKILL], executor))
    assert time.monotonic() - began < 120.0


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:9", "nonsense", "http://127.0.0.1:9"])
def test_a_scheduler_that_is_not_there_is_told_in_a_sentence(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, address: str
) -> None:
    monkeypatch.setattr("seecr.parallel._SECONDS", 1)
    cases = tmp_path / "cases.csv"
    cases.write_text("robot,do\ndemobot_cogiro,map\n")
    words = f"crosscheck study {cases} --scheduler {address} --out {tmp_path / 'out'}"
    said = ran(words, 2).stderr
    assert f"--scheduler {address}: no scheduler answers there" in said
    assert len(said.splitlines()) == 1 and not (tmp_path / "out").exists()
    ran(f"seecr map demobot_cogiro --scheduler {address} --out {tmp_path / 'out'}", 2)
    ran(f"crosscheck run --scheduler {address} --out {tmp_path / 'out'}", 2)


def test_without_the_package_it_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    words = r"needs the package distributed, which is not installed; pip install 'seecr\[cluster\]'"
    with pytest.raises(seecr.MissingPackageError, match=words), cluster("tcp://a:1", print):
        pass
