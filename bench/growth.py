"""What a long drive leaves behind: memory, late compilations, full collections. `make soak` drives for a day.

A program of its own, so that nothing but the drive is in the figures. Virtual time, the emulated robot in the same
process: whatever that one leaves behind counts as well.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass, field
from typing import Annotated, Any, Final

import numpy as np
import orjson
from cyclopts import App, Parameter
from rich.console import Console

from config.errors import DONE, FAILED
from config.load import load_settings
from drivers.emulator.robot_device import GroundTruth
from runtime.cycle.modes import Mode
from runtime.cycle.step import CycleRecord
from runtime.simulation.closed_loop import simulate
from runtime.support.kernel_cache import compiled_signatures, ready_kernels
from runtime.timing.footprint import own_mb
from runtime.timing.memory_policy import MemoryPolicy

SETTLED_CYCLES: Final = 1000
"""A minute: once down the hall, by when everything that is allocated at first need has been."""
GROWTH_MAX_MB: Final = 1.0
"""In an hour, and in whatever is shorter."""
SAMPLE_CYCLES: Final = 1000
SETTLED_SHARE: Final = 0.2
"""Of a drive: tables that are filled as the map fills come to their size in it."""
LINE_MIN: Final = 10
"""Samples through which a line is laid, at least."""
WRAP_US: Final = 2**32
SLACK_S: Final = 0.04
"""What is left of a cycle's period; virtual time has no slack of its own."""

app = App(help="Drive for many cycles in virtual time and say what is left behind.")


@dataclass
class Left:
    """Looks on from the moment when everything is settled."""

    memory: MemoryPolicy
    last: int
    """The cycle after which the account is drawn up, while everything is still there."""
    before_mb: float = math.nan
    after_mb: float = math.nan
    signatures: int = 0
    modes: set[Mode] = field(default_factory=set)
    samples: list[tuple[float, float]] = field(default_factory=list)
    """Virtual time, s, and memory, MB."""

    def on_cycle(self, record: CycleRecord, _truth: GroundTruth) -> None:
        """Keep the memory policy as a run on a line does."""
        self.memory.cycle_done(SLACK_S)
        if record.cycle == SETTLED_CYCLES:
            self.before_mb = own_mb() or math.nan
            self.signatures = compiled_signatures()
            self.modes.clear()
        self.modes.add(record.mode.mode)
        if record.cycle > SETTLED_CYCLES and record.cycle % SAMPLE_CYCLES == 0:
            self.samples.append((record.inputs.run_s, own_mb() or math.nan))
        if record.cycle == self.last:
            self.after_mb = own_mb() or math.nan

    @property
    def slope_mb_h(self) -> float:
        """How fast memory grows once the drive is settled, MB/h; zero for a drive too short to tell."""
        settled = self.samples[round(SETTLED_SHARE * len(self.samples)) :]
        if len(settled) < LINE_MIN:
            return 0.0
        at_s, mb = np.array(settled).T
        return float(3600.0 * np.polyfit(at_s - at_s[0], mb, 1)[0])


@app.default
def grow(
    cycles: Annotated[int, Parameter(help="Cycles after the first thousand.")] = 100_000,
    /,
    *,
    wrap_s: Annotated[float, Parameter(help="The robot's clock wraps after so many seconds.")] = math.inf,
) -> int:
    """Print the figures as JSON; fail where the drive left more behind than it may."""
    settings = load_settings("hallway", ["behaviors.move_ahead.at_end=turn_back"])
    ready_kernels(settings, Console(stderr=True))
    if settings.world is None:
        return FAILED
    memory = MemoryPolicy()
    last = SETTLED_CYCLES + cycles
    left = Left(memory, last)
    with memory.driving():
        clock_us = 0 if math.isinf(wrap_s) else WRAP_US - round(1e6 * wrap_s)
        simulate(
            settings, settings.world, 0, last / settings.cycle.rate_hz, left.on_cycle, clock_start_us=clock_us
        )  # fmt: skip
    signatures = compiled_signatures()
    growth_mb, compilations = round(left.after_mb - left.before_mb, 3), signatures - left.signatures
    figures: dict[str, Any] = {
        "cycles": cycles,
        "growth_mb": growth_mb,
        "slope_mb_h": round(left.slope_mb_h, 3),
        "wraps": math.floor((1e6 * last / settings.cycle.rate_hz + clock_us) / WRAP_US),
        "compilations": compilations,
        "signatures": signatures,
        "collections": memory.collections,
        "modes": sorted(mode.value for mode in left.modes),
    }
    sys.stdout.write(orjson.dumps(figures).decode() + "\n")
    hours = max(1.0, cycles / settings.cycle.rate_hz / 3600.0)
    kept = (
        growth_mb < hours * GROWTH_MAX_MB
        and left.slope_mb_h < GROWTH_MAX_MB
        and not compilations
        and not memory.collections[-1]
    )
    return DONE if kept and left.modes == {Mode.DRIVE} else FAILED


if __name__ == "__main__":
    sys.exit(app(result_action="return_value"))
