"""Jobs in several processes: Python runs one thread at a time, and fits are mostly Python.

A process is forked: it begins with all that this one has, and only its results are sent back.
Where processes cannot be forked safely (anywhere but on Linux), or there is one processor, all is
done in this process, with the same results. The suite's cases are sent to processes instead, by
:mod:`crosscheck.suite.pool`, which works everywhere; what a fit begins with is too much to send.
"""

from __future__ import annotations

import gc
import os
import pickle
import signal
import struct
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from io import BytesIO
from types import BuiltinFunctionType, FunctionType, ModuleType
from typing import Any, ClassVar, Generic, TypeVar, cast

from seecr.errors import InputError
from seecr.threads import processors, undivided

__all__ = [
    "Job",
    "Shared",
    "shared_out",
]

T = TypeVar("T")
R = TypeVar("R")

# The environment variable that says how many processes there may be at most.
MOST = "SEECR_PROCESSES"
# Most processes if nobody says: to fork one takes 10 ms, and there are seldom more items than 24.
_WORTH = 8
# A process that is so much slower than this one may hang: its job is done here.
_SECONDS, _TIMES = 60.0, 10.0
# A pipe holds so many numbers whatever the system.
_MOST_ITEMS = 2048
# What has no parts, and is the same by its value or its name.
_SIMPLE = (
    type(None), bool, int, float, complex, str, bytes, type, ModuleType, BuiltinFunctionType,
)  # fmt: skip

_is_forked = False


class Shared:
    """What both processes have: it is not sent back, results refer to it.

    So they share their robot, their commands and what was computed for these, as if they had been
    computed here.
    """

    def __init__(self, *roots: object) -> None:
        """Everything that can be reached from some objects, as it is now."""
        self._by_id: dict[int, object] = {}
        left: list[object] = list(roots)
        while left:
            one = left.pop()
            if isinstance(one, _SIMPLE) or id(one) in self._by_id:
                continue
            self._by_id[id(one)] = one
            left.extend(_parts(one))

    def pickled(self, result: object) -> bytes:
        """A result, for the process that forked this one."""
        stream = BytesIO()
        _Pickler(stream, self._by_id).dump(result)
        return stream.getvalue()

    def unpickled(self, text: bytes) -> Any:
        """A result of a forked process."""
        return _Unpickler(BytesIO(text), self._by_id).load()


def _parts(one: object) -> Iterator[object]:
    if isinstance(one, dict):
        yield from one.keys()
        yield from one.values()
    elif isinstance(one, (list, tuple, set, frozenset)):
        yield from one
    elif not isinstance(one, FunctionType):
        yield from getattr(one, "__dict__", {}).values()


class _Pickler(pickle.Pickler):
    def __init__(self, stream: BytesIO, kept: dict[int, object]) -> None:
        super().__init__(stream, pickle.HIGHEST_PROTOCOL)
        self._kept = kept

    def persistent_id(self, obj: Any) -> int | None:
        return id(obj) if id(obj) in self._kept else None


class _Unpickler(pickle.Unpickler):
    def __init__(self, stream: BytesIO, kept: dict[int, object]) -> None:
        super().__init__(stream)
        self._kept = kept

    def persistent_load(self, pid: Any) -> object:
        return self._kept[pid]


class Job(Generic[R]):
    """A job in a process of its own, while this one goes on; a context manager that ends it."""

    running: ClassVar[set[Job[Any]]] = set()

    def __init__(self, job: Callable[[], R], shared: Shared) -> None:
        """Start the job, if a processor is free for it; else :meth:`result` does it.

        Args:
            job: computes a result; what it changes is lost.
            shared: what the result may refer to.
        """
        self._job, self._shared = job, shared
        self._began = time.monotonic()
        self._process, self._file, self._status = 0, -1, 1
        if _free() > 0:
            try:
                self._process, self._file = _forked(self._pickled)
            except OSError:  # no memory or number is left for one
                return
            self.running.add(self)

    def _pickled(self) -> bytes:
        with undivided():
            return self._shared.pickled(self._job())

    def __enter__(self) -> Job[R]:
        return self

    def __exit__(self, *_error: object) -> None:
        if self.is_running:
            os.kill(self._process, signal.SIGKILL)
            self._wait(0)
        self._close()

    @property
    def is_running(self) -> bool:
        """Whether its process is at work."""
        return self in self.running and not self._wait(os.WNOHANG)

    def result(self) -> R:
        """What the job found; done here if it was not started, or if its process failed."""
        for result in self.sent():
            return result
        return self._job()

    def sent(self) -> list[R]:
        """What the process found, as the only member; nothing if none was started or it failed."""
        patience = time.monotonic() + _SECONDS + _TIMES * (time.monotonic() - self._began)
        pause = 1e-4
        while self.is_running and time.monotonic() < patience:
            time.sleep(pause)
            pause = min(2.0 * pause, 5e-3)
        try:
            return [cast(R, self._shared.unpickled(self._text()))] if self._status == 0 else []
        except Exception:  # whatever it is, this process can do the job
            return []
        finally:
            self.__exit__()

    def _wait(self, how: int) -> bool:
        """Whether the process has ended."""
        try:
            process, status = os.waitpid(self._process, how)
        except ChildProcessError:  # others have waited for it: how it ended is lost
            process, status = self._process, 1
        if process:
            self._status = status
            self.running.discard(self)
        return bool(process)

    def _text(self) -> bytes:
        with open(self._file, "rb", closefd=False) as stream:
            stream.seek(0)
            return stream.read()

    def _close(self) -> None:
        if self._file >= 0:
            os.close(self._file)
        self._file, self._status = -1, 1


