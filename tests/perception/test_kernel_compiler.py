"""Kernels called by kernels: right results, one compilation for all constants, and errors that name their cause."""

from __future__ import annotations

import math
import subprocess
import sys
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, TypeVar, cast

import numba
import numpy as np
import pytest
from numba.core import event
from numba.core.base import BaseContext
from numba.core.caching import NullCache
from numba.core.compiler import CompileResult
from numba.core.types.functions import BaseFunction

from perception.kernel import Floats, kernel
from runtime.support.child_process import child_environment

F = TypeVar("F", bound=Callable[..., object])

pytestmark = pytest.mark.compiled


def _uncached(function: F) -> F:
    """Compile a kernel in this run, not load it."""
    cast("Any", function)._cache = NullCache()
    return function


@kernel
def raised(x: float, power: int = 2, scale: float = 1.0) -> float:
    product = scale
    for _ in range(power):
        product *= x
    return product


@_uncached
@kernel
def raise_all(values: Floats, power: int) -> float:
    total = 0.0
    for i in range(values.shape[0]):
        values[i] = raised(values[i], power)
        total += raised(values[i], 1) + raised(values[i], scale=0.5) + raised(values[i], 3, 0.0)
    return total


def _compilations(function: object) -> tuple[int, int]:
    """Return how often a kernel was compiled for Python and for other kernels."""
    dispatcher = cast("Any", function)
    return len(dispatcher.signatures), len(dispatcher._inner)


def test_a_kernel_for_kernels_is_compiled_once_for_all_constants_and_for_python_only_when_python_calls() -> None:
    values = np.array([2.0, -3.0, math.inf])
    total = raise_all(values, 2)
    assert values.tolist() == [4.0, 9.0, math.inf]
    assert math.isnan(total), "0 times infinity"
    for_python, for_kernels = _compilations(raised)
    assert for_python == 0
    assert for_kernels == 3, "one for each way of leaving out defaults; the power is a constant in three calls"
    assert raised(3.0, 3, 2.0) == 54.0
    assert _compilations(raised) == (1, for_kernels)
    assert raise_all(np.array([2.0]), 3) == 8.0 + 0.5 * 64.0


def test_numba_reports_each_kernel_to_its_listeners() -> None:
    @kernel
    def halved(x: float) -> float:
        return 0.5 * x

    @_uncached
    @kernel
    def quartered(x: float) -> float:
        return halved(halved(x))

    with event.install_recorder("numba:compile") as recorder:
        assert quartered(8.0) == 2.0
    ended = [each.data["dispatcher"].__name__ for _, each in recorder.buffer if each.is_end]
    assert ended == ["halved", "quartered"]


def test_an_error_in_a_kernel_for_kernels_names_it() -> None:
    @kernel
    def wrong(x: float) -> float:
        return x.no_such_attribute  # type: ignore[attr-defined,no-any-return]  # the error

    @kernel
    def calls_wrong(x: float) -> float:
        return wrong(x) + 1.0

    with pytest.raises(numba.NumbaError, match="no_such_attribute"):
        calls_wrong(1.0)


def test_what_numba_does_not_define_is_looked_for_once(monkeypatch: pytest.MonkeyPatch) -> None:
    refreshed: list[None] = []
    refresh = BaseContext.refresh

    def noted(context: Any) -> None:
        refreshed.append(None)
        refresh(context)

    @_uncached
    @kernel
    def rotated(values: Floats, i: int) -> float:
        first = values[i]
        values[i] = values[i + 1]
        values[i + 1] = values[i + 2]
        values[i + 2] = first
        both: float = values[i] + values[i + 1]
        return both

    monkeypatch.setattr(BaseContext, "refresh", noted)
    values = np.array([1.0, 2.0, 4.0])
    assert (rotated(values, 0), values.tolist()) == (6.0, [2.0, 4.0, 1.0])
    assert len(refreshed) <= 4, "once for each compilation and each new type, and not at each access to an array"


