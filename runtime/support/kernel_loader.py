"""Prepare kernels beside a running loop: another process compiles them, then a thread loads them.

A run begins before its kernels are loaded, on the very first start before they are compiled: `KernelPreparation`
prepares them while the robot drives without recognition. The kernels for polygons are half of all, so a run whose
models are all round leaves them out; if a polygon is added later, `KernelLoader` prepares them before the new
settings take effect.
"""

from __future__ import annotations

import asyncio
import contextlib
import signal
import time
from collections.abc import Awaitable, Callable, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Final, ParamSpec, Protocol, TypeVar

from config.errors import FAILED, UserError
from config.files import one_line
from config.settings import Settings
from runtime.support.child_process import kill_child, start_child
from runtime.support.daemon_thread import in_daemon_thread
from runtime.support.kernel_cache import (
    BAYES,
    COMPILED_SUFFIX,
    ECHO_LAG,
    EMULATOR,
    KNOWN_ROOM,
    LOCALIZATION,
    PAPER,
    POLYGONS,
    RING,
    SURFACES,
    VALLEY,
    compiled_signatures,
    is_interpreted,
    needed_parts,
    uncompiled_parts,
    use_kernel_cache,
)
from runtime.support.kernel_warmup import CompilationEnded, compile_parts, following_kernels, warm_up

if TYPE_CHECKING:
    from structlog.typing import FilteringBoundLogger

    from perception.recognition import PreparedRecognition

P = ParamSpec("P")
R = TypeVar("R")

COMPILING_MAX_S: Final = 600.0
"""Time limit for the compiling process: ten times what it usually takes at low priority beside a driving robot."""


WARM_UP: Final = "runtime.support.kernel_warmup"
"""The module that compiles, run as a program."""

KERNEL_COUNTS: Final = MappingProxyType(
    {
        RING: 97,
        BAYES: 278,
        POLYGONS: 64,
        PAPER: 7,
        LOCALIZATION: 26,
        KNOWN_ROOM: 29,
        VALLEY: 2,
        SURFACES: 56,
        ECHO_LAG: 5,
        "directed": 13,
        "moravec_elfes": 6,
        "elfes": 6,
    }
)
"""Kernels of each part that no part before it has, as counted after compiling; for the display of progress only."""

SHARE_MIN: Final = 0.1
"""Share of the kernels from which the time left is estimated."""

COUNT_PERIOD_S: Final = 0.5
"""Time between two looks at how many kernels are compiled."""

PREPARING: Final = "recognition is being prepared"
RING_WAIT: Final = "the kernels that driving needs are being prepared"
FIRST_START: Final = (
    "the kernels that driving needs are being compiled, once for this version: that takes some seconds"
)


class InThread(Protocol):
    """Calls a function in another thread, as `in_daemon_thread` does; see `runtime.timing.cycle_gaps`."""

    async def __call__(self, call: Callable[P, R], /, *args: P.args, **kwargs: P.kwargs) -> R:
        """Return what the call returns."""


class KernelLoader:
    """Prepare kernels while the robot drives.

    Parameters
    ----------
    log : structlog logger
        Receives a line when kernels have to be compiled.
    compile_part : callable, optional
        Compiles a part in another process.
    preparation : KernelPreparation, optional
        Is waited for: else what it loads meanwhile would be counted twice.
    """

    def __init__(
        self,
        log: FilteringBoundLogger,
        compile_part: Callable[[str], Awaitable[None]] | None = None,
        preparation: KernelPreparation | None = None,
    ) -> None:
        self._log = log
        self._preparation = preparation
        self._compile_part = _compile_in_child if compile_part is None else compile_part
        self._lock = asyncio.Lock()
        self.loaded = 0
        """Kernel signatures loaded since the start; they are no compilation within a cycle."""

    async def __call__(self, running: Settings, proposed: Settings) -> str | None:
        """Load what the proposed settings need beyond the running ones; return None, or why that failed."""
        parts = [part for part in needed_parts(proposed) if part not in needed_parts(running)]
        if is_interpreted() or not parts:
            return None
        if self._preparation is not None:
            await self._preparation.is_over.wait()
        async with self._lock:
            folder = use_kernel_cache()
            for part in uncompiled_parts(folder, parts):
                self._log.info(f"compiling the kernels for {part}, once; the change takes effect afterwards")
                await self._compile_part(part)
            if uncompiled_parts(folder, parts):
                what = "a known room" if KNOWN_ROOM in parts else "a model without arc_radius_m"
                start = "`--map FILE`" if KNOWN_ROOM in parts else "such a model, e.g. `--set models=box`"
                return (
                    f"the kernels for {what} could not be compiled during the run, likely for lack of memory, disk "
                    f"or time: start with {start}"
                )
            before = compiled_signatures()
            await in_daemon_thread(warm_up, proposed, parts)
            self.loaded += compiled_signatures() - before
        return None


