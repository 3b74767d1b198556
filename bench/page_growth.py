"""Growth of a run while pages of the operator console come and go: memory, file descriptors, threads.

The real command on a real pseudo-terminal. A page in four loses its connection instead of closing it, one in eight
never reads. A line through the samples after the first tenth gives the growth.
"""

from __future__ import annotations

import os
import signal
import socket
import struct
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from rich.table import Table

from bench.console import start_url
from bench.timing import DRIVE_ON, TIMEOUT_S, emulating, finish, start
from config.errors import FAILED, UserError
from tests.rawpage import RawPage

SAMPLES: Final = 200
SETTLED_SHARE: Final = 0.1
"""Share of the time in which caches fill."""
GROWTH_MAX_MB_H: Final = 2.0
"""Limit of the growth of memory in an hour, in which some 8,000 pages come and go."""
OPEN_S: Final = (0.05, 0.6)
RESET: Final = struct.pack("ii", 1, 0)
"""The socket option `SO_LINGER` that drops a connection instead of closing it."""


@dataclass(frozen=True, slots=True)
class Sample:
    """The run's process at one moment."""

    at_s: float
    memory_mb: float
    descriptors: int
    threads: int


@dataclass(frozen=True, slots=True)
class PageGrowth:
    """What came and went, and what the run's process held meanwhile."""

    pages: int
    samples: tuple[Sample, ...]

    def slope(self, of: Callable[[Sample], float]) -> float:
        """Return the growth of a figure in an hour, once caches are filled."""
        settled = self.samples[round(SETTLED_SHARE * len(self.samples)) :]
        at_h = np.array([s.at_s for s in settled]) / 3600.0
        return float(np.polyfit(at_h - at_h[0], [of(s) for s in settled], 1)[0])

    def as_json(self) -> dict[str, float]:
        """Return the figures as written to a JSON file."""
        first, last = self.samples[round(SETTLED_SHARE * len(self.samples))], self.samples[-1]
        return {
            "seconds": round(last.at_s, 1),
            "pages": self.pages,
            "memory, MB, settled": round(first.memory_mb, 1),
            "memory, MB, end": round(last.memory_mb, 1),
            "memory, MB, most": round(max(s.memory_mb for s in self.samples), 1),
            "memory growth, MB/h": round(self.slope(lambda s: s.memory_mb), 2),
            "file descriptors, settled": first.descriptors,
            "file descriptors, end": last.descriptors,
            "threads, settled": first.threads,
            "threads, end": last.threads,
        }

    def table(self) -> Table:
        """Return the figures as a table."""
        table = Table(title="pages that come and go", title_justify="left")
        table.add_column("what")
        table.add_column("measured", justify="right")
        table.add_column("at most", justify="right")
        for name, figure in self.as_json().items():
            table.add_row(name, f"{figure:g}", f"{GROWTH_MAX_MB_H:g}" if name == "memory growth, MB/h" else "")
        return table


def sample(pid: int, at_s: float) -> Sample:
    """Return what a process holds now."""
    resident_pages = int(Path(f"/proc/{pid}/statm").read_text("ascii").split()[1])
    threads = len(list(Path(f"/proc/{pid}/task").iterdir()))
    descriptors = len(list(Path(f"/proc/{pid}/fd").iterdir()))
    return Sample(at_s, resident_pages * os.sysconf("SC_PAGE_SIZE") / 1e6, descriptors, threads)


def opened(url: str, receive_bytes: int | None) -> RawPage:
    """Return an open page; wait while the run still counts pages that have gone without a word."""
    end_s = time.monotonic() + TIMEOUT_S
    while True:
        try:
            return RawPage(url, receive_bytes)
        except ConnectionError as error:
            if "503" not in str(error) or time.monotonic() > end_s:
                raise UserError(f"the run accepts no page: {error}", FAILED) from error
            time.sleep(0.2)


def visit(url: str, number: int, open_s: float) -> None:
    """Open a page, read some of what it gets, and leave in one of four ways."""
    page = opened(url, receive_bytes=4096 if number % 8 == 5 else None)
    end_s = time.monotonic() + open_s
    if number % 8 != 5:
        page.next("state")
        if number % 3 == 0:
            page.say(type="take_control")
        while time.monotonic() < end_s:
            page.next("state")
    else:
        time.sleep(open_s)
    if number % 4 == 1:
        page.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, RESET)
    page.socket.close()


def measure_page_growth(seconds: float, report: Callable[[str], None]) -> PageGrowth:
    """Return what a run held while pages came and went.

    Parameters
    ----------
    seconds
        Duration, s.
    report
        Called with a line on the progress.

    Raises
    ------
    UserError
        The run or the emulator failed.
    """
    rng = np.random.default_rng(1)
    samples: list[Sample] = []
    pages = 0
    with tempfile.TemporaryDirectory(prefix="echolocate-bench-") as name:
        folder = Path(name)
        with emulating(folder, ()) as port:
            run = start(
                folder, "run", "runtime.cli", "run", "--headless", "--port", port, "--arm",
                "--record", str(folder / "run.mcap"), *DRIVE_ON, "--set", "console.port=0",
            )  # fmt: skip
            url = start_url(folder, run)
            began_s = time.monotonic()
            while (at_s := time.monotonic() - began_s) < seconds:
                visit(url, pages, float(rng.uniform(*OPEN_S)))
                pages += 1
                if at_s * SAMPLES >= len(samples) * seconds:
                    samples.append(sample(run.pid, at_s))
                    report(f"pages: {at_s:.0f} of {seconds:.0f} s, {pages:,} pages, {samples[-1].memory_mb:.1f} MB")
            run.send_signal(signal.SIGTERM)
            finish(folder, run, "run", TIMEOUT_S)
    return PageGrowth(pages, tuple(samples))
