"""The emulator as a child process of the robot's main process."""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
from collections.abc import AsyncIterator, Callable, Sequence
from pathlib import Path
from typing import Final, NamedTuple, TypeAlias

from config.errors import FAILED, WRONG_CALL, UserError
from runtime.support.child_process import ECHOLOCATE, start_child
from runtime.support.forked_child import ForkedChild, can_fork, fork
from runtime.support.temp_folder import temp_folder
from runtime.timing.run_clock import ScaledClock
from runtime.timing.time_control import EmulatorTimeControl

Child: TypeAlias = asyncio.subprocess.Process | ForkedChild

READY_WORD: Final = "ready"
"""First word of the line that the emulator prints when it is ready."""

START_MAX_S: Final = 60.0
"""Longest wait for the emulator, which may have to compile its kernels first."""

OVERLOADED: Final = "likely the machine is overloaded: end other programs, then try again"

END_MAX_S: Final = 2.0
"""Longest wait for the emulator to end without being killed, s."""


class EmulatorHandle(NamedTuple):
    """A running emulator."""

    port: str
    """The path of its serial port."""
    control: EmulatorTimeControl
    """Control of its time; `control.clock` is the clock of a run with it."""


@contextlib.asynccontextmanager
async def start_emulator(
    arguments: Sequence[str],
    clock: ScaledClock | None = None,
    *,
    compiled: bool = True,
    main: Callable[[], None] | None = None,
) -> AsyncIterator[EmulatorHandle]:
    """Run ``echolocate emulate`` as a child process while the context lasts, and yield its port and time control.

    It gets its own session, so that Ctrl-C in the terminal reaches only this process, which then halts the robot
    before it ends. If this process is killed, the emulated base stops by itself and the emulator ends.

    Parameters
    ----------
    arguments : sequence of str
        Further arguments of the command.
    clock : ScaledClock, optional
        The run's clock, if it is needed before the emulator.
    compiled : bool
        Whether its kernels are to be compiled. Plain Python starts at once and costs a twentieth of a core.
    main : callable, optional
        The program `echolocate`: runs in a copy of this process, where one can be made, as that starts sooner.

    Raises
    ------
    UserError
        The emulator did not start; its own error is in the message.
    """
    with contextlib.ExitStack() as stack:
        port = _folder(stack) / "robot"
        words = ["emulate", "--link", str(port), "--end-with-parent", "--control", *arguments]
        interpreted = {} if compiled else {"NUMBA_DISABLE_JIT": "1"}
        process: Child | None = None
        if main is not None and can_fork():
            with contextlib.suppress(OSError):  # a program of its own needs less memory than a copy may
                process = await fork(main, words, interpreted)
        if process is None:
            process = await start_child(ECHOLOCATE, words, pipes=True, environment=interpreted)
        listener: asyncio.Task[None] | None = None
        try:
            await _wait_until_ready(process)
            control = EmulatorTimeControl(
                lambda line: _write(process, line), ScaledClock() if clock is None else clock
            )
            listener = asyncio.create_task(_listen(process, control), name="emulator's time")
            yield EmulatorHandle(str(port), control)
        finally:
            if listener is not None:
                listener.cancel()
                await asyncio.gather(listener, return_exceptions=True)
            await _end(process)


def _folder(stack: contextlib.ExitStack) -> Path:
    """Return the folder for the link to the port; it is removed with the stack."""
    try:
        return stack.enter_context(temp_folder())
    except OSError as error:
        raise UserError(
            f"no temporary folder can be created for the emulator: {error.strerror or error}; make room, or name "
            "another place in TMPDIR",
            FAILED,
        ) from error


async def _listen(process: Child, control: EmulatorTimeControl) -> None:
    try:
        while process.stdout is not None and (line := await process.stdout.readline()):
            control.receive(line)
    finally:
        control.emulator_ended()


def _write(process: Child, line: bytes) -> None:
    if process.stdin is not None and not process.stdin.is_closing():
        process.stdin.write(line)


async def _wait_until_ready(process: Child) -> None:
    """Wait until the emulator says so; if it does not, kill it and raise a `UserError` with what it wrote."""
    out, err = process.stdout, process.stderr
    if out is None or err is None:
        raise UserError("the emulator was started without pipes: this is a fault of the program", FAILED)
    silent = ""
    try:
        line = await asyncio.wait_for(out.readline(), START_MAX_S)
    except TimeoutError:
        line, silent = b"", f"no answer within {START_MAX_S:.0f} s; {OVERLOADED}"
    if not line.startswith(READY_WORD.encode()):
        _signal(process, signal.SIGKILL)
        words = (await err.read()).decode(errors="replace").strip()
        code = await process.wait()
        why = words.removeprefix("echolocate: ") or silent or f"it ended by {_end_of(code)}"
        raise UserError(f"the emulator did not start: {why}", WRONG_CALL if code == WRONG_CALL else FAILED)


def _end_of(code: int) -> str:
    """Return the signal that ended a process, or else its exit code."""
    return signal.Signals(-code).name if code < 0 else f"exit code {code}"


async def _end(process: Child) -> None:
    """End the emulator in order, or after `END_MAX_S` by force, and wait for that."""
    _signal(process, signal.SIGTERM)
    try:
        await asyncio.wait_for(process.wait(), END_MAX_S)
    except TimeoutError:
        _signal(process, signal.SIGKILL)
        await process.wait()


def _signal(process: Child, number: signal.Signals) -> None:
    """Send a signal without asyncio, whose own method may reap the child first and then fails."""
    if process.returncode is None:
        with contextlib.suppress(ProcessLookupError):
            os.kill(process.pid, number)
