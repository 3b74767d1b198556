"""Which tests call a kernel by themselves that the product calls from kernels only.

To compile such a kernel for Python, with all that it calls, takes a second or more, for one test. Those tests run as
plain Python alone, where nothing is compiled and each line is covered: `make interpreted` runs them. What compiling
may change is tested by all that drives with compiled kernels, against oracles, the truth and recordings.
"""

from __future__ import annotations

import dis
import functools
from collections.abc import Iterator
from types import CodeType, FunctionType, ModuleType

import pytest

from perception.kernel_compiler import KernelDispatcher

ELSEWHERE = ("compiled", "covered", "realtime", "boundscheck", "soak")
"""Marks of tests that `make interpreted` leaves out, or that also run elsewhere."""
OURS = "tests."


def runs_interpreted_alone(item: pytest.Item) -> bool:
    """Return whether a test runs as plain Python, and compiled would compile a kernel for itself.

    The kernels of the product must be loaded: those that are not have no caller in Python.
    """
    if item.get_closest_marker("kernels") is None or any(item.get_closest_marker(name) for name in ELSEWHERE):
        return False
    function = getattr(item, "function", None)
    inner = getattr(getattr(function, "hypothesis", None), "inner_test", function)
    params = getattr(getattr(item, "callspec", None), "params", {})
    return any(is_inner(kernel) for kernel in kernels_of(inner, *params.values()))


def is_inner(kernel: KernelDispatcher) -> bool:
    """Return whether a kernel of the product was not loaded."""
    return not kernel.overloads and not kernel.py_func.__module__.startswith(OURS)


def kernels_of(*values: object) -> Iterator[KernelDispatcher]:
    """Yield the kernels among these values, and those that functions of tests among them name, or their helpers."""
    waiting, seen = list(values), set[int]()
    while waiting:
        value = waiting.pop()
        if id(value) in seen:
            continue
        seen.add(id(value))
        if isinstance(value, KernelDispatcher):
            yield value
        elif isinstance(value, FunctionType) and value.__module__.startswith(OURS):
            waiting.extend(_named(value))
        elif isinstance(value, type) and value.__module__.startswith(OURS):
            waiting.extend(vars(value).values())


def kernels_named(function: FunctionType) -> Iterator[KernelDispatcher]:
    """Yield the kernels that a function itself names."""
    yield from (value for value in _named(function) if isinstance(value, KernelDispatcher))


@functools.cache
def _named(function: FunctionType) -> tuple[object, ...]:
    """Return what a function names of its module, and of modules there."""
    found, codes = list[object](), [function.__code__]
    while codes:
        code = codes.pop()
        codes.extend(constant for constant in code.co_consts if isinstance(constant, CodeType))
        value = None
        for operation in dis.get_instructions(code):
            if operation.opname == "LOAD_GLOBAL":
                value = function.__globals__.get(operation.argval)
            elif isinstance(value, ModuleType) and operation.opname in {"LOAD_ATTR", "LOAD_METHOD"}:
                value = getattr(value, operation.argval, None)
            else:
                value = None
            found.append(value)
    return tuple(found)
