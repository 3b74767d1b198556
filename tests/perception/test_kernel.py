"""The kernel decorators: the same result as plain Python, and no allocation in a kernel."""

from __future__ import annotations

import math

import numba
import numpy as np
import pytest

from perception.kernel import Floats, kernel, owning_kernel


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
