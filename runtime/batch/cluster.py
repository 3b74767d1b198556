"""Workers of Dask: processes of this machine, or those of a scheduler that the user has started anywhere."""

from __future__ import annotations

import contextlib
import subprocess
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

from config.errors import FAILED, WRONG_CALL, UserError
from runtime import VERSION
from runtime.batch.dispatch import Done
from runtime.batch.local_workers import LOOK_PERIOD_S, local_workers
from runtime.batch.runs import Run
from runtime.batch.worker import Row, run_one
from runtime.support.child_process import INTERPRETER

if TYPE_CHECKING:
    from distributed import Client, as_completed

CONNECT_TIMEOUT_S: Final = 10.0
WORKERS_TIMEOUT_S: Final = 120.0
"""There must be a worker by then."""
QUIET_S: Final = 5.0
"""Without a worker for so long, the user reads what is waited for."""
LOCAL_QUIET_S: Final = 20.0
"""The same for workers of this machine, which need a quarter of it to start, and more while it is busy."""
AHEAD: Final = 2
"""Runs under way for each thread of a worker: the next is there when one ends."""
COUNT_PERIOD_S: Final = 5.0
"""After this time the workers are counted again, as they come and go."""
DEATHS_MAX: Final = 10
"""Workers that may die during one attempt at a run before it is blamed."""
LOCAL_HOST: Final = "127.0.0.1"
WORKER_COMMAND: Final = (
    *INTERPRETER,
    "-m",
    "dask",
    "worker",
    "--no-nanny",
    "--nthreads",
    "1",
    "--memory-limit",
    "0",
    "--no-dashboard",
    "--host",
    LOCAL_HOST,
)
SETTINGS: Final = (
    ("distributed.scheduler.allowed-failures", DEATHS_MAX),
    ("distributed.admin.system-monitor.gil.enabled", False),
)


class DaskPool:
    """A `runtime.batch.dispatch.Pool` of the workers of a Dask scheduler.

    `completed` is empty: it gets the futures, and yields them as they end. `make` makes a run on a worker.
    """

    def __init__(self, client: Client, completed: as_completed, make: Callable[[Run], Row] = run_one) -> None:
        self._client = client
        self._completed = completed
        self._make = make
        self._under_way: dict[str, tuple[Run, int]] = {}
        """Each run and its attempt, by the key of its future."""
        self._capacity = 1
        """Runs that should be under way, by the last count of the workers."""
        self._counted_s = -COUNT_PERIOD_S
        """Host time of that count."""

    def capacity(self) -> int:
        """Return how many runs should be under way; it asks the scheduler every `COUNT_PERIOD_S`."""
        if time.monotonic() - self._counted_s >= COUNT_PERIOD_S:
            with contextlib.suppress(OSError):
                self._capacity = max(1, AHEAD * sum(self._client.nthreads().values()))
            self._counted_s = time.monotonic()
        return self._capacity

    def submit(self, run: Run, attempt: int) -> None:
        """Begin a run."""
        key = f"echolocate-{run.key}-{attempt}"
        self._under_way[key] = run, attempt
        self._completed.add(self._client.submit(self._make, run, key=key))

    def next_done(self) -> Done:
        """Wait for the next run that ends, and return it with its row, or with the error that it raised.

        That error is returned, not raised. There must be a run under way.

        Raises
        ------
        UserError
            The scheduler is gone, or a worker has another version of this program.
        """
        future = next(self._completed)
        run, attempt = self._under_way.pop(future.key)
        try:
            row = future.result()
        except Exception as error:  # noqa: BLE001 - whatever a run on a worker raised
            if future.cancelled() or self._client.status != "running":
                raise UserError(
                    "the Dask scheduler is gone; start it again and repeat the call: what is done is kept", FAILED
                ) from None
            return Done(run, attempt, error)
        if row["version"] != VERSION:
            raise UserError(
                f"a worker has echolocate {row['version']}, and this is {VERSION}: install the same everywhere",
                FAILED,
            )
        return Done(run, attempt, row)


