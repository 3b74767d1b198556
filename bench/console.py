"""What the operator console costs a run: lateness and processor time with pages open and without, in turns.

Five pages are open of which one never reads; it comes back where it is let go. They are another process, which reads
and forgets, so that what is measured is the robot's.
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

from bench.timing import DRIVE_ON, PATIENCE_S, emulating, finish, start
from config.errors import FAILED, UserError
from tests.rawpage import RawPage

PAGES: Final = 5
LATE_MAX_US: Final = 500.0
"""By so much more may cycles be late at p99.9 while pages are open."""
SHARE_MAX: Final = 0.02
"""Of a core, for each page."""
FRAMES_PER_S_MIN: Final = 18.0
WITHOUT, WITH = "without pages", "with pages"

app = App(help="Pages that are open, as a program of its own.")


@dataclass(frozen=True, slots=True)
class Turn:
    """A run of its own."""

    late_us: dict[str, float]
    cpu_share: float
    callbacks_us: dict[str, dict[str, float]]
    frames_per_s: float
    """A page."""
    stops: int


@app.default
def pages(url: str, count: int, seconds: float, out: Path, /) -> None:
    """Open `count` pages for a while, of which one never reads; write how many frames the others had."""
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
            # It is let go after a while of this.
            time.sleep(max(0.0, min(15.0, end_s - time.monotonic())))
            page.close()

    threads = [threading.Thread(target=read, args=(k,)) for k in range(count - 1)] + [threading.Thread(target=hold)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    out.write_bytes(orjson.dumps([n / seconds for n in counts]))


def one_turn(folder: Path, seconds: float, count: int) -> Turn:
    """Run the command for a while with so many pages open."""
    summary, frames = folder / "run.json", folder / "frames.json"
    with emulating(folder, ()) as port:
        run = start(
            folder, "run", "runtime.cli.app", "run", "--headless", "--port", port, "--arm", "--seconds", f"{seconds}",
            "--json", str(summary), "--no-record", *DRIVE_ON, "--set", "console.port=0",
        )  # fmt: skip
        beside: subprocess.Popen[bytes] | None = None
        if count:
            url = start_url(folder / "run.err", run)
            # A second less: the run begins when the robot has answered.
            beside = start(folder, "pages", "bench.console", url, f"{count}", f"{seconds - 1.0}", str(frames))
        finish(folder, run, "run", seconds + PATIENCE_S)
        if beside is not None:
            finish(folder, beside, "pages", PATIENCE_S)
    told: dict[str, Any] = orjson.loads(summary.read_bytes())
    timing = told["timing"]
    return Turn(
        {name: float(us) for name, us in timing["late"].items()}, told["process"]["cpu_share"],
        {name: row for name, row in timing["callbacks"].items() if name.startswith("console")},
        min(orjson.loads(frames.read_bytes())) if count else 0.0, len(told["stop_reasons"]),
    )  # fmt: skip


def start_url(err: Path, run: subprocess.Popen[bytes]) -> str:
    """Wait for the line that tells where the console is.

    Raises
    ------
    UserError
        It never comes.
    """
    end_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < end_s and run.poll() is None:
        found = re.search(r"start_url='?(http[^\s']+)", err.read_text("utf-8", errors="replace"))
        if found:
            return found[1]
        time.sleep(0.02)
    raise UserError(f"the run told no start URL: {err.read_text('utf-8', errors='replace')[-500:]}", FAILED)


def measure(seconds: float, rounds: int, told: Callable[[str], None]) -> dict[str, list[Turn]]:
    """Run with pages and without in turns."""
    turns: dict[str, list[Turn]] = {WITHOUT: [], WITH: []}
    with tempfile.TemporaryDirectory(prefix="echolocate-bench-") as name:
        for turn in range(1, rounds + 1):
            for how, count in ((WITHOUT, 0), (WITH, PAGES)):
                told(f"console: {how}, {seconds:g} s, turn {turn} of {rounds}")
                turns[how].append(one_turn(Path(name), seconds, count))
    return turns


def figures(turns: dict[str, list[Turn]]) -> dict[str, dict[str, float]]:
    """Return the medians over all turns of what each way came to."""
    rows = {}
    for how, of in turns.items():
        rows[how] = {
            **{f"late, {name} µs": float(np.median([t.late_us[name] for t in of])) for name in of[0].late_us},
            "core, share": float(np.median([t.cpu_share for t in of])),
            "frames a second, the least of a page": min(t.frames_per_s for t in of),
            "stops": float(sum(t.stops for t in of)),
        }
        names = {name for t in of for name in t.callbacks_us}
        for name in sorted(names):
            known = [t.callbacks_us[name]["p50"] for t in of if name in t.callbacks_us]
            rows[how][f"{name}, p50 µs"] = float(np.median(known))
    return rows


def verdicts(rows: dict[str, dict[str, float]]) -> list[tuple[str, float, float]]:
    """Return what was asked: a name, the figure, and the most it may be."""
    more_us = rows[WITH]["late, p999 µs"] - rows[WITHOUT]["late, p999 µs"]
    share = (rows[WITH]["core, share"] - rows[WITHOUT]["core, share"]) / PAGES
    return [
        ("later at p99.9 with pages than without, µs", more_us, LATE_MAX_US),
        ("of a core, each page", share, SHARE_MAX),
        ("frames a second missing", FRAMES_PER_S_MIN - rows[WITH]["frames a second, the least of a page"], 0.0),
    ]


def console_table(rows: dict[str, dict[str, float]], seconds: float, rounds: int) -> Table:
    """Return the table: a row a figure, then what was asked."""
    title = f"console: {PAGES} pages, one of which never reads; {rounds} × {seconds:g} s each, medians"
    table = Table(title=title, title_justify="left")
    for column in ("what", WITHOUT, WITH, "at most", ""):
        table.add_column(column, justify="left" if column == "what" else "right")
    for name in rows[WITH]:
        table.add_row(name, *(_text(rows[how].get(name)) for how in (WITHOUT, WITH)))
    for name, figure, limit in verdicts(rows):
        kept = "kept" if figure <= limit else "[bold red]missed[/]"
        table.add_row(name, "", _text(figure), _text(limit), kept)
    return table


def _text(figure: float | None) -> str:
    return "" if figure is None else f"{figure:.4g}" if abs(figure) < 100.0 else f"{figure:.0f}"


if __name__ == "__main__":
    sys.exit(app(result_action="return_value"))
