"""The kernel decorators: the same result as plain Python, and no allocation in a kernel."""

from __future__ import annotations

import math

import numba
import numpy as np
import pytest

from config.load import load_settings
from perception.kernel import Floats, entry_kernel, kernel, owning_kernel
from perception.kernel_compiler import EntryDispatcher, KernelDispatcher
from runtime.simulation.closed_loop import simulate


@kernel
def clip_negative(values: Floats, out: Floats) -> int:
    changed = 0
    for i in range(values.shape[0]):
        out[i] = max(0.0, values[i])
        changed += out[i] != values[i]
    return changed


@owning_kernel
def doubled(values: Floats) -> Floats:
    return 2.0 * values


def test_a_kernel_writes_to_its_callers_arrays() -> None:
    values, out = np.array([1.0, -2.0, math.inf]), np.zeros(3)
    assert clip_negative(values, out) == 1
    assert out.tolist() == [1.0, 0.0, math.inf]


def test_an_owning_kernel_may_allocate() -> None:
    assert doubled(np.array([1.0, 2.0])).tolist() == [2.0, 4.0]


def test_nan_stays_nan() -> None:
    """No fastmath: NaN means that a sensor did not fire."""

    @kernel
    def is_missing(r: float) -> bool:
        return math.isnan(r)

    assert is_missing(math.nan)
    assert not is_missing(math.inf)


@pytest.mark.compiled
def test_a_kernel_that_allocates_does_not_compile() -> None:
    @kernel
    def allocating(n: int) -> float:
        return float(np.zeros(n).sum())

    with pytest.raises(numba.NumbaError, match="Only accept returning of array"):
        allocating(3)


@pytest.mark.compiled
def test_an_entry_kernel_meets_the_same_types_in_each_call(monkeypatch: pytest.MonkeyPatch) -> None:
    """After its first call it looks at them no more: of rings that turn in part, listen across or are a servo."""
    met: dict[str, set[tuple[object, ...]]] = {}

    def look(self: EntryDispatcher, *args: object) -> object:
        met.setdefault(self.__name__, set()).add(tuple(map(self.typeof_pyval, args)))
        return KernelDispatcher.__call__(self, *args)

    monkeypatch.setattr(EntryDispatcher, "__call__", look)
    for robot in ("denning", "b21r-both", "ears", "servo1"):
        settings = load_settings("room", robot=robot)
        assert settings.world is not None
        simulate(settings, settings.world, 0, 4.0)
    assert {"check_firing", "check_motion", "record_echoes", "quantum", "fit_walls"} <= set(met)
    assert {name: types for name, types in met.items() if len(types) > 1} == {}


@pytest.mark.compiled
def test_an_entry_kernel_takes_other_values_and_numbers() -> None:
    @entry_kernel
    def scaled(values: Floats, by: float) -> float:
        return float(values[0]) * by

    assert [scaled(np.full(2, value), by) for value, by in ((1.0, 2.0), (3.0, 0.5), (2.0, 3))] == [2.0, 1.5, 6.0]
