"""Numba's njit, whose cache works on every machine."""

from __future__ import annotations

import hashlib
import inspect
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import cache, cached_property
from pathlib import Path
from types import FunctionType
from typing import Any

import llvmlite  # type: ignore[import-untyped]
import numba
import numpy as np
from numba.core.compiler import CompileResult
from numba.core.serialize import dumps

from mien.numeric.kernels.cache import KernelFiles, kernel_folders


def njit(*, cache: bool = False, **options: Any) -> Callable[[Callable], Any]:
    """Compile a function of a module, without Python objects.

    Args:
        cache: keep the machine code for later runs, where a folder can be written. Unlike Numba's,
            it notices a change in a kernel of another module that this one calls.
        options: as numba.njit takes them.
    """

    def compiled(function: Callable) -> Any:
        dispatcher = numba.njit(**options)(function)
        if cache:
            # What numba.njit(cache=True) sets.
            dispatcher._cache = _KernelCache(inspect.unwrap(function))
        return dispatcher

    return compiled


class _KernelCache:
    """Replaces numba.core.caching.FunctionCache: the methods that a dispatcher calls."""

    def __init__(self, function: FunctionType) -> None:
        self._function = function

    @property
    def cache_path(self) -> str | None:
        """The folder that is written to."""
        return str(self._places[0].folder) if self._places else None

    def load_overload(self, signature: Any, context: Any) -> Any:
        """The kernel compiled for these types, or None."""
        context.refresh()
        key = (signature, context.codegen().magic_tuple())
        for files in self._places:
            found = files.load(key)
            if found is not None:
                return CompileResult._rebuild(context, *found)
        return None

    def save_overload(self, signature: Any, result: Any) -> None:
        """Save the kernel; where that fails, a later run compiles it anew."""
        # Addresses within this process mean nothing to another.
        if result.lifted or result.library.has_dynamic_globals:
            return
        with suppress(OSError):
            for files in self._places[:1]:
                files.save((signature, result.codegen.magic_tuple()), result._reduce())

    def flush(self) -> None:
        """Delete what is saved."""
        with suppress(OSError):
            for files in self._places[:1]:
                files.clear()

    @cached_property
    def _places(self) -> tuple[KernelFiles, ...]:
        function, python = self._function, sys.implementation.cache_tag
        line = function.__code__.co_firstlineno
        base = f"{function.__module__}.{function.__qualname__}-{line}.{python}"
        stamp = _stamp(function)
        return tuple(KernelFiles(folder, base, stamp, dumps) for folder in kernel_folders())


def _stamp(function: FunctionType) -> bytes:
    """A digest of everything that the function's machine code depends on."""
    found = hashlib.sha256(f"{sys.version} {numba.__version__} {llvmlite.__version__}".encode())
    for piece in _ingredients(function, set()):
        found.update(hashlib.sha256(piece).digest())
    return found.digest()


def _ingredients(function: FunctionType, seen: set[FunctionType]) -> Iterator[bytes]:
    """The function's source, the constants that it takes, and the same of all that it calls."""
    seen.add(function)
    yield _source(function.__code__.co_filename)
    for name in function.__code__.co_names:
        value = function.__globals__.get(name)
        called = inspect.unwrap(value) if callable(value) else None
        if isinstance(called, FunctionType):
            if called not in seen and called is not value:  # a kernel, or a part of one
                yield from _ingredients(called, seen)
        elif isinstance(value, np.ndarray):
            yield f"{name} {value.dtype} {value.shape} ".encode() + value.tobytes()
        elif isinstance(value, (int, float, str, tuple, np.generic)):
            yield f"{name} {value!r}".encode()


@cache
def _source(file: str) -> bytes:
    return Path(file).read_bytes()