def _free() -> int:
    """How many more processes may run."""
    if not hasattr(os, "memfd_create") or _is_forked:  # which is there on Linux alone
        return 0
    return _most() - 1 - sum(job.is_running for job in tuple(Job.running))


def _most() -> int:
    """How many processes there may be, this one included."""
    asked = os.environ.get(MOST, "").strip()
    if not asked:
        return min(processors(), _WORTH)
    if not asked.isdecimal() or int(asked) < 1:
        raise InputError(f"{MOST}: expected a whole number of processes from 1 on, got {asked!r}")
    return int(asked)


def _forked(job: Callable[[], bytes]) -> tuple[int, int]:
    """A process that does a job, and the file to which it writes what that returns."""
    global _is_forked
    sent = os.memfd_create("sent")
    try:
        with warnings.catch_warnings():
            # Python warns where other threads run: the job needs none of them, nor their locks
            warnings.simplefilter("ignore", DeprecationWarning)
            process = os.fork()
    except OSError:
        os.close(sent)
        raise
    if process:
        return process, sent
    status = 1
    try:
        if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
            signal.signal(signal.SIGINT, signal.SIG_DFL)  # nor is a traceback printed twice
        _is_forked = True
        gc.freeze()
        with open(sent, "wb", closefd=False) as stream:
            stream.write(job())
        status = 0
    finally:
        os._exit(status)  # whatever was raised: the other process does the job again, and raises it


def shared_out(
    do: Callable[[T], R],
    items: Sequence[T],
    shared: Callable[[], Shared],
    begun: Callable[[T], None] = lambda _item: None,
) -> list[R]:
    """Call a function with each item, in as many processes as there are processors, up to eight.

    Each process takes the next item that is left.

    Args:
        do: the function; what it changes is lost, or not, so that it should change nothing.
        items: its arguments.
        shared: what results may refer to; only asked for if there is more than one process.
        begun: called in this process with each item that it begins or has from another process.

    Returns:
        the results in the order of the items.
    """
    others = min(_free(), len(items) - 1)
    if others <= 0 or len(items) > _MOST_ITEMS:
        return [_done(do, item, begun) for item in items]
    both, found = shared(), dict[int, R]()
    with _numbers(len(items)) as left:

        def is_more_to_do() -> bool:
            return _size(left) > 0

        def work() -> list[tuple[int, R]]:
            with undivided(is_more_to_do):
                return [(k, do(items[k])) for k in _taken(left)]

        processes = [Job(work, both) for _ in range(others)]
        try:
            with undivided(is_more_to_do):
                for k in _taken(left):
                    found[k] = _done(do, items[k], begun)
            for one in processes:
                for results in one.sent():
                    for k, result in results:
                        begun(items[k])
                        found[k] = result
        finally:
            for one in processes:
                one.__exit__()
        for k, item in enumerate(items):
            if k not in found:
                found[k] = _done(do, item, begun)
    return [found[k] for k in range(len(items))]


def _done(do: Callable[[T], R], item: T, begun: Callable[[T], None]) -> R:
    begun(item)
    return do(item)


@contextmanager
def _numbers(count: int) -> Iterator[int]:
    """A pipe with the numbers from 0 on, each of which one process can take."""
    out, into = os.pipe()
    try:
        os.write(into, struct.pack(f"={count}H", *range(count)))
    finally:
        os.close(into)
    try:
        yield out
    finally:
        os.close(out)


def _size(pipe: int) -> int:
    """How many bytes can be read from a pipe."""
    import fcntl  # neither is there on Windows
    import termios

    return int(struct.unpack("i", fcntl.ioctl(pipe, termios.FIONREAD, b"\0" * 4))[0])


def _taken(left: int) -> Iterator[int]:
    """The numbers that this process takes, as long as there are any."""
    while text := os.read(left, 2):
        yield struct.unpack("=H", text)[0]
