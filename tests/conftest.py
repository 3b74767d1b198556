"""What every test needs before anything else: compiled kernels in their cache, and a word on what they run as.

Numba reads its settings when it is imported, so the cache is named here, before any test module is. A run with
`NUMBA_DISABLE_JIT=1` (coverage sees inside kernels) or `NUMBA_BOUNDSCHECK=1` is slower than real time on purpose:
tests marked `realtime` say nothing there and are skipped. Those marked `soak` run only where they are asked for.

What a run of the tests says must depend on nothing but the sources: so generated examples are the same in every run
(`make soak` looks for new ones), and what the user's terminal is like is forgotten.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings
from rich.console import Console

from config.load import load_settings
from runtime.support.kernel_cache import PARTS, prepare_kernels, use_kernel_cache
from tests import promises

use_kernel_cache()

TERMINAL = ("COLUMNS", "LINES", "FORCE_COLOR", "NO_COLOR", "CLICOLOR", "CLICOLOR_FORCE", "TTY_COMPATIBLE",
            "TTY_INTERACTIVE", "PY_COLORS", "JUPYTER_COLUMNS", "JUPYTER_LINES")  # fmt: skip
"""What decides how wide and how colourful output is; CI systems like to set it."""

WITH_KERNELS = [Path(__file__).parent / room for room in ("perception", "drivers")]
"""Where the tests of kernels are."""

for _name in TERMINAL:
    os.environ.pop(_name, None)

# How long an example takes says something about the machine only.
_SLOW = [HealthCheck.too_slow]
settings.register_profile("reproducible", deadline=None, derandomize=True, suppress_health_check=_SLOW)
settings.register_profile(
    "explore", deadline=None, max_examples=1000, print_blob=True, database=None, suppress_health_check=_SLOW
)
settings.load_profile("reproducible")


def slowed_down() -> str | None:
    """Return the setting that makes kernels slow in this run, None where there is none."""
    for name in ("NUMBA_DISABLE_JIT", "NUMBA_BOUNDSCHECK"):
        if os.environ.get(name, "0") not in {"", "0"}:
            return name
    return None


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--promises", metavar="PAGE", help="write what was measured, see tests/promises.py")
    parser.addoption("--screenshots", metavar="FOLDER", help="keep the browser tests' pictures there")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    promises.collect(config, items)
    for item in items:
        if any(item.path.is_relative_to(room) for room in WITH_KERNELS):
            item.add_marker("kernels")
    slow = slowed_down()
    if slow is None:
        return
    skip = pytest.mark.skip(reason=f"with {slow} nothing runs in real time")
    for item in items:
        if item.get_closest_marker("realtime") is not None:
            item.add_marker(skip)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    if any(item.get_closest_marker(name) is not None for name in (promises.CARRIES, "soak")):
        item.user_properties.append((promises.CARRIES, ""))


class _Clerk:
    """Enters what tests report into the ledger, and writes the page at the end."""

    def __init__(self, config: pytest.Config) -> None:
        self._config = config

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        ledger = self._config.stash.get(promises.LEDGER, None)
        if ledger is not None:  # None in a process that has others collect and run the tests
            ledger.take_report(report)

    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        page = self._config.getoption("promises")
        if page is None:
            return
        ledger, path = self._config.stash.get(promises.LEDGER, promises.Ledger()), Path(page)
        soak, day = path.name == promises.SOAK_PAGE.name, datetime.now(UTC).date().isoformat()
        try:
            before = promises.rows_in(path.read_text("utf-8")) if path.exists() else []
            rows = promises.merged(ledger, before, soak=soak, day=day)
            path.write_text(promises.render(rows, soak=soak), encoding="utf-8")
        except ValueError as error:
            self._config.get_terminal_writer().line(f"\n{page} is left as it is: {error}", red=True)
            session.exitstatus = pytest.ExitCode.USAGE_ERROR


def pytest_configure(config: pytest.Config) -> None:
    config.pluginmanager.register(_Clerk(config), "promises")
    if getattr(config.option, "numprocesses", None):
        # Before there are several processes, each of which would compile all of it.
        _compile_all()


def _compile_all() -> None:
    prepare_kernels(load_settings("hallway"), Console(stderr=True), PARTS)


@pytest.fixture
def measured(request: pytest.FixtureRequest) -> Callable[[str], None]:
    """Tell what a test measured, for the page of promises."""
    return lambda text: request.node.user_properties.append((promises.MEASURED, text))


@pytest.fixture(scope="session", autouse=True)
def _state_folder(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Keep logs of runs under test out of the user's own."""
    os.environ["XDG_STATE_HOME"] = str(tmp_path_factory.mktemp("state"))


@pytest.fixture(scope="session")
def warm_kernels() -> None:
    """Have every kernel compiled before a clock runs, also for processes that a test starts."""
    _compile_all()
