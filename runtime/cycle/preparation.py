"""Before recognition is ready: its kernels are prepared beside the process, and the robot drives without it.

Compiling takes half a minute after an installation. Meanwhile the ring is heard and watched, all safety is in force,
and the robot drives what needs no map: the legs, and what an operator steers. Recognition begins with a cycle whose
inputs say so, so that a replay begins it there, too.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Final, Protocol

from config.settings import Settings
from perception.pipeline import Perception
from runtime.cycle.drive_requests import first_request
from runtime.cycle.step import State
from runtime.support.daemon_thread import in_daemon_thread

if TYPE_CHECKING:
    from structlog.typing import FilteringBoundLogger

    from perception.recognition import PreparedRecognition
    from runtime.support.kernel_loader import InThread

POLL_S: Final = 0.2
"""Time between two looks at whether the start still has a use, s."""

PROGRESS_PERIOD_S: Final = 5.0
"""Time between two lines of the log on how far the preparation is, s."""
RECOGNITION_READY: Final = "recognition is ready"
"""Last line of the log on it."""


class Preparation(Protocol):
    """Prepares recognition while the process runs; see `runtime.support.kernel_loader`."""

    @property
    def progress(self) -> str:
        """How far it is, for the operator."""

    @property
    def is_over(self) -> asyncio.Event:
        """Set once recognition runs, or its preparation has failed."""

    async def ring(self, settings: Settings) -> None:
        """Return when the ring can be heard and checked without compiling anything."""

    async def __call__(self, settings: Settings, in_thread: InThread, /) -> PreparedRecognition | None:
        """Return what recognition with these settings begins with, when it can run without compiling anything."""


class Connects(Protocol):
    """Connects to the robot; see `runtime.cycle.connection`."""

    def refuse_missing(self) -> None:
        """Raise a UserError if there is no such port, so that `connect` would fail at once; connect to nothing."""

    async def connect(self, is_stopping: Callable[[], bool]) -> None:
        """Return when the robot is ready, or the run is ending; raise a UserError if it does not answer."""


def fresh_state(settings: Settings, *, recognises: bool = True) -> State:
    """Return the state in which a run starts: one that recognises, or one whose recognition is not ready."""
    return State(
        Perception(settings.ring, settings.models, settings.perception, recognises=recognises),
        drive_request=first_request(settings),
    )


class RunningPreparation:
    """A preparation beside the cycles of a run, if recognition is not ready from the start.

    Parameters
    ----------
    preparation : Preparation or None
        None if recognition is ready.
    log : structlog logger
        Gets the progress now and then.
    on_ready : callable
        Called once recognition is ready, between two cycles: it takes milliseconds.
    on_starting : callable, optional
        Gets the progress before the first cycle.
    in_thread : callable, optional
        Calls functions in threads; by default also while a cycle runs.
    perception : Perception, optional
        Of the run; gets what recognition begins with.
    """

    def __init__(
        self,
        preparation: Preparation | None,
        log: FilteringBoundLogger,
        on_ready: Callable[[], None],
        on_starting: Callable[[str], None] | None = None,
        in_thread: InThread = in_daemon_thread,
        perception: Perception | None = None,
    ) -> None:
        self._preparation = preparation
        self._log = log
        self._on_ready = on_ready
        self._on_starting = on_starting
        self._in_thread = in_thread
        self._perception = perception
        self._task: asyncio.Task[None] | None = None
        self._logged_run_s = -math.inf

    async def start(self, settings: Settings, connection: Connects, is_stopping: Callable[[], bool]) -> None:
        """Prepare what the first cycle needs and connect; go on to prepare recognition beside that and the cycles.

        Parameters
        ----------
        settings : Settings
            Of the run.
        connection : Connects
            Connects to the robot, before everything is prepared if that will fail.
        is_stopping : callable
            Whether the run is ending.
        """
        if self._preparation is not None:
            await self._prepare_ring(self._preparation, settings, connection, is_stopping)
            if is_stopping():
                return
            self._task = asyncio.create_task(self._prepare(self._preparation, settings), name="preparation")
        try:
            await connection.connect(is_stopping)
        except BaseException:  # nothing else would end it
            await self.close()
            raise

    @property
    def is_running(self) -> bool:
        """Whether recognition is not ready yet."""
        return self._preparation is not None

    def progress(self, run_s: float) -> str | None:
        """Return how far it is in the cycle that begins at `run_s`; None once recognition is ready.

        Raises
        ------
        UserError
            The preparation failed.
        """
        if self._preparation is None or self._task is None:
            return None
        if self._task.done():
            is_over, self._preparation = self._preparation.is_over, None
            try:
                self._task.result()
            finally:
                is_over.set()
            self._log.info(RECOGNITION_READY)
            return None
        progress = self._preparation.progress
        if run_s - self._logged_run_s >= PROGRESS_PERIOD_S:
            self._logged_run_s = run_s
            self._log.info(progress)
        return progress

    async def _prepare_ring(
        self, preparation: Preparation, settings: Settings, connection: Connects, is_stopping: Callable[[], bool]
    ) -> None:
        """Wait until the ring can be heard, and say now and then how far that is."""
        ring = asyncio.ensure_future(preparation.ring(settings))
        begin_s = said_s = asyncio.get_running_loop().time()
        try:
            while not is_stopping() and not (await asyncio.wait([ring], timeout=POLL_S))[0]:
                connection.refuse_missing()
                now_s = asyncio.get_running_loop().time()
                if now_s - said_s >= PROGRESS_PERIOD_S:
                    said_s, so_far = now_s, f"waiting for {now_s - begin_s:.0f} s"
                    text = f"{preparation.progress}; the robot is connected after that ({so_far})"
                    self._log.info(text)
                    if self._on_starting is not None:
                        self._on_starting(text)
            if ring.done():
                ring.result()
        finally:
            ring.cancel()

    async def _prepare(self, preparation: Preparation, settings: Settings) -> None:
        prepared = await preparation(settings, self._in_thread)
        if self._perception is not None:
            self._perception.prepared = prepared
        self._on_ready()

    async def close(self) -> None:
        """End it."""
        if self._task is not None:
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)
