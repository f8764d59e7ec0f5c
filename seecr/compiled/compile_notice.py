"""Tells once, on standard error, that compiling takes long; else it is a minute of silence.

Numba compiles what its cache on disk does not hold. It notifies of each function that it compiles
and of none from the cache, so the state of the cache need not be guessed.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from multiprocessing import parent_process
from threading import Lock, Timer

Say = Callable[[], None]

# Compiling that takes no longer than this is not reported [s].
_PATIENCE = 2.0


def _say() -> None:
    """Tell people who called a function or a command; processes that these start tell nothing."""
    if sys.stderr is not None and parent_process() is None:
        text = "compiling the solver, only this first time; it takes a minute or two"
        sys.stderr.write(f"seecr: {text}\n")


class Watch:
    """Calls ``say`` once, when compiling has gone on for a while.

    Args:
        say: the function to call, in a thread of its own.
        patience: [s] how long compiling may go on before that.
    """

    def __init__(self, say: Say = _say, patience: float = _PATIENCE) -> None:
        self._say, self.patience = say, patience
        self._lock, self._depth, self._said = Lock(), 0, False
        self._timer: Timer | None = None

    def begins(self) -> None:
        """Compilation of a function begins; others may begin before it ends."""
        with self._lock:
            self._depth += 1
            if self._timer is None and not self._said:
                self._timer = Timer(self.patience, self._look)
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


watch = Watch()
"""That of this process."""
