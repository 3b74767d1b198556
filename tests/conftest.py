"""Setup of every test run: the kernel cache, reproducible examples, a neutral terminal, and the page of promises.

Numba reads its settings on import, so the cache is configured here, before any test module is imported. A run with
`NUMBA_DISABLE_JIT=1` (so that coverage can see into kernels) or `NUMBA_BOUNDSCHECK=1` is slower than real time; tests
marked `realtime` are skipped there. Tests marked `soak` run only on request.

`make tests` runs everything compiled, and the tests of kernels (marker `kernels`) as plain Python, because coverage
(see tests/line_coverage.py) cannot see into compiled code; those marked `compiled` would be too slow there, and those
marked `covered` execute no line that others do not.
Tests that would compile kernels for themselves run as plain Python alone (see tests/inner_kernels.py).

The result of a run must depend on the sources alone: hypothesis generates the same examples in every run (`make soak`
generates new ones), and the settings of the user's terminal are removed.
"""

from __future__ import annotations

import functools
import gc
import os
import signal
from collections.abc import Callable, Generator
from datetime import UTC, datetime
from pathlib import Path

import pytest

try:
    from hypothesis import HealthCheck, settings
except ModuleNotFoundError:
    pytest.exit("the tests of this repository need its extra dev: pip install -e '.[dev]'", returncode=4)

from tests import line_coverage

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as in `runtime.cli.__main__`, before numpy is imported
COVERAGE = line_coverage.start()  # before any module of the product is imported

from runtime.support import child_process, kernel_warmup  # noqa: E402
from runtime.support.kernel_cache import use_kernel_cache  # noqa: E402
from tests import promise_page, promises  # noqa: E402
from tests.compile_kernels import compile_all  # noqa: E402
from tests.forked import ForkedTests  # noqa: E402

use_kernel_cache()
FREEZE, UNFREEZE = gc.freeze, gc.unfreeze

TERMINAL = ("COLUMNS", "LINES", "FORCE_COLOR", "NO_COLOR", "CLICOLOR", "CLICOLOR_FORCE", "TTY_COMPATIBLE",
            "TTY_INTERACTIVE", "PY_COLORS", "JUPYTER_COLUMNS", "JUPYTER_LINES")  # fmt: skip
"""Environment variables that set the width and colours of output."""

KERNEL_TESTS = [Path(__file__).parent / package for package in ("perception", "behaviors/valley", "drivers/emulator")]
"""Folders with the tests of compiled kernels."""

BROWSER_TESTS = Path(__file__).parent / "browser"
WARM_UP_TESTS = ("test_kernel_warmup.py", "test_localization_warmup.py")

for _name in TERMINAL:
    os.environ.pop(_name, None)

# A shell starts background programs with SIGINT ignored, nohup with SIGHUP; children would inherit both.
for _number, _handler in ((signal.SIGINT, signal.default_int_handler), (signal.SIGHUP, signal.SIG_DFL)):
    if signal.getsignal(_number) is signal.SIG_IGN:
        signal.signal(_number, _handler)

# How long an example takes depends on the machine only.
_SLOW = [HealthCheck.too_slow]
settings.register_profile(
    "reproducible", max_examples=50, deadline=None, derandomize=True, suppress_health_check=_SLOW
)
settings.register_profile(
    "explore", deadline=None, max_examples=1000, print_blob=True, database=None, suppress_health_check=_SLOW
)
settings.load_profile("reproducible")


