"""Reports that compiling takes long, if a caller asks for it; else it is a minute of silence.

Numba compiles what its cache on disk does not hold. It notifies of each function that it compiles
and of none from the cache, so the state of the cache need not be guessed.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from threading import Lock, Timer

__all__ = [
    "Watch",
    "begins",
    "ends",
    "tell_compiling",
]


Say = Callable[[], None]

# Compiling that takes no longer than this is not reported [s].
_PATIENCE = 2.0


class Watch:
    """Calls ``say`` once in this process, when compiling has gone on for a while.

    Args:
        say: the function to call, in a thread of its own.
        patience: [s] how long compiling may go on before that.
    """

    def __init__(self, say: Say, patience: float = _PATIENCE) -> None:
        self._say, self._patience, self._process = say, patience, os.getpid()
        self._lock, self._depth, self._said = Lock(), 0, False
        self._timer: Timer | None = None

    def begins(self) -> None:
        """Compilation of a function begins; others may begin before it ends."""
        with self._lock:
            self._depth += 1
            if self._timer is None and not self._said and os.getpid() == self._process:
                self._timer = Timer(self._patience, self._look)
                self._timer.daemon = True
                self._timer.start()

    def ends(self) -> None:
        """Compilation of a function has ended."""
        with self._lock:
            self._depth -= 1

    def _look(self) -> None:
        with self._lock:
            self._timer, now = None, self._depth > 0 and not self._said
            self._said |= now
        if now:
            self._say()


_watch: Watch | None = None


def tell_compiling(say: Say) -> None:
    """From now on call ``say``, once, if compiling takes long."""
    global _watch
    _watch = Watch(say)


def begins() -> None:
    """Pass on that compilation of a function begins."""
    if _watch is not None:
        _watch.begins()


def ends() -> None:
    """Pass on that compilation of a function has ended."""
    if _watch is not None:
        _watch.ends()
