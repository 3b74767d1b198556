"""`make bench`: our methods and the peers on the same readings, accuracy and time in one run."""

from __future__ import annotations

import sys
from typing import Annotated, Final

from cyclopts import App, Parameter
from rich.console import Console

from config.load import load_settings
from runtime.complaint import Complaint
from runtime.kernels import ready_kernels, use_cache
from tests.bench.contestant import Peer
from tests.bench.measure import Plan, measure
from tests.bench.runners import Method, contestants
from tests.bench.table import results_table

OURS: Final = (
    Method("echolocate, full", ("perception.method=full",)),
    Method("echolocate, paper", ("perception.method=paper",)),
)
"""Our own methods, a line each."""

FULL: Final = Plan(repetitions=3, halls_max=10, passes=20)
QUICK: Final = Plan(repetitions=1, halls_max=2, passes=4)

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
    from runtime.summary import write_json

    console, out = Console(stderr=True), Console()
    plan = QUICK if quick else FULL
    if repetitions is not None:
        plan = Plan(max(1, repetitions), plan.halls_max, plan.passes)
    settings = load_settings("hallway")
    ready_kernels(settings, console)
    entered = [c for c in contestants(OURS, load_peers()) if only in c.name]
    if not entered:
        console.print(f"bench: no contestant's name contains {only!r}", markup=False)
        return 2
    with console.status("bench") as status:
        results = measure(entered, settings.ring, plan, status.update)
    try:
        write_json(json, {"repetitions": plan.repetitions, "passes": plan.passes, "results": results})
    except Complaint as complaint:
        console.print(f"bench: {complaint}", markup=False)
        return complaint.exit_code
    wide = out if out.is_terminal else Console(width=180)
    wide.print(results_table(results, plan))
    return 0


def load_peers() -> tuple[Peer, ...]:
    """Import the peers; they need the extra `bench`."""
    try:
        from tests.bench.peers import (
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