def test_an_operator_is_resolved_once_for_the_same_types(monkeypatch: pytest.MonkeyPatch) -> None:
    resolved = Counter[tuple[Any, ...]]()
    resolve = BaseFunction.get_call_type

    def noted(operator: Any, context: Any, args: tuple[Any, ...], kws: Any) -> Any:
        resolved[operator.key, args] += 1
        return resolve(operator, context, args, kws)

    @_uncached
    @kernel
    def polynomial(x: float, y: float) -> float:
        return x * y + x * x + y * y + x * x * y + 2.0 * x + 2.0 * y

    monkeypatch.setattr(BaseFunction, "get_call_type", noted)
    assert polynomial(2.0, 3.0) == 6.0 + 4.0 + 9.0 + 12.0 + 4.0 + 6.0
    assert max(resolved.values(), default=0) <= 2, "to find all types, and to make code"


LOADS: Final = """
import numpy as np
from perception.kernel import kernel, owning_kernel

@owning_kernel
def ramp(count):
    return np.arange(count) + 0.5

@kernel
def total(values):
    found = 0.0
    for k in range(values.shape[0]):
        found += values[k]
    return found

print(total(ramp(1000)), sum(ramp._cache_hits.values()), sum(total._cache_hits.values()))
"""
"""A program that computes the same whether its kernels are compiled or loaded."""


def test_kernels_are_loaded_without_the_compiler_and_those_that_allocate_with_their_allocator(tmp_path: Path) -> None:
    program = tmp_path / "loads.py"
    program.write_text(LOADS)
    environment = {**child_environment(), "NUMBA_CACHE_DIR": str(tmp_path / "kernels")}
    runs = [subprocess.run([sys.executable, program], env=environment, check=True, capture_output=True, text=True)
            for _ in range(2)]  # fmt: skip
    assert [run.stdout.split() for run in runs] == [["500000.0", "0", "0"], ["500000.0", "1", "1"]]


@kernel
def three() -> int:
    return 3


def test_code_that_could_not_be_loaded_is_not_said_to_be_there(monkeypatch: pytest.MonkeyPatch) -> None:
    assert three() == 3
    dispatcher, names = cast("Any", three), set[str]()
    context = dispatcher.targetdescr.target_context
    monkeypatch.setattr(context.codegen()._engine, "_defined_symbols", names)

    def fail(*_: object) -> None:
        assert len(names) == 2
        raise MemoryError

    monkeypatch.setattr(CompileResult, "_rebuild", fail)
    with pytest.raises(MemoryError):
        dispatcher._cache.load_overload((), context)
    assert names == set()


DIFFERENCE: Final = """
from perception.kernel import kernel
from {module} import Pair

@kernel
def difference(pairs: tuple[Pair, float]) -> float:
    return pairs[0].a - pairs[0].b

print(difference((Pair(a=5.0, b=2.0), 0.0)))
"""
PAIR: Final = """
from typing import NamedTuple

class Pair(NamedTuple):
    {first}: float
    {second}: float
"""


def test_code_for_a_named_tuple_is_not_that_for_one_elsewhere_or_with_other_fields(tmp_path: Path) -> None:
    program, outputs = tmp_path / "differences.py", []
    environment = {**child_environment(), "NUMBA_CACHE_DIR": str(tmp_path / "kernels"), "PYTHONPATH": str(tmp_path)}
    for module, first, second in (("before", "a", "b"), ("after", "a", "b"), ("after", "b", "a")):
        (tmp_path / "before.py").unlink(missing_ok=True)
        (tmp_path / f"{module}.py").write_text(PAIR.format(first=first, second=second))
        program.write_text(DIFFERENCE.format(module=module))
        run = subprocess.run(
            [sys.executable, "-B", program], env=environment, check=True, capture_output=True, text=True
        )
        outputs.append(run.stdout.strip())
    assert outputs == ["3.0", "3.0", "3.0"]


@kernel
def nothing(_records: object) -> int:
    return 0


@pytest.mark.parametrize("change", ["none", "part", "readonly"])
def test_arrays_of_records_have_numbas_own_types(change: str) -> None:
    inner = np.dtype([("x", np.float64), ("y", np.float64, (3,))], align=True)
    array = np.zeros((4, 2), np.dtype([("kind", np.int64), ("inner", inner, (2,))], align=True))
    array = array[::2] if change == "part" else array
    array.flags.writeable = change != "readonly"
    assert cast("Any", nothing).typeof_pyval(array) == numba.typeof(array)
