"""The decorator of the emulator's kernels: the same result compiled and as plain Python."""

from __future__ import annotations

import os
import subprocess
import sys
from typing import Any

import numba
import numpy as np
import pytest

from drivers.emulator import _jit
from drivers.emulator._jit import kernel
from tests.hil.machine import TIMEOUT_S

EMULATED = """
import sys
import drivers.emulator.server
from config.load import load_settings
from drivers.registry import make_device

settings = load_settings(None)
make_device(settings, settings.world, seed=0).advance(0.5)
print(sorted({"numba", "llvmlite"} & sys.modules.keys()))
"""


@kernel
def clipped_sum(values: np.ndarray, most: float) -> float:
    total = 0.0
    for v in values:
        total += min(v, most)
    return total


def test_a_kernel_returns_what_the_function_returns() -> None:
    values = np.linspace(0.0, 2.0, 11)
    assert clipped_sum(values, 1.0) == np.minimum(values, 1.0).sum()


def test_without_a_writable_cache_it_is_compiled_without_one(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[dict[str, Any]] = []

    def njit(*functions: Any, **options: Any) -> Any:
        asked.append(options)
        if options.get("cache"):
            raise RuntimeError("cannot cache function: no locator available")
        return functions[0]

    monkeypatch.setattr(_jit, "INTERPRETED", False)
    monkeypatch.setattr(numba, "njit", njit)
    assert kernel(len) is len
    assert asked == [{"cache": True}, {}]


def test_any_other_error_is_passed_on(monkeypatch: pytest.MonkeyPatch) -> None:
    def njit(**_options: Any) -> Any:
        raise RuntimeError("something else")

    monkeypatch.setattr(_jit, "INTERPRETED", False)
    monkeypatch.setattr(numba, "njit", njit)
    with pytest.raises(RuntimeError, match="something else"):
        kernel(len)


def test_without_a_compiler_an_emulator_does_not_import_numba() -> None:
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    run = subprocess.run(
        [sys.executable, "-c", EMULATED], env=environment, capture_output=True, text=True, timeout=TIMEOUT_S,
        check=False,
    )  # fmt: skip
    assert run.stdout.strip() == "[]", run.stderr
