"""Before recognition is ready: its kernels are compiled beside the process, echoes are shown, and the robot stands.

Compiling takes half a minute after an installation. Meanwhile the robot is connected and its ring fires, cycles run
without perception, and the operator sees the echoes and how long it still takes.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Final, Protocol

import numpy as np

from config.model import ModelConfig
from config.settings import PerceptionConfig, Settings
from drivers.driver import LineState
from drivers.messages import Firing, Floats
from perception.detected_object import DetectedObject, MapCounts
from perception.edits import Evidence, MapEdit, Segments
from perception.pipeline import Perception
from runtime.cycle.drive_requests import first_request
from runtime.cycle.inputs import Inputs
from runtime.cycle.step import Command, CycleRecord, State, step

if TYPE_CHECKING:
    from structlog.typing import FilteringBoundLogger

PROGRESS_PERIOD_S: Final = 5.0
"""Time between two lines of the log on how far the preparation is, s."""

REFUSED: Final = "recognition is not ready yet: wait until it is"
NOTHING: Final = MapCounts(segments=0, segments_total=0, hypotheses=0)


class Preparation(Protocol):
    """Prepares recognition while the process runs; see `runtime.support.kernel_loader`."""

    @property
    def progress(self) -> str:
        """How far it is, for the operator."""

    async def __call__(self, settings: Settings) -> None:
        """Return when recognition with these settings can run without compiling anything."""


class NoMethod:
    """The method in place of one whose kernels are not ready: an empty map that refuses every edit."""

    can_refine = False
    converged = True
    counts = NOTHING

    def observe(self, firing: Firing) -> int:  # noqa: ARG002 - as of `perception.method.Method`
        """Return 0: no segment was completed."""
        return 0

    def refine(self) -> int:
        """Return 0: nothing was improved."""
        return 0

    def objects(self) -> tuple[DetectedObject, ...]:
        """Return no objects."""
        return ()

    near_objects = labelled_objects = archived_objects = objects

    def segment_geometry(self) -> Floats:
        """Return no segments, shape (0, 5)."""
        return np.zeros((0, 5))

    def segments(self) -> Segments:
        """Return no segments."""
        numbers = np.zeros(0, np.int64)
        return Segments(numbers, self.segment_geometry(), np.zeros(0), numbers)

    def edit(self, edit: MapEdit) -> str | None:  # noqa: ARG002
        """Return why no edit is possible."""
        return REFUSED

    def kept(self, _number: int) -> str | None:
        """Return None: there are no objects."""
        return None

    def evidence(self, number: int) -> Evidence | None:  # noqa: ARG002
        """Return None: there are no objects."""
        return None

    def locate_echoes(self, bearings: Floats) -> None:
        """Write nothing: there are no objects."""

    def shift_object(self, number: int, dx: float, dy: float) -> None:
        """Move nothing: there are no objects."""

    def reset(self) -> None:
        """Leave the empty map as it is."""

    def apply_settings(self, config: PerceptionConfig) -> None:
        """Ignore the settings: the method itself begins with those in force."""

    def set_models(self, models: Sequence[ModelConfig]) -> None:
        """Ignore the models, likewise."""

    def drop_caches(self) -> None:
        """Do nothing: there are none."""


def prepared_state(settings: Settings) -> State:
    """Return the state of a process that begins to recognise: an empty map."""
    return State(
        Perception(settings.ring, settings.models, settings.perception), drive_request=first_request(settings)
    )


def unprepared_state(settings: Settings) -> State:
    """Return the state of a process whose recognition is not ready."""
    return State(
        Perception(settings.ring, settings.models, settings.perception, NoMethod()),
        drive_request=first_request(settings),
    )


def unprepared_step(
    state: State, inputs: Inputs, settings: Settings, progress: str, carry_out: Callable[[Command], None]
) -> CycleRecord:
    """Run a cycle without perception, in which the robot cannot be armed, and return its record.

    Parameters
    ----------
    state : State
        Of `unprepared_state`. Updated.
    inputs : Inputs
        Of the cycle.
    settings : Settings
        The run's settings.
    progress : str
        How far the preparation is: the reason why the robot stands, unless its line has another.
    carry_out : callable
        Gets the command.
    """
    waiting = replace(inputs, received=replace(inputs.received, firings=()))
    if inputs.line is LineState.READY:
        waiting = replace(waiting, line=LineState.HANDSHAKE, line_problem=progress)
    record = step(state, waiting, settings, carry_out, lambda _quanta: False)
    return replace(record, inputs=inputs)


async def run_until_prepared(
    preparation: Preparation,
    settings: Settings,
    cycle: Callable[[str], None],
    stop: asyncio.Event,
    log: FilteringBoundLogger,
) -> None:
    """Run cycles without perception until recognition is ready or the run ends.

    Parameters
    ----------
    preparation : Preparation
        Ended early if the run ends.
    settings : Settings
        Of the run.
    cycle : callable
        Runs a cycle; gets how far the preparation is.
    stop : asyncio.Event
        Set when the run is to end.
    log : structlog logger
        Gets the progress now and then.

    Raises
    ------
    UserError
        The preparation failed.
    """
    loop, logged_host_s = asyncio.get_running_loop(), -math.inf
    task = asyncio.create_task(preparation(settings), name="preparation")
    try:
        while not (task.done() or stop.is_set()):
            if loop.time() - logged_host_s >= PROGRESS_PERIOD_S:
                logged_host_s = loop.time()
                log.info(preparation.progress)
            cycle(preparation.progress)
            await asyncio.wait({task}, timeout=1.0 / settings.cycle.rate_hz)
        if task.done():
            task.result()
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