class KernelPreparation:
    """Compile and load the kernels of a run beside its cycles, which go on without recognition meanwhile.

    Another process compiles what never was, at low priority; then a thread loads all. The emulator runs uncompiled
    meanwhile; its kernels are compiled last, for the next start.

    Parameters
    ----------
    parts : sequence of str
        Those of `PARTS` that the run needs, the emulator's among them if it has one.
    host_clock : callable
        Monotonic, s.
    """

    def __init__(self, parts: Sequence[str], host_clock: Callable[[], float] = time.monotonic) -> None:
        self._parts = [part for part in parts if part not in {EMULATOR, RING}]
        self._all_parts = [*self._parts, EMULATOR]
        self._folder = use_kernel_cache()
        self._expected = sum(KERNEL_COUNTS[part] for part in self._parts)
        self._host_clock = host_clock
        self._begin_host_s = host_clock()
        self.first_start = FIRST_START if uncompiled_parts(self._folder, [RING]) else None
        """What the user should know before a first start, in which nothing is shown for seconds; None otherwise."""
        self.progress = f"{RING_WAIT}: they are being loaded" if self.first_start is None else RING_WAIT
        """How many kernels are compiled, and how long the rest will take, or how far loading is."""
        self._process: asyncio.subprocess.Process | None = None
        self._output: asyncio.Task[tuple[bytes, bytes]] | None = None
        """Reads what the process writes: behind a full pipe it would wait for ever."""
        self._ring: asyncio.Task[None] | None = None
        self._is_closed = False
        self.is_over = asyncio.Event()
        """Set by the process once recognition runs with what is loaded, or loading has failed."""

    def begin_ring(self, settings: Settings) -> asyncio.Task[None]:
        """Begin to load what `ring` waits for, and return the task; it is started only once."""
        if self._ring is None:
            loading = in_daemon_thread(self._compile_ring, settings)
            self._ring = asyncio.create_task(loading, name="kernels of the ring")
        return self._ring

    def _compile_ring(self, settings: Settings) -> None:
        """Compile the ring's kernels, unless the run ends meanwhile, and count them."""
        try:
            with following_kernels(self._on_ring_kernel):
                compile_parts(settings, self._folder, [RING])
        except Exception:
            if not self._is_closed:  # numba may have put an error of its own in the place of `CompilationEnded`
                raise

    def _on_ring_kernel(self, compiled: int) -> None:
        if self._is_closed:
            raise CompilationEnded
        elapsed_s = self._host_clock() - self._begin_host_s
        self.progress = progress_text(compiled, KERNEL_COUNTS[RING], elapsed_s, RING_WAIT)

    async def ring(self, settings: Settings) -> None:
        """Return when the robot can drive: the kernels that keep and check the ring's echoes are loaded.

        They are few, so this process compiles them itself, where they never were.
        """
        await self.begin_ring(settings)
        self.progress = PREPARING

    async def __call__(self, settings: Settings, in_thread: InThread = in_daemon_thread) -> PreparedRecognition:
        """Return what recognition begins with, when no kernel of the other parts is left to compile or to load.

        Both are loaded and made in threads of `in_thread`.

        Raises
        ------
        UserError
            They could not be compiled.
        """
        if uncompiled_parts(self._folder, self._all_parts):
            self._process = await start_child(
                WARM_UP, [",".join(self._all_parts), "whole"], pipes=False, low_priority=True
            )
            self._output = asyncio.create_task(self._process.communicate(), name="output of the compiler")
        while uncompiled_parts(self._folder, self._parts):
            if self._output is None or self._output.done():
                why = self._why_ended()
                raise UserError(
                    f"recognition could not be prepared: its kernels were not compiled into {self._folder}{why}, "
                    "likely for lack of memory or disk space; make room, then start again",
                    FAILED,
                )
            done = min(await asyncio.to_thread(self._compiled), self._expected)
            self.progress = progress_text(done, self._expected, self._host_clock() - self._begin_host_s)
            await asyncio.sleep(COUNT_PERIOD_S)
        for number, part in enumerate(self._parts, 1):
            self.progress = f"{PREPARING}: its kernels are being loaded, part {number} of {len(self._parts)}"
            await in_thread(warm_up, settings, [part])
        from perception.recognition import prepare_recognition

        return await in_thread(prepare_recognition, settings.ring, settings.models, settings.perception)

    def _why_ended(self) -> str:
        """Return how the compiling process ended, in brackets; empty if that is not known."""
        if self._process is None or self._output is None:
            return ""
        if (code := self._process.returncode or 0) < 0:
            return f" (the process that compiled them was ended by {signal.Signals(-code).name})"
        words = self._output.result()[1].decode(errors="replace").splitlines()
        return f" ({one_line(words[-1])})" if words else ""

    def _compiled(self) -> int:
        """Return how many kernels are compiled: a folder of a thousand files, in a thread."""
        return sum(1 for _ in self._folder.glob(f"*{COMPILED_SUFFIX}"))

    async def close(self) -> None:
        """End a compilation in progress; the next start continues from there."""
        self._is_closed = True
        if self._process is not None and self._output is not None:
            await kill_child(self._process)
            await asyncio.wait([self._output])


def begin_preparation(settings: Settings) -> KernelPreparation | None:
    """Return the preparation of a run with these settings; None if there is no compiler."""
    return None if is_interpreted() else KernelPreparation(needed_parts(settings))


def progress_text(done: int, expected: int, elapsed_s: float, what: str = PREPARING) -> str:
    """Return how far compiling is, for the operator.

    Parameters
    ----------
    done, expected : int
        Kernels compiled, of how many.
    elapsed_s : float
        Since the start, s.
    what : str
        What is being compiled.
    """
    text = f"{what}: {done} of {expected} kernels"
    if done >= expected or done < expected * SHARE_MIN:
        return f"{text}, {elapsed_s:.0f} s so far"
    return f"{text}, about {max(1.0, elapsed_s * (expected - done) / done):.0f} s left"


async def _compile_in_child(part: str) -> None:
    """Compile a part in another process; afterwards the mark of the part says whether that succeeded."""
    process = await start_child(WARM_UP, [part, "whole"], pipes=False, low_priority=True)
    try:
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(process.communicate(), COMPILING_MAX_S)
    finally:
        await kill_child(process)
