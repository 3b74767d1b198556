"""Runs a module's tests on each of its mutants, each in a forked process; writes docs/mutants.md.

`NUMBA_DISABLE_JIT=1 python -m tests.mutation.campaign [MODULE …]`. The parent imports the libraries but none of our
modules, so that a mutant costs little more than its tests. A mutant that hangs is killed.
"""

from __future__ import annotations

import importlib.abc
import importlib.util
import os
import signal
import sys
import tempfile
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import ModuleType

from tests.mutation.accepted import ACCEPTED
from tests.mutation.mutants import Mutant, mutants

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "mutants.md"
TARGETS: dict[str, tuple[str, ...]] = {
    "drivers/denning/codec.py": (
        "tests/drivers/denning/test_codec.py",
        "tests/drivers/denning/test_frames.py",
        "tests/drivers/denning/test_driver.py",
        "tests/drivers/denning/test_driver_commands.py",
        "tests/drivers/denning/test_pose_stamping.py",
        "tests/drivers/denning/test_diagnostics.py",
        "tests/drivers/denning/test_wire_units.py",
    ),
    "drivers/denning/frames.py": (
        "tests/drivers/denning/test_codec.py",
        "tests/drivers/denning/test_frames.py",
        "tests/drivers/denning/test_wire_units.py",
    ),
    "drivers/firing_pattern.py": ("tests/drivers/test_firing_pattern.py",),
    "behaviors/arbiter.py": (
        "tests/behaviors/test_arbiter.py",
        "tests/behaviors/surroundings/test_field_of_view.py",
        "tests/behaviors/test_teleoperation.py",
    ),
    "runtime/cycle/modes.py": ("tests/runtime/cycle/test_modes.py",),
}
KILLED_MIN = 0.85
"""Share of the mutants that the tests must detect."""
CPU_MAX_S = 180
"""CPU time after which a mutant counts as killed, because it loops."""
TIMEOUT_S = 20 * CPU_MAX_S
"""Time after which it counts as killed, because it waits; long enough for a busy machine."""
INTRODUCTION = (
    "Each module below was changed in one place at a time, and its tests were run on every change, without compiled",
    "kernels. `make mutants` repeats that and writes this page. Every change that no test detects is listed with the",
    "reason why that is acceptable.",
)
JOBS = 2 * (os.cpu_count() or 1)
"""More than processors, because much of a run waits for files."""
LIBRARIES = ("hypothesis", "numba", "numpy", "orjson", "pydantic", "pytest", "pytest_asyncio", "rich.console",
             "structlog", "cobs.cobs", "serial")  # fmt: skip


@dataclass(frozen=True)
class Outcome:
    """Mutants of a module that the tests detected, and those that survived."""

    module: str
    killed: tuple[Mutant, ...]
    survived: tuple[Mutant, ...]

    @property
    def share(self) -> float:
        """Share of the mutants that were killed."""
        return len(self.killed) / max(1, len(self.killed) + len(self.survived))

    @property
    def unexplained(self) -> list[str]:
        """Keys of the survivors without an accepted reason."""
        return [m.key for m in self.survived if m.key not in ACCEPTED.get(self.module, {})]


