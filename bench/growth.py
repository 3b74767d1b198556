"""Growth during a long drive: memory, late compilations, full garbage collections. `make soak` drives for hours.

It runs as its own process, so that the figures hold nothing but the drive, in virtual time. The emulated robot runs
in the same process and counts as well.
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
from runtime.simulation.closed_loop import SimulationOptions, simulate
from runtime.support.kernel_cache import compiled_signatures
from runtime.support.kernel_warmup import prepare_kernels
from runtime.timing.footprint import own_mb
from runtime.timing.memory_policy import OLD_EVERY_CYCLES, MemoryPolicy

SETTLED_CYCLES: Final = 1000
"""A minute: one pass down the hall, after which everything allocated on first use is there."""
GROWTH_MAX_MB: Final = 1.0
"""Limit for an hour, and for any shorter drive."""
SAMPLE_CYCLES: Final = 1000
SETTLED_SHARE: Final = 0.2
"""Share of a drive in which tables that fill with the map reach their size."""
FIT_SAMPLES_MIN: Final = 10
"""Fewest samples through which a line is fitted."""
WRAP_US: Final = 2**32
SLACK_S: Final = 0.04
"""Idle time after each cycle, as given to the memory policy; virtual time has none."""

app = App(help="Drive for many cycles in virtual time and report what has grown.")


@dataclass
class GrowthMonitor:
    """Samples memory and modes once the drive is settled."""

    memory: MemoryPolicy
    last: int
    """Last cycle, after which memory is measured while everything is still allocated."""
    before_mb: float = math.nan
    after_mb: float = math.nan
    signatures: int = 0
    modes: set[Mode] = field(default_factory=set)
    samples: list[tuple[float, float]] = field(default_factory=list)
    """Virtual time, s, and memory, MB."""

    def on_cycle(self, record: CycleRecord, _truth: GroundTruth) -> None:
        """Apply the memory policy as a real run does, and take the samples of this cycle."""
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
        """Growth of memory once the drive is settled, MB/h; zero if the drive is too short for a fit."""
        settled = self.samples[round(SETTLED_SHARE * len(self.samples)) :]
        if len(settled) < FIT_SAMPLES_MIN:
            return 0.0
        at_s, mb = np.array(settled).T
        return float(3600.0 * np.polyfit(at_s - at_s[0], mb, 1)[0])


@app.default
def grow(
    cycles: Annotated[int, Parameter(help="Cycles after the first thousand.")] = 100_000,
    /,
    *,
    wrap_s: Annotated[float, Parameter(help="The robot's clock wraps after this time, s.")] = math.inf,
) -> int:
    """Print the figures as JSON; exit with 1 if the drive grew beyond a limit."""
    settings = load_settings("hallway", ["behaviors.move_ahead.at_end=turn_back"])
    prepare_kernels(settings, Console(stderr=True))
    if settings.world is None:
        return FAILED
    memory = MemoryPolicy()
    last = SETTLED_CYCLES + cycles
    monitor = GrowthMonitor(memory, last)
    with memory.driving():
        clock_us = 0 if math.isinf(wrap_s) else WRAP_US - round(1e6 * wrap_s)
        simulate(
            settings,
            settings.world,
            0,
            last / settings.cycle.rate_hz,
            monitor.on_cycle,
            options=SimulationOptions(clock_start_us=clock_us),
        )
    signatures = compiled_signatures()
    growth_mb, compilations = round(monitor.after_mb - monitor.before_mb, 3), signatures - monitor.signatures
    figures: dict[str, Any] = {
        "cycles": cycles,
        "growth_mb": growth_mb,
        "slope_mb_h": round(monitor.slope_mb_h, 3),
        "wraps": math.floor((1e6 * last / settings.cycle.rate_hz + clock_us) / WRAP_US),
        "compilations": compilations,
        "signatures": signatures,
        "collections": memory.collections,
        "modes": sorted(mode.value for mode in monitor.modes),
    }
    sys.stdout.write(orjson.dumps(figures).decode() + "\n")
    hours = max(1.0, cycles / settings.cycle.rate_hz / 3600.0)
    within_limits = (
        growth_mb < hours * GROWTH_MAX_MB
        and monitor.slope_mb_h < GROWTH_MAX_MB
        and not compilations
        and memory.collections[-1] <= last / OLD_EVERY_CYCLES
    )
    return DONE if within_limits and monitor.modes == {Mode.DRIVE} else FAILED


if __name__ == "__main__":
    sys.exit(app(result_action="return_value"))
