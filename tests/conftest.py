"""What every test needs before anything else: compiled kernels in their cache, and a word on what they run as.

Numba reads its settings when it is imported, so the cache is named here, before any test module is. A run with
`NUMBA_DISABLE_JIT=1` (coverage sees inside kernels) or `NUMBA_BOUNDSCHECK=1` is slower than real time on purpose:
tests marked `realtime` say nothing there and are skipped. Those marked `soak` run only where they are asked for.
"""

from __future__ import annotations

import os

import pytest
from rich.console import Console

from config.load import load_settings
from runtime.kernels import ready_kernels, use_cache

use_cache()


def slowed_down() -> str | None:
    """Return the setting that makes kernels slow in this run, None where there is none."""
    for name in ("NUMBA_DISABLE_JIT", "NUMBA_BOUNDSCHECK"):
        if os.environ.get(name, "0") not in {"", "0"}:
            return name
    return None


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if "soak" not in config.getoption("markexpr"):
        long = [item for item in items if item.get_closest_marker("soak") is not None]
        config.hook.pytest_deselected(items=long)
        items[:] = [item for item in items if item.get_closest_marker("soak") is None]
    slow = slowed_down()
    if slow is None:
        return
    skip = pytest.mark.skip(reason=f"with {slow} nothing runs in real time")
    for item in items:
        if item.get_closest_marker("realtime") is not None:
            item.add_marker(skip)


@pytest.fixture(scope="session", autouse=True)
def _state_folder(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Keep logs of runs under test out of the user's own."""
    os.environ["XDG_STATE_HOME"] = str(tmp_path_factory.mktemp("state"))


@pytest.fixture(scope="session")
def warm_kernels() -> None:
    """Have every kernel compiled before a clock runs, also for processes that a test starts."""
    ready_kernels(load_settings("hallway"), Console(stderr=True))
