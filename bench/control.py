"""Paired controls of the timing measurements: programs that do the least a process can do.

``wake`` sleeps to a grid of deadlines without an event loop, and does the same work after each; ``answer`` sends a
DRIVE for each ECHO, from a blocking read to a blocking write. Their times are those of the machine under its present
load: a neighbour that shares its caches and cores makes the same work several times longer now and then.
"""

from __future__ import annotations

import os
import sys
import time
import tty
from pathlib import Path
from typing import Annotated, Any, Final

from cyclopts import App, Parameter

from config.load import load_settings
from drivers.denning.codec import Decoder, encode
from drivers.denning.frames import Drive, Echo, Hello, Pattern
from drivers.denning.wire_units import wire_pattern

READ_MAX: Final = 4096
OBJECTS: Final = 20_000
"""Objects that the work visits in turns: they do not fit into a core's cache, as the program's own do not."""
STEPS: Final = 1_500
"""Steps of the work after a deadline, which take about as long as a cycle: 1.24 ms at the median, a cycle 1.15."""
app = App(help="Minimal programs as controls of the timing measurements.")


@app.command
def wake(period_s: float, seconds: float, out: Path, /) -> None:
    """Sleep to deadlines `period_s` apart for `seconds`; write a line for each: lateness, time of the work, µs."""
    objects = [{"number": float(i), "pair": [i, i + 1]} for i in range(OBJECTS)]
    lines = []
    begin_s = time.monotonic()
    for k in range(1, int(seconds / period_s) + 1):
        deadline_s = begin_s + k * period_s
        time.sleep(max(0.0, deadline_s - time.monotonic()))
        awake_s = time.monotonic()
        _work(objects, 101 * k)
        lines.append(f"{1e6 * (awake_s - deadline_s):.1f},{1e6 * (time.monotonic() - awake_s):.1f}\n")
    out.write_text("".join(lines))


def _work(objects: list[dict[str, Any]], begin: int) -> float:
    """Return a sum over some of the objects, which are far from each other in memory."""
    total = 0.0
    for step in range(STEPS):
        one = objects[(begin + 37 * step) % OBJECTS]
        total += 0.5 * one["number"] + one["pair"][1]
    return total


@app.command
def answer(port: str, seconds: float, /, *, sets: Annotated[tuple[str, ...], Parameter(name="--set")] = ()) -> None:
    """Answer every ECHO on `port` with a DRIVE of zero velocity for `seconds`."""
    pattern = wire_pattern(load_settings("hallway", sets).ring)
    line = os.open(port, os.O_RDWR | os.O_NOCTTY)
    tty.setraw(line)
    decoder = Decoder("robot", midway=True)
    seq = 2
    os.write(line, b"\0" + encode(Hello(0)) + encode(Pattern(1, *pattern)))
    end_s = time.monotonic() + seconds
    while time.monotonic() < end_s:  # odometry keeps arriving, so that no read blocks for long
        for frame in decoder.feed(os.read(line, READ_MAX)):
            if isinstance(frame, Echo):
                os.write(line, encode(Drive(seq % 256, 0, 0)))
                seq += 1
    os.close(line)


if __name__ == "__main__":
    sys.exit(app(result_action="return_value"))