@contextlib.contextmanager
def connected(scheduler: str | None, workers: int, log: Path, tell: Callable[[str], None]) -> Iterator[DaskPool]:
    """Yield the workers of a scheduler, or so many processes on this machine, which end with the block.

    Parameters
    ----------
    scheduler : str or None
        Address, as in ``tcp://host:8786``; None for this machine.
    workers : int
        Processes on this machine.
    log : Path
        File for what these processes print.
    tell : callable
        Gets a line if the first worker is late.

    Raises
    ------
    UserError
        There is no such scheduler, it has no worker, or this machine starts none.
    """
    import dask
    from distributed import Client, LocalCluster, as_completed

    with contextlib.ExitStack() as stack:
        stack.enter_context(dask.config.set(dict(SETTINGS)))
        if scheduler is None:
            cluster = LocalCluster(
                n_workers=0,
                host=LOCAL_HOST,
                dashboard_address=f"{LOCAL_HOST}:0",  # otherwise it warns if another scheduler has Dask's usual port
                scheduler_kwargs={"dashboard": False},
                silence_logs="CRITICAL",
                processes=True,
            )
            client = stack.enter_context(Client(stack.enter_context(cluster)))
            command = (*WORKER_COMMAND, cluster.scheduler_address)
            try:
                started = tuple(stack.enter_context(local_workers(command, workers, log)))
            except OSError as error:
                raise UserError(
                    f"the workers cannot be started, or cannot write {log}: {error.strerror or error}; end other "
                    "programs, start fewer with --workers, or remove what stands at that path",
                    FAILED,
                ) from error
            where, hint = "this machine", f"{log} says why"
        else:
            try:
                client = stack.enter_context(Client(scheduler, timeout=CONNECT_TIMEOUT_S))
            except (OSError, ValueError) as error:
                raise UserError(
                    f"--scheduler {scheduler}: no scheduler answers there ({error}); start one with `dask scheduler`",
                    WRONG_CALL,
                ) from None
            where, hint, started = f"--scheduler {scheduler}", f"start some with `dask worker {scheduler}`", ()
        await_worker(client, started, f"{where}: there is no worker", hint, tell)
        yield DaskPool(client, as_completed())


def await_worker(
    client: Client,
    started: Sequence[subprocess.Popen[bytes]],
    problem: str,
    hint: str,
    tell: Callable[[str], None],
    clock: Callable[[], float] = time.monotonic,
) -> None:
    """Wait for a worker, but no longer than the first ones of this machine live.

    Parameters
    ----------
    client : Client
        Of the scheduler.
    started : sequence of Popen
        The workers of this machine.
    problem, hint : str
        What the error says if none comes, or all of `started` end.
    tell : callable
        Gets both in a line after `QUIET_S`; for workers of this machine, of which one lives, the problem alone after
        `LOCAL_QUIET_S`.
    clock : callable
        Monotonic, s.

    Raises
    ------
    UserError
        There is no worker.
    """
    begin_s, is_said = clock(), False
    quiet_s, more = (LOCAL_QUIET_S, "") if started else (QUIET_S, f"; {hint}")
    while True:
        have_died = bool(started) and all(process.poll() is not None for process in started)
        try:
            client.wait_for_workers(1, timeout=LOOK_PERIOD_S)
        except TimeoutError:
            if have_died:
                raise UserError(f"{problem}: each one ends at its start; {hint}", FAILED) from None
            waited_s = clock() - begin_s
            if waited_s >= WORKERS_TIMEOUT_S:
                raise UserError(f"{problem} after {WORKERS_TIMEOUT_S:g} s; {hint}", FAILED) from None
            if waited_s >= quiet_s and not is_said:
                is_said = True
                tell(f"{problem} yet, for which up to {WORKERS_TIMEOUT_S:g} s are waited{more}")
        else:
            return