def slow_kernel_setting() -> str | None:
    """Return the name of the setting that makes kernels slow in this run, or None."""
    for name in ("NUMBA_DISABLE_JIT", "NUMBA_BOUNDSCHECK"):
        if os.environ.get(name, "0") not in {"", "0"}:
            return name
    return None


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--forks", metavar="PROCESSES", type=int, default=0, help="see tests/forked.py")
    parser.addoption("--promises", metavar="PAGE", help="write the measurements, see tests/promises.py")
    parser.addoption("--screenshots", metavar="FOLDER", help="save the screenshots of browser tests there")


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Let no collection of garbage visit what importing the tests makes: with a million objects each takes long.

    Later ones are as rare as where kernels are compiled, which the tests do first.
    """
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.set_threshold(kernel_warmup.GARBAGE_MAX)
        gc.enable()


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    promises.collect(config, items)
    for item in items:
        if _is_in(item.path, *KERNEL_TESTS):
            item.add_marker("kernels")
    slow = slow_kernel_setting()
    if slow is None:
        return
    skip = pytest.mark.skip(reason=f"with {slow} kernels are slower than real time")
    for item in items:
        if item.get_closest_marker("realtime") is not None:
            item.add_marker(skip)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    if any(item.get_closest_marker(name) is not None for name in (promises.PROMISE, "soak")):
        item.user_properties.append((promises.PROMISE, ""))


class _PromisesPlugin:
    """Collects what tests report, and writes the page at the end."""

    def __init__(self, config: pytest.Config) -> None:
        self._config = config

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        results = self._config.stash.get(promises.RESULTS, None)
        if results is not None:  # None where nothing was collected
            results.add_report(report)

    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        page = self._config.getoption("promises")
        if page is None:
            return
        results, path = self._config.stash.get(promises.RESULTS, promises.Results()), Path(page)
        soak, day = path.name == promises.SOAK_PAGE.name, datetime.now(UTC).date().isoformat()
        try:
            before = promise_page.rows_in(path.read_text("utf-8")) if path.exists() else []
            rows = promise_page.merged(results, before, soak=soak, day=day)
            path.write_text(promise_page.render(rows, soak=soak), encoding="utf-8")
        except ValueError as error:
            self._config.get_terminal_writer().line(f"\n{page} was not changed: {error}", red=True)
            session.exitstatus = pytest.ExitCode.USAGE_ERROR


def pytest_configure(config: pytest.Config) -> None:
    config.pluginmanager.register(_PromisesPlugin(config), "promises")
    if config.option.forks:
        config.pluginmanager.register(
            ForkedTests(config.option.forks, _waits, _load_kernels, _write_coverage), "forked"
        )


def _waits(item: pytest.Item) -> bool:
    """Return whether a test waits for the clock or the browser, which one or two processes share."""
    return _is_in(item.path, BROWSER_TESTS) or item.get_closest_marker("realtime") is not None


@functools.cache
def _is_in(path: Path, *folders: Path) -> bool:
    """Return whether a file of tests, of which many ask, is in one of these folders."""
    return any(path.is_relative_to(folder) for folder in folders)


def _load_kernels(session: pytest.Session) -> None:
    from tests.inner_kernels import runs_interpreted_alone  # imports numba, which reads its settings

    compile_all(in_one_process=True)
    left = {item: None for item in session.items if runs_interpreted_alone(item)}
    session.items[:] = [item for item in session.items if item not in left]
    session.testscollected = len(session.items)  # of which the progress is a share
    session.config.hook.pytest_deselected(items=[*left])
    FREEZE()


def _write_coverage(process: int) -> None:
    if COVERAGE is not None:
        COVERAGE.write(process)


@pytest.fixture(scope="module", autouse=True)
def _children_and_kernels(request: pytest.FixtureRequest) -> Generator[None]:
    """Start children at the priority of the tests: at the low one, a few tests at a time leave them no processor.

    Warm up no kernel again: a forked process has them all, and it took a third of the time of commands.
    """
    with pytest.MonkeyPatch.context() as patch:
        if request.path.name != "test_child_process.py":
            patch.setattr(child_process, "LOW_PRIORITY", "runpy")
        if request.config.option.forks and request.path.name not in WARM_UP_TESTS:
            patch.setattr(kernel_warmup, "warm_up", lambda _settings, parts: list(parts))
        yield


@pytest.fixture(scope="session", autouse=True)
def _tests_stay_frozen() -> Generator[None]:
    """Keep the end of a drive from letting the tests themselves in again; see `pytest_collection`."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(gc, "freeze", lambda: None)
        patch.setattr(gc, "unfreeze", lambda: None)
        yield


@pytest.fixture
def may_freeze() -> Generator[None]:
    """Let a test exclude objects from the collection of garbage, and let them in again."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(gc, "freeze", FREEZE)
        patch.setattr(gc, "unfreeze", UNFREEZE)
        yield
    FREEZE()


@pytest.fixture
def measured(request: pytest.FixtureRequest) -> Callable[[str], None]:
    """Return a function that reports a measurement for the page of promises."""
    return lambda text: request.node.user_properties.append((promises.MEASURED, text))


@pytest.fixture(scope="session", autouse=True)
def _state_folder(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Keep the logs of runs under test out of the user's state folder."""
    os.environ["XDG_STATE_HOME"] = str(tmp_path_factory.mktemp("state"))


@pytest.fixture(scope="session")
def warm_kernels(request: pytest.FixtureRequest) -> None:
    """Compile every kernel before times are measured, also for processes that a test starts."""
    if not request.config.option.forks:  # else this process was forked from one that has them
        compile_all()
