"""A digest of all that a compiled kernel depends on, by which its machine code is kept.

It covers the kernel's bytecode, the values of the constants that it uses, and the same of each kernel that it calls,
and nothing else: neither where the file lies, nor its other functions, nor comments. So all copies of the same
sources share their kernels, and an edit compiles what it changes. What cannot be covered is an error: no kernel can
be stale.
"""

from __future__ import annotations

import builtins
import hashlib
from collections.abc import Callable, Iterator, Mapping
from itertools import chain
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any, Final, TypeAlias, cast

import llvmlite
import numba
import numpy as np
from numba.core import config
from numba.core.utils import PYVERSION

Digest: TypeAlias = "hashlib._Hash"

FOREIGN: Final = ("builtins", "math", "numba", "numpy")
"""Modules whose functions are known by name: their versions are covered."""


def tools_digest(compiler: Mapping[str, object]) -> str:
    """Return a digest of what compiles: versions, checks of bounds, and the functions of our compiler's module.

    Parameters
    ----------
    compiler : mapping
        The names of the module `perception.kernel_compiler`.
    """
    digest = hashlib.sha256()
    versions = (PYVERSION, numba.__version__, llvmlite.__version__, np.__version__)
    digest.update(repr((versions, config.BOUNDSCHECK, config.OPT)).encode())
    for name in sorted(compiler):
        for part in _functions(compiler[name], str(compiler["__name__"])):
            digest.update(name.encode())
            _add_code(digest, part.__code__)
    return digest.hexdigest()


def _functions(value: object, module: str) -> Iterator[FunctionType]:
    """Yield a function of a module, or the methods of a class of it."""
    if getattr(value, "__module__", None) != module:
        return
    if isinstance(value, FunctionType):
        yield value
    elif isinstance(value, type):
        for _, part in sorted(vars(value).items()):
            inner = getattr(part, "func", part)  # of a cached property
            if isinstance(inner, FunctionType):
                yield inner


class KernelDigests:
    """The digests of kernels; each is computed once.

    Parameters
    ----------
    tools : str
        From `tools_digest`.
    """

    def __init__(self, tools: str) -> None:
        self._tools = tools
        self._own: dict[FunctionType, bytes] = {}
        """Of each kernel, without those that it calls."""
        self._called: dict[FunctionType, tuple[Any, ...]] = {}
        """The kernels that each one calls."""

    def of(self, kernel: Any, signature: str) -> str:  # noqa: ANN401 - a dispatcher, to which numba gives no type
        """Return the digest of a kernel for arguments of these types.

        Raises
        ------
        TypeError
            It uses a value that no digest covers.
        """
        digest = hashlib.sha256(f"{self._tools}\n{signature}\n".encode())
        seen: dict[FunctionType, None] = {}
        waiting = [kernel]
        while waiting:
            one = waiting.pop()
            if one.py_func not in seen:
                seen[one.py_func] = None
                digest.update(self._of_one(one))
                waiting.extend(self._called[one.py_func])
        return digest.hexdigest()

    def _of_one(self, kernel: Any) -> bytes:  # noqa: ANN401 - as above
        """Return the digest of a kernel without those that it calls, which it notes."""
        function = cast("FunctionType", kernel.py_func)
        if function not in self._own:
            digest = hashlib.sha256(repr(sorted(kernel.targetoptions.items())).encode())
            digest.update(function.__qualname__.encode())
            _add_code(digest, function.__code__)
            called: list[Any] = []
            for name, value in _used(function):
                digest.update(name.encode())
                _add_value(digest, value, called, f"{function.__module__}.{function.__qualname__} uses {name}")
            self._own[function], self._called[function] = digest.digest(), tuple(called)
        return self._own[function]


def _add_code(digest: Digest, code: CodeType) -> None:
    """Add what a code does, without its lines and its docstring."""
    text = code.co_consts[:1] if code.co_consts and isinstance(code.co_consts[0], str) else ()
    is_documented = bool(text) and bool(code.co_flags & 1)  # of a function; others have no docstring there
    names = (code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars)
    counts = (code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount, code.co_flags)
    digest.update(repr((names, counts, getattr(code, "co_exceptiontable", b""))).encode() + code.co_code)
    for constant in code.co_consts[1:] if is_documented else code.co_consts:
        if isinstance(constant, CodeType):
            _add_code(digest, constant)
        else:
            digest.update(f"{type(constant).__name__} {constant!r}\n".encode())


def _used(function: FunctionType) -> Iterator[tuple[str, object]]:
    """Yield name and value of all that a function uses from outside."""
    for index, default in enumerate(function.__defaults__ or ()):
        yield f"default {index}", default
    yield from sorted((function.__kwdefaults__ or {}).items())
    for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True):
        yield name, cell.cell_contents
    for name in _names(function.__code__):  # those of attributes among them, which does no harm
        if name in function.__globals__:
            yield name, function.__globals__[name]
        elif hasattr(builtins, name):
            yield name, getattr(builtins, name)


def _names(code: CodeType) -> list[str]:
    """Return the names that a code refers to, that of functions in it included."""
    inner = (_names(constant) for constant in code.co_consts if isinstance(constant, CodeType))
    return sorted({*code.co_names, *chain.from_iterable(inner)})


def _add_value(digest: Digest, value: object, called: list[Any], where: str) -> None:
    """Add a value that a kernel uses; a kernel among them goes to `called`."""
    if hasattr(value, "py_func"):
        called.append(value)
    elif value is None or isinstance(value, bool | int | float | complex | str | bytes | np.generic):
        digest.update(f"{type(value).__name__} {value!r}\n".encode())
    elif isinstance(value, np.dtype):
        digest.update(f"{value!r} {value.itemsize} {value.alignment}\n".encode())
    elif isinstance(value, np.ndarray) and not value.dtype.hasobject:
        digest.update(f"{value.dtype!r} {value.shape} {value.flags.f_contiguous}\n".encode() + value.tobytes())
    elif isinstance(value, tuple):
        digest.update(f"{type(value).__name__} {len(value)} {getattr(value, '_fields', '')}\n".encode())
        for one in value:
            _add_value(digest, one, called, where)
    elif isinstance(value, ModuleType) and value.__name__.split(".")[0] in FOREIGN:
        digest.update(f"module {value.__name__}\n".encode())
    elif (
        isinstance(value, type | FunctionType | BuiltinFunctionType | np.ufunc | Callable) and _home(value) in FOREIGN
    ):
        digest.update(f"{getattr(value, '__qualname__', value)!s} of {_home(value)}\n".encode())
    else:
        raise TypeError(
            f"{where}, a {type(value).__name__}, on which its machine code may depend unnoticed: use numbers, text, "
            "arrays, dtypes, tuples of them, other kernels, or functions of math, numpy and numba"
        )


def _home(value: object) -> str:
    """Return the package of a function or a class; a numpy ufunc names no module."""
    return str(getattr(value, "__module__", None) or "numpy").split(".")[0]
