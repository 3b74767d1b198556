"""The whole way in real time, beside a bare loop: six drums, the first cycle after a start, and orderly ends."""

from __future__ import annotations

import asyncio
import json
import math
import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from config.load import load_settings
from drivers.messages import Flags
from runtime.timing.cycle_scheduler import LATE_SHARE
from runtime.timing.cycle_stats import CycleStats
from runtime.timing.pacing import Pacer
from tests.hil.machine import BareStarts, stalls_excused
from tests.hil.running import Emulated, Running, emulated, running, wait_for
from tests.hil.truth import is_driving, reaches, robot_time, rows

pytestmark = pytest.mark.usefixtures("warm_kernels")

FT = 0.3048
SETTINGS = load_settings("hallway")
PERIOD_S = 1.0 / SETTINGS.cycle.rate_hz
DRIVE_S = 26
"""Down the hallway and out of it; the drums are all known by then."""
STARTS_MAX = 12
"""Number of bare starts of Python with numba (the slowest measured); an idle machine needs five."""


async def bare_loop(running_too: Running) -> CycleStats:
    """Do nothing at all at 20 Hz while the robot drives: what this machine does to any loop just now."""
    stats, pacer = CycleStats(LATE_SHARE * PERIOD_S), Pacer(time.monotonic(), PERIOD_S)
    while running_too.process.poll() is None:
        begin_host_s = time.monotonic()
        stats.add_cycle(0.0, begin_host_s - pacer.deadline_s)
        stats.missed += max(0, math.floor((begin_host_s - pacer.deadline_s) / PERIOD_S))
        await asyncio.sleep(max(0.0, pacer.advance(time.monotonic()) - time.monotonic()))
    return stats


def summary_of(path: Path) -> dict[str, Any]:
    got = json.loads(path.read_bytes())
    assert isinstance(got, dict)
    return got


@stalls_excused
def test_six_drums_in_real_time_with_a_control_loop(tmp_path: Path, measured: Callable[[str], None]) -> None:
    path = tmp_path / "summary.json"
    with running(tmp_path, "run", "run", "--seconds", str(DRIVE_S), "--json", str(path), fresh=True) as run:
        bare = asyncio.run(bare_loop(run))
        assert run.end() == 0
    assert run.error_lines == []
    summary = summary_of(path)

    world = SETTINGS.world
    assert world is not None
    drums = [(d.x_m - world.start.x_m, d.y_m - world.start.y_m) for d in world.drum]
    seen = [(o["x"], o["y"]) for o in summary["objects"]]
    assert len(seen) == len(drums) == 6
    errors = [min(math.dist(drum, place) for place in seen) for drum in drums]
    nearest = {min((math.dist(drum, place), k) for k, place in enumerate(seen))[1] for drum in drums}
    assert len(nearest) == 6
    assert sum(errors) / 6 <= 0.25 * FT
    assert max(errors) <= 0.35 * FT

    assert summary["link"]["frames"] > 50 * DRIVE_S
    assert (summary["link"]["bad"], summary["link"]["lost"]) == (0, 0)
    assert (summary["mode"], summary["stop_reasons"]) == ("DRIVE", [])
    figures = {"late": summary["late"], "bare late": bare.late, "lag": summary["lag_us"], "bare lag": bare.lag_us(),
               "cycle": summary["cycle_us"], "errors": errors, "missed": summary["missed"],
               "bare missed": bare.missed, "cycles": summary["cycles"]}  # fmt: skip
    measured(str(figures))
    # The margin: one cycle in fifty. The loop that drives also has bytes to read when its deadline comes, and where
    # the emulator is held up the ring's next echo, and with it the cycle, comes that much later.
    margin = 0.02 * DRIVE_S / PERIOD_S
    assert summary["cycles"] + summary["missed"] == pytest.approx(DRIVE_S / PERIOD_S, abs=margin), figures
    assert summary["late"] <= bare.late + margin, figures
    assert summary["missed"] <= bare.missed + margin, figures
    # A tenth of a period beyond the bare loop: half a period is what a timer that knows nothing of the ring costs.
    assert summary["lag_us"]["p50"] <= bare.lag_us()["p50"] + 0.1e6 * PERIOD_S, figures


def drive(folder: Path, robot: Emulated, name: str = "run", *more: str) -> Any:
    return running(folder, name, "run", "--port", robot.port, *more, fresh=True)


@stalls_excused
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupt_halts_the_base_before_the_end(tmp_path: Path, number: signal.Signals) -> None:
    path = tmp_path / "summary.json"
    with emulated(tmp_path, fresh=True) as robot:
        with drive(tmp_path, robot, "run", "--arm", "--json", str(path)) as run:
            wait_for(lambda: is_driving(robot.trace), "driving")
            with BareStarts() as bare:
                signalled = run.signal(number)
                assert run.end() == 0
                ended_s = time.monotonic()
        wait_for(lambda: reaches(robot.trace, ended_s + 0.3), "trace beyond the end")
        latched = next(row for row in rows(robot.trace) if row.flags & Flags.LATCHED)
        signalled_at_s = robot_time(robot.trace, signalled.before_s)
        assert latched.t_s > signalled_at_s - 0.02, "it halted before the signal"
        assert latched.host_s < ended_s, "the base latched before the program ended"
        after = [row for row in rows(robot.trace) if row.t_s > latched.t_s + 0.15]
        assert after
        assert all(row.still and row.flags & Flags.LATCHED for row in after)
        # Half a second at most for the halt, a fifth for the last bytes, and to take a Python down.
        assert ended_s - signalled.after_s < 1.0 + STARTS_MAX * bare.longest_s
    assert run.error_lines == []
    summary = summary_of(path)
    assert summary["mode"] == "DRIVE"
    assert summary["link"]["bad"] == 0


@stalls_excused
def test_from_start_to_first_cycle_takes_as_long_as_a_few_bare_starts(
    tmp_path: Path, measured: Callable[[str], None]
) -> None:
    with emulated(tmp_path, fresh=True) as robot, BareStarts() as bare:
        begin_host_s = time.monotonic()
        with drive(tmp_path, robot) as run:
            run.comes_to("READY")
            took_s = time.monotonic() - begin_host_s
    measured(f"{took_s:.2f} s from the start to READY (a bare start: {bare.longest_s:.2f} s)")
    # On an idle machine, whose bare start is 0.35 s, that is five seconds.
    assert took_s < 1.0 + STARTS_MAX * bare.longest_s
