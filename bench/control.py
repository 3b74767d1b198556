"""Paired controls of the timing measurements: programs that do the least a process can do.

``wake`` sleeps to a grid of deadlines without an event loop; ``answer`` sends a DRIVE for each ECHO, from a blocking
read to a blocking write. Their times are those of the machine under its present load.
"""

from __future__ import annotations

import os
import sys
import time
import tty
from pathlib import Path
from typing import Annotated, Final

from cyclopts import App, Parameter

from config.load import load_settings
from drivers.denning.codec import Decoder, encode
from drivers.denning.frames import Drive, Echo, Hello, Pattern
from drivers.denning.wire_units import wire_pattern

READ_MAX: Final = 4096
app = App(help="Minimal programs as controls of the timing measurements.")


@app.command
def wake(period_s: float, seconds: float, out: Path, /) -> None:
    """Sleep to deadlines `period_s` apart for `seconds`; write how late each wake-up was, µs, one per line."""
    late_us = []
    begin_s = time.monotonic()
    for k in range(1, int(seconds / period_s) + 1):
        deadline_s = begin_s + k * period_s
        time.sleep(max(0.0, deadline_s - time.monotonic()))
        late_us.append(1e6 * (time.monotonic() - deadline_s))
    out.write_text("".join(f"{late:.1f}\n" for late in late_us))


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