class _SourceReplacer(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Import hook that loads one module from another source."""

    def __init__(self, module: str, source: str) -> None:
        self._name = module.removesuffix(".py").replace("/", ".")
        self._path = str(ROOT / module)
        self._source = source

    def find_spec(self, name: str, path: object, target: object = None) -> ModuleSpec | None:  # noqa: ARG002
        if name != self._name:
            return None
        return importlib.util.spec_from_file_location(name, self._path, loader=self)

    def create_module(self, spec: ModuleSpec) -> None:  # noqa: ARG002
        return None

    def exec_module(self, module: ModuleType) -> None:
        exec(compile(self._source, self._path, "exec"), module.__dict__)


def load_libraries() -> None:
    """Import the libraries that tests need, before processes are forked."""
    for name in LIBRARIES:
        importlib.import_module(name)


def start(module: str, source: str, tests: Sequence[str]) -> int:
    """Fork a process that runs `tests` with `source` as the source of `module`; return its process ID."""
    child = os.fork()
    if child == 0:
        code = 1
        try:
            signal.setitimer(signal.ITIMER_PROF, CPU_MAX_S)
            signal.alarm(TIMEOUT_S)
            code = _run(module, source, tests)
        finally:
            os._exit(code)
    return child


def survivors(module: str, sources: Sequence[str], tests: Sequence[str]) -> list[int]:
    """Return the indices of the sources with which `tests` pass; a few run at a time."""
    running: dict[int, int] = {}
    passed = []
    todo = list(enumerate(sources))[::-1]
    while todo or running:
        while todo and len(running) < JOBS:
            number, source = todo.pop()
            running[start(module, source, tests)] = number
        child, status = os.wait()
        number = running.pop(child)
        if status == 0:
            passed.append(number)
    return sorted(passed)


def _run(module: str, source: str, tests: Sequence[str]) -> int:
    """Run the tests in this process without output, up to the first failure; examples are not shrunk."""
    import hypothesis
    import pytest

    silent = os.open(os.devnull, os.O_WRONLY)
    for fd in (1, 2):
        os.dup2(silent, fd)
    os.chdir(ROOT)
    phases = (hypothesis.Phase.explicit, hypothesis.Phase.generate)
    hypothesis.settings.register_profile("mutants", phases=phases, database=None, derandomize=True, deadline=None)
    hypothesis.settings.load_profile("mutants")
    os.environ["PYTEST_DISABLE_PLUGIN_AUTOLOAD"] = "1"
    sys.meta_path.insert(0, _SourceReplacer(module, source))
    options = ["-x", "-q", "-p", "no:cacheprovider", "-p", "pytest_asyncio.plugin", "-m", "not soak and not realtime"]
    options += ["-W", "ignore::pytest.PytestAssertRewriteWarning"]  # the libraries are already imported
    with tempfile.TemporaryDirectory() as folder:  # pytest's default folders are not safe for parallel runs
        return int(pytest.main([*options, "--basetemp", f"{folder}/tests", *tests]))


def campaign(module: str, tests: Sequence[str]) -> Outcome:
    """Return the outcome of every mutant of `module`.

    Raises
    ------
    RuntimeError
        The tests fail on the unchanged module.
    """
    source = (ROOT / module).read_text("utf-8")
    if not survivors(module, [source], tests):
        raise RuntimeError(f"{module}: its tests fail on the unchanged module")
    found = list(mutants(source))
    alive = set(survivors(module, [m.source for m in found], tests))
    killed = tuple(m for k, m in enumerate(found) if k not in alive)
    return Outcome(module, killed, tuple(m for k, m in enumerate(found) if k in alive))


def page(outcomes: Iterable[Outcome]) -> str:
    """Return the page as Markdown."""
    lines = [
        "# Mutants",
        "",
        *INTRODUCTION,
        "",
        "| module | mutants | killed | share |",
        "|---|---|---|---|",
    ]
    found = list(outcomes)
    for o in found:
        many = len(o.killed) + len(o.survived)
        lines.append(f"| `{o.module}` | {many} | {len(o.killed)} | {100 * o.share:.1f} % |")
    for o in found:
        lines += ["", f"## Survivors of `{o.module}`", ""] + ([] if o.survived else ["None."])
        for m in o.survived:
            reason = ACCEPTED.get(o.module, {}).get(m.key, "no reason yet")
            lines.append(f"- `{m.where}`: `{m.before}` → `{m.after}`: {reason}")
    return "\n".join(lines) + "\n"


def main(modules: Sequence[str]) -> int:
    """Test the mutants of `modules`, or of all targets; return 0 if enough are killed and all survivors accepted."""
    load_libraries()
    outcomes = []
    for module in modules or list(TARGETS):
        begin_host_s = time.monotonic()
        outcome = campaign(module, TARGETS[module])
        outcomes.append(outcome)
        many = len(outcome.killed) + len(outcome.survived)
        sys.stdout.write(
            f"{module}: {len(outcome.killed)} of {many} killed ({100 * outcome.share:.1f} %), "
            f"{time.monotonic() - begin_host_s:.0f} s\n"
        )
        for m in outcome.survived:
            sys.stdout.write(f"  {'' if m.key in ACCEPTED.get(module, {}) else 'NEW '}line {m.line} {m.key}\n")
        sys.stdout.flush()
    if not modules:
        PAGE.write_text(page(outcomes), "utf-8")
    return 0 if all(o.share >= KILLED_MIN and not o.unexplained for o in outcomes) else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
