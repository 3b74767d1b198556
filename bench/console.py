"""Cost of the operator console to a run: lateness and processor time with pages open and without, in turns.

Five pages are open, one of which never reads and reconnects when it is disconnected. They run in another process,
which discards what it reads, so that the figures are the robot's.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import orjson
from cyclopts import App
from rich.table import Table

from bench.timing import DRIVE_ON, TIMEOUT_S, emulating, finish, start
from config.errors import FAILED, UserError
from tests.rawpage import RawPage

LOG: Final = Path("echolocate", "echolocate.jsonl")
"""The log of a run, in its state folder."""
PAGES: Final = 5
LATE_MAX_US: Final = 500.0
"""Limit of the additional lateness of cycles at p99.9 while pages are open."""
SHARE_MAX: Final = 0.02
"""Limit of the share of a core per page."""
FRAMES_PER_S_MIN: Final = 18.0
"""Frames per second that every page must receive; the robot sends 20."""
WITHOUT, WITH = "without pages", "with pages"

app = App(help="Open pages of the operator console, as a process of its own.")


@dataclass(frozen=True, slots=True)
class Turn:
    """Figures of one run."""

    late_us: dict[str, float]
    cpu_share: float
    callbacks_us: dict[str, dict[str, float]]
    frames_per_s: float
    """Of the page that received the fewest."""
    stops: int


@app.default
def pages(url: str, count: int, seconds: float, out: Path, /) -> None:
    """Open pages, one of which never reads; write how many frames per second each of the others received.

    Parameters
    ----------
    url
        URL of the console.
    count
        Number of pages.
    seconds
        How long they stay open, s.
    out
        JSON file to write.
    """
    counts = [0] * (count - 1)
    end_s = time.monotonic() + seconds

    def read(k: int) -> None:
        page = RawPage(url)
        while time.monotonic() < end_s:
            page.next("state")
            counts[k] += 1
        page.close()

    def hold() -> None:
        while time.monotonic() < end_s:
            page = RawPage(url, receive_bytes=4096)
            # The console disconnects a page that does not read.
            time.sleep(max(0.0, min(15.0, end_s - time.monotonic())))
            page.close()

    threads = [threading.Thread(target=read, args=(k,)) for k in range(count - 1)] + [threading.Thread(target=hold)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    out.write_bytes(orjson.dumps([n / seconds for n in counts]))


def one_turn(folder: Path, seconds: float, count: int) -> Turn:
    """Run the robot with open pages and return the figures of the run.

    Parameters
    ----------
    folder
        Folder for the files of the run.
    seconds
        Duration, s.
    count
        Number of open pages.

    Raises
    ------
    UserError
        A process failed.
    """
    summary, frames = folder / "run.json", folder / "frames.json"
    (folder / LOG).unlink(missing_ok=True)
    with emulating(folder, ()) as port:
        run = start(
            folder, "run", "runtime.cli", "run", "--headless", "--port", port, "--arm", "--seconds", f"{seconds}",
            "--json", str(summary), "--force", "--no-record", *DRIVE_ON, "--set", "console.port=0",
        )  # fmt: skip
        page_process: subprocess.Popen[bytes] | None = None
        if count:
            url = start_url(folder, run)
            # A second less: the run starts when the robot has answered.
            page_process = start(folder, "pages", "bench.console", url, f"{count}", f"{seconds - 1.0}", str(frames))
        finish(folder, run, "run", seconds + TIMEOUT_S)
        if page_process is not None:
            finish(folder, page_process, "pages", TIMEOUT_S)
    written: dict[str, Any] = orjson.loads(summary.read_bytes())
    timing = written["timing"]
    return Turn(
        {name: float(us) for name, us in timing["late"].items()}, written["process"]["cpu_share"],
        {name: row for name, row in timing["callbacks"].items() if name.startswith("console")},
        min(orjson.loads(frames.read_bytes())) if count else 0.0, len(written["stop_reasons"]),
    )  # fmt: skip


def start_url(folder: Path, run: subprocess.Popen[bytes]) -> str:
    """Wait for the line with the console's start URL in the log of a run, and return the URL.

    Raises
    ------
    UserError
        The run ended or timed out without it.
    """
    log = folder / LOG
    end_s = time.monotonic() + TIMEOUT_S
    while time.monotonic() < end_s and run.poll() is None:
        found = re.findall(r'"start_url":"(http[^"]+)"', log.read_text("utf-8")) if log.exists() else []
        if found:
            return str(found[0])
        time.sleep(0.02)
    raise UserError(f"the run logged no start URL: {(folder / 'run.err').read_text('utf-8')[-500:]}", FAILED)


def measure(seconds: float, rounds: int, report: Callable[[str], None]) -> dict[str, list[Turn]]:
    """Return the figures of runs with pages and without, run in turns.

    Parameters
    ----------
    seconds
        Duration of each run, s.
    rounds
        Number of runs of each kind.
    report
        Called with a line on what is running.
    """
    turns: dict[str, list[Turn]] = {WITHOUT: [], WITH: []}
    with tempfile.TemporaryDirectory(prefix="echolocate-bench-") as name:
        for turn in range(1, rounds + 1):
            for how, count in ((WITHOUT, 0), (WITH, PAGES)):
                report(f"console: {how}, {seconds:g} s, turn {turn} of {rounds}")
                turns[how].append(one_turn(Path(name), seconds, count))
    return turns


def figures(turns: dict[str, list[Turn]]) -> dict[str, dict[str, float]]:
    """Return the medians over all turns, with pages and without."""
    rows = {}
    for how, of in turns.items():
        rows[how] = {
            **{f"late, {name} µs": float(np.median([t.late_us[name] for t in of])) for name in of[0].late_us},
            "core, share": float(np.median([t.cpu_share for t in of])),
            "frames per second, slowest page": min(t.frames_per_s for t in of),
            "stops": float(sum(t.stops for t in of)),
        }
        names = {name for t in of for name in t.callbacks_us}
        for name in sorted(names):
            known = [t.callbacks_us[name]["p50"] for t in of if name in t.callbacks_us]
            rows[how][f"{name}, p50 µs"] = float(np.median(known))
    return rows


def checks(rows: dict[str, dict[str, float]]) -> list[tuple[str, float, float]]:
    """Return the checks: name, figure and limit."""
    more_us = rows[WITH]["late, p999 µs"] - rows[WITHOUT]["late, p999 µs"]
    share = (rows[WITH]["core, share"] - rows[WITHOUT]["core, share"]) / PAGES
    return [
        ("later at p99.9 with pages than without, µs", more_us, LATE_MAX_US),
        ("of a core, each page", share, SHARE_MAX),
        ("frames per second missing", FRAMES_PER_S_MIN - rows[WITH]["frames per second, slowest page"], 0.0),
    ]


def console_table(rows: dict[str, dict[str, float]], seconds: float, rounds: int) -> Table:
    """Return the table: one row per figure, then one per check."""
    title = f"console: {PAGES} pages, one of which never reads; {rounds} × {seconds:g} s each, medians"
    table = Table(title=title, title_justify="left")
    for column in ("what", WITHOUT, WITH, "at most", ""):
        table.add_column(column, justify="left" if column == "what" else "right")
    for name in rows[WITH]:
        table.add_row(name, *(_text(rows[how].get(name)) for how in (WITHOUT, WITH)))
    for name, figure, limit in checks(rows):
        kept = "kept" if figure <= limit else "[bold red]missed[/]"
        table.add_row(name, "", _text(figure), _text(limit), kept)
    return table


def _text(figure: float | None) -> str:
    return "" if figure is None else f"{figure:.4g}" if abs(figure) < 100.0 else f"{figure:.0f}"


if __name__ == "__main__":
    sys.exit(app(result_action="return_value"))
