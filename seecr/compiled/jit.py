"""How this package is compiled: cached on disk, and without Python's global lock."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from hashlib import sha256
from pathlib import Path
from typing import Any

from llvmlite.binding import add_symbol
from numba import carray as carray  # type: ignore[attr-defined]
from numba import config, njit, types
from numba.core import event
from numba.core.caching import FunctionCache, IndexDataCacheFile
from numba.core.ccallback import CFunc
from numba.core.runtime.nrt import rtsys

from seecr.compiled.compile_notice import watch

COMPILES = not config.DISABLE_JIT  # type: ignore[attr-defined]
"""Whether anything is compiled; else all of it is run by Python."""

# A wrapper for calls from C is asked for where one is needed (by_address).
_COMMON = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}
# Numba counts references to arrays, atomically, at every call and slice. That took three quarters
# of the time, as calls here are short. Functions that create no arrays, and whose callers hold the
# arrays, need not count.
_UNCOUNTED = {**_COMMON, "_nrt": False}


_FILES = sorted(Path(__file__).parent.glob("*.py"))
_SOURCES = sha256(b"".join(file.read_bytes() for file in _FILES)).hexdigest()


class _Cache(FunctionCache):
    """What was compiled, on disk. On a full disk, or from a damaged file, it is compiled anew.

    A function is compiled with all that it calls, but Numba compares its own file only: of a new
    release it would run old parts where that file is the same. So all files count here, in the
    names of what is kept: Numba writes its index before what that tells of, and a process that
    starts meanwhile would load what an older release left under the same name.
    """

    def __init__(self, function: Any) -> None:
        super().__init__(function)  # type: ignore[no-untyped-call]
        self._cache_file = IndexDataCacheFile(  # type: ignore[no-untyped-call]
            cache_path=self._cache_path,
            filename_base=f"{self._impl.filename_base}-{_SOURCES[:16]}",
            source_stamp=self._impl.locator.get_source_stamp(),
        )

    @contextmanager
    def _guard_against_spurious_io_errors(self) -> Iterator[None]:
        try:
            yield
        except OSError:
            pass
        except Exception:  # a damaged pickle raises nearly everything
            with suppress(OSError):
                self.flush()  # type: ignore[no-untyped-call]

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """What was compiled for a signature, else None.

        Numba would load all its rules of how to compile first, and SciPy's linear algebra for them:
        0.4 s of each start. Who compiles loads them; what is compiled needs only who owns arrays.
        """
        rtsys.initialize(target_context)
        with self._guard_against_spurious_io_errors():
            return self._load_overload(sig, target_context)  # type: ignore[no-untyped-call]


def _cached(compiled: Any) -> Any:
    """A function of Numba's with a cache, if there is a folder that can be written."""
    with suppress(RuntimeError):  # no folder
        compiled._cache = _Cache(compiled.__wrapped__)
    return compiled


def _compiles(**options: Any) -> Any:
    """A decorator of functions that are compiled with these options when they are first called."""
    decorator = njit(**options)

    def decorate(function: Any) -> Any:
        return _cached(decorator(function)) if COMPILES else function

    return decorate


class _Listener(event.Listener):
    """Is notified when Numba compiles; functions from its cache are not compiled."""

    def on_start(self, _: event.Event) -> None:
        watch.begins()

    def on_end(self, _: event.Event) -> None:
        watch.ends()


event.register("numba:compile", _Listener())  # type: ignore[no-untyped-call]

jit = _compiles(**_UNCOUNTED)
"""Decorator of compiled functions. A division by zero gives inf or nan, as NumPy's does. They
cannot create arrays: compiling one that does fails. Callers must pass writable arrays, since Numba
compiles everything once more for read-only ones.
"""

jit_inner = _compiles(**_UNCOUNTED, no_cpython_wrapper=True)
"""The same for functions that only compiled functions call: wrappers for calls from Python took a
fifth of the compile time.
"""

jit_lanes = _compiles(**_UNCOUNTED, no_cpython_wrapper=True, fastmath={"contract"})
"""The same for loops over lanes, see seecr.compiled.lanes: products and sums may be fused."""

jit_merged = _compiles(**_UNCOUNTED, no_cpython_wrapper=True, forceinline=True)
"""The same for functions that are merged into their callers: to pass a dozen arrays took as long as
what is computed with them. Each call adds to the compile time.
"""

jit_pasted = _compiles(**_UNCOUNTED, inline="always")
"""The same for functions with one caller or two: each becomes part of these, before they are
compiled, with their settings: it may create arrays where they may. By itself it would be optimised
with all that it calls, and once more in its caller.
"""

jit_allocating = _compiles(**_COMMON, _nrt=True)
"""The same for functions that create arrays. It has to be explicit: otherwise the caller's setting
would apply.
"""

jit_allocating_inner = _compiles(**_COMMON, _nrt=True, no_cpython_wrapper=True)
"""The same for those that only compiled functions call."""


def by_address(name, function):
    """What compiled functions call a function by that is compiled once, by itself.

    Numba compiles all that a function calls anew in it, and in all that call that. This one they
    call by its address, which the linker knows by ``name``: so they know neither what it does nor
    what shapes it expects.

    Args:
        name: for the linker, so that functions from numba's cache find it too.
        function: of addresses of numbers, which ``carray`` makes arrays of; it returns a bool.
    """
    kind = types.boolean(*[types.CPointer(types.float64)] * function.__code__.co_argcount)
    # what is pasted into it has its settings, too: a division by zero is none to raise there
    options = {"error_model": _COMMON["error_model"]}
    callback = _cached(CFunc(function, (kind.args, kind.return_type), {}, options))
    callback.compile()
    add_symbol(name, callback.address)
    return types.ExternalFunction(name, kind)
