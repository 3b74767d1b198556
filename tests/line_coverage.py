"""Which lines of the product the tests execute, measured by slipcover in the workers of pytest-xdist.

With `LINE_COVERAGE=FOLDER` in the environment, each worker writes what it has seen to a file there, and
`python -m slipcover --merge` adds the files up. Slipcover removes its probes from lines that it has seen often, so
tests run nearly as fast as without; a tracer doubles their time. The probes are byte code inside the functions. Numba
would compile them, too, so files with kernels are measured only in a run that compiles none (`NUMBA_DISABLE_JIT=1`).
"""

from __future__ import annotations

import json
import os
import re
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).parents[1]
PRODUCT: Final = ("config", "drivers", "perception", "behaviors", "runtime")
ELSEWHERE: Final = (
    "drivers/firmware/board/",
    "drivers/ros2/gateway.py",
    "runtime/bridges/ros2/bridge.py",
    "runtime/bridges/ros2/node.py",
    "runtime/bridges/ros2/robot_listener.py",
)
"""What tests run in another Python, of which no probe reports: MicroPython, and that with ROS (`make ros2`)."""
PASSES: Final = 5000
"""How often a line is executed until the probes of all lines seen so far are removed. A probe costs 0.1 µs each time,
removing them costs 0.1 s, because every function of the product is looked at."""
KERNEL: Final = re.compile(r"^@(owning_)?kernel$", re.MULTILINE)


class MeasuredFiles:
    """Selects the files to measure, as `slipcover.FileMatcher` does."""

    def __init__(self, *, with_kernels: bool) -> None:
        self._folders = [ROOT / package for package in PRODUCT]
        self._with_kernels = with_kernels

    def matches(self, file: str | Path | None) -> bool:
        """Return whether a file belongs to the product and may be changed."""
        path = Path(file or "")
        if path.suffix != ".py" or not any(map(path.is_relative_to, self._folders)):
            return False
        return self._with_kernels or KERNEL.search(path.read_text("utf-8")) is None


class LineCoverage:
    """Measures the modules of the product that are imported from now on."""

    def __init__(self, report: Path, *, list_all: bool, with_kernels: bool) -> None:
        from slipcover import ImportManager, Slipcover  # only where lines are measured

        self._report = report
        self._slipcover = Slipcover(
            source=[str(ROOT / package) for package in PRODUCT] if list_all else None, d_miss_threshold=PASSES
        )
        ImportManager(self._slipcover, MeasuredFiles(with_kernels=with_kernels)).__enter__()

    def write(self) -> None:
        """Write the lines that were executed, and those that were not."""
        coverage = self._slipcover.get_coverage()
        coverage["files"] = {
            path: lines for path, lines in coverage["files"].items() if not path.startswith(ELSEWHERE)
        }  # fmt: skip
        self._report.parent.mkdir(parents=True, exist_ok=True)
        self._report.write_text(json.dumps(coverage), encoding="utf-8")


def start() -> LineCoverage | None:
    """Start to measure, if the environment asks for it and this is a worker of pytest-xdist."""
    worker = os.environ.get("PYTEST_XDIST_WORKER")
    if worker is None or not (folder := os.environ.pop("LINE_COVERAGE", "")):  # popped: not for children of tests
        return None
    with_kernels = os.environ.get("NUMBA_DISABLE_JIT", "0") not in {"", "0"}
    name = f"{'interpreted' if with_kernels else 'compiled'}-{worker}.json"
    # One of the workers also lists the files that no test imports.
    return LineCoverage(ROOT / folder / name, list_all=worker == "gw0", with_kernels=with_kernels)
