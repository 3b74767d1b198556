"""Which lines of the product the tests execute, measured by slipcover in each process of `pytest --forks`.

With `LINE_COVERAGE=FOLDER` in the environment, each process writes what it has seen to a file there, and
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
COMPILER: Final = ROOT / "perception" / "kernel_compiler.py"
"""Its byte code is part of each kernel's name in the cache: with probes in it, no run would find a kernel there."""
KERNEL: Final = re.compile(r"^@([a-z]+_)?kernel$", re.MULTILINE)


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
        return self._with_kernels or (path != COMPILER and KERNEL.search(path.read_text("utf-8")) is None)


class LineCoverage:
    """Measures the modules of the product that are imported from now on."""

    def __init__(self, folder: Path, *, with_kernels: bool) -> None:
        from slipcover import ImportManager, Slipcover  # only where lines are measured

        self._folder = folder
        self._name = "interpreted" if with_kernels else "compiled"
        self._slipcover = Slipcover(d_miss_threshold=PASSES)
        ImportManager(self._slipcover, MeasuredFiles(with_kernels=with_kernels)).__enter__()

    def write(self, process: int) -> None:
        """Write the lines that were executed and those that were not; process 0 lists the files never imported."""
        self._slipcover.source = [str(ROOT / package) for package in PRODUCT] if process == 0 else None
        coverage = self._slipcover.get_coverage()
        coverage["files"] = {
            path: lines for path, lines in coverage["files"].items() if not path.startswith(ELSEWHERE)
        }  # fmt: skip
        self._folder.mkdir(parents=True, exist_ok=True)
        (self._folder / f"{self._name}-{process}.json").write_text(json.dumps(coverage), encoding="utf-8")


def start() -> LineCoverage | None:
    """Start to measure, if the environment asks for it."""
    if not (folder := os.environ.pop("LINE_COVERAGE", "")):  # popped: not for children of tests
        return None
    return LineCoverage(ROOT / folder, with_kernels=os.environ.get("NUMBA_DISABLE_JIT", "0") not in {"", "0"})
