"""`make bench`: our methods and the peers on the same readings, accuracy and time in one run."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Annotated, Final, TypeAlias

from cyclopts import App, Parameter
from rich.console import Console

from bench.console import console_table
from bench.console import figures as figures_of
from bench.console import measure as measure_console
from bench.contestant import Peer
from bench.measure import Plan, measure
from bench.recording import measure_recording
from bench.runners import Method, contestants
from bench.table import results_table
from bench.timing import Timing, TimingPlan, measure_timing
from bench.timing_table import figures_table, quantiles_table, read_earlier
from bench.waking import figures, waking_table
from bench.waking import measure as measure_waking
from config.errors import UserError
from config.load import load_settings
from runtime.support.kernel_cache import PARTS, ready_kernels, use_cache

OURS: Final = (
    Method("echolocate, bayes", ("perception.method=bayes",)),
    Method("echolocate, paper", ("perception.method=paper",)),
)
"""Our own methods, a line each."""

FULL: Final = Plan(repetitions=3, halls_max=10, passes=20)
QUICK: Final = Plan(repetitions=1, halls_max=2, passes=4)

TIMING: Final = TimingPlan(seconds=20.0, rounds=3, busy=0)
RECORDING: Final = TimingPlan(seconds=60.0, rounds=1, busy=0)
WAKING_TURNS: Final = 10

Measure: TypeAlias = Callable[[TimingPlan, tuple[str, ...], Callable[[str], None]], Timing]

app = App(help="Measure our methods and the libraries that one would use instead, on the same readings.")


@app.default
def bench(
    *,
    json: str = "bench.json",
    quick: Annotated[bool, Parameter(negative="")] = False,
    repetitions: int | None = None,
    only: str = "",
) -> int:
    """Run the comparison, print its table and write it as JSON.

    Parameters
    ----------
    json
        File to write.
    quick
        A small run: few halls, few passes, once.
    repetitions
        How often everything is run; medians are reported.
    only
        Take only those whose name contains this.
    """
    use_cache()
    from runtime.cycle.summary import write_json

    console = Console(stderr=True)
    plan = QUICK if quick else FULL
    if repetitions is not None:
        plan = Plan(max(1, repetitions), plan.halls_max, plan.passes)
    settings = load_settings("hallway")
    ready_kernels(settings, console, PARTS)
    entered = [c for c in contestants(OURS, load_peers()) if only in c.name]
    if not entered:
        console.print(f"bench: no contestant's name contains {only!r}", markup=False)
        return 2
    with console.status("bench") as status:
        results = measure(entered, settings.ring, plan, status.update)
    try:
        write_json(json, {"repetitions": plan.repetitions, "passes": plan.passes, "results": results})
    except UserError as complaint:
        console.print(f"bench: {complaint}", markup=False)
        return complaint.exit_code
    _wide().print(results_table(results, plan))
    return 0


@app.command
def timing(
    *,
    json: str = "timing.json",
    against: str | None = None,
    seconds: float = TIMING.seconds,
    rounds: int = TIMING.rounds,
    busy: int = TIMING.busy,
    sets: Annotated[tuple[str, ...], Parameter(name="--set", negative="", allow_leading_hyphen=False)] = (),
) -> int:
    """Measure how a run keeps its time over the pty, in turns with bare controls.

    Parameters
    ----------
    json
        File to write.
    against
        JSON of an earlier run to compare with.
    seconds
        How long ours and the control run, each round.
    rounds
        How often.
    busy
        Processes beside that never rest.
    sets
        Override one setting, as in cycle.rate_hz=10.
    """
    plan = TimingPlan(max(1.0, seconds), max(1, rounds), max(0, busy))
    return _measured(measure_timing, plan, sets, json, against)


@app.command
def recording(
    *,
    json: str = "recording.json",
    against: str | None = None,
    seconds: float = RECORDING.seconds,
    rounds: int = RECORDING.rounds,
    sets: Annotated[tuple[str, ...], Parameter(name="--set", negative="", allow_leading_hyphen=False)] = (),
) -> int:
    """Measure what recording costs a run over the pty: time of its loop, room on the disk.

    Parameters
    ----------
    json
        File to write.
    against
        JSON of an earlier run to compare with.
    seconds
        How long runs with and without a recording last, each round.
    rounds
        How often.
    sets
        Override one setting, as in recording.keyframe_period_s=10.
    """
    return _measured(measure_recording, TimingPlan(max(1.0, seconds), max(1, rounds), 0), sets, json, against)


@app.command
def console(*, json: str = "console.json", seconds: float = 30.0, rounds: int = 5) -> int:
    """Measure what open pages of the operator console cost a run, in turns with none open.

    Parameters
    ----------
    json
        File to write.
    seconds
        How long a run lasts, each turn.
    rounds
        How often.
    """
    use_cache()
    from runtime.cycle.summary import write_json

    out = Console(stderr=True)
    seconds, rounds = max(5.0, seconds), max(1, rounds)
    try:
        ready_kernels(load_settings("hallway"), out)
        with out.status("bench") as status:
            rows = figures_of(measure_console(seconds, rounds, status.update))
        write_json(json, {"seconds": seconds, "rounds": rounds, "rows": rows})
    except UserError as complaint:
        out.print(f"bench: {complaint}", markup=False)
        return complaint.exit_code
    _wide().print(console_table(rows, seconds, rounds))
    return 0


@app.command
def waking(*, json: str = "waking.json", turns: int = WAKING_TURNS, busy: int = 2) -> int:
    """Measure ways of sleeping until a deadline: idle, and beside processes that never rest.

    Parameters
    ----------
    json
        File to write.
    turns
        How often each way has its turn of two seconds.
    busy
        Processes beside that never rest.
    """
    from runtime.cycle.summary import write_json

    console = Console(stderr=True)
    with console.status("bench") as status:
        by_load = {
            f"{beside} busy": figures(measure_waking(max(1, turns), beside, status.update)) for beside in (0, busy)
        }
    try:
        write_json(json, by_load)
    except UserError as complaint:
        console.print(f"bench: {complaint}", markup=False)
        return complaint.exit_code
    _wide().print(waking_table(by_load))
    return 0


def _measured(measure: Measure, plan: TimingPlan, sets: tuple[str, ...], json: str, against: str | None) -> int:
    """Measure, write the figures and print them."""
    use_cache()
    from runtime.cycle.summary import write_json

    console = Console(stderr=True)
    try:
        earlier = None if against is None else read_earlier(against)
        ready_kernels(load_settings("hallway"), console)
        with console.status("bench") as status:
            result = measure(plan, sets, status.update)
        write_json(json, result.as_json())
    except UserError as complaint:
        console.print(f"bench: {complaint}", markup=False)
        return complaint.exit_code
    wide = _wide()
    wide.print(quantiles_table(result, earlier))
    wide.print(figures_table(result, earlier))
    return 0


def _wide() -> Console:
    """Return the terminal, or where there is none one wide enough for every table."""
    out = Console()
    return out if out.is_terminal else Console(width=180)


def load_peers() -> tuple[Peer, ...]:
    """Import the peers; they need the extra `bench`."""
    try:
        from bench.peers import (
            filterpy_ekf,
            gtsam_isam2,
            scipy_ls,
            skimage_hough,
            skimage_ransac,
            small_gicp_icp,
        )
    except ImportError as error:
        sys.exit(f'bench: {error}; install the peers: make bench, or pip install --editable ".[bench]"')
    peers = (gtsam_isam2, filterpy_ekf, scipy_ls, small_gicp_icp, skimage_hough, skimage_ransac)
    return tuple(module.PEER for module in peers)


if __name__ == "__main__":
    sys.exit(app(result_action="return_value"))
