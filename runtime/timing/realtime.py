"""Scheduling precedence from the operating system: what it grants is used, what it refuses is reported.

Nothing is requested by default: the owner of the machine switches it on in the section `[realtime]`, because it is at
the cost of other programs.
"""

from __future__ import annotations

import ctypes
import os
import platform
import struct
from collections.abc import Callable
from types import MappingProxyType
from typing import Final

from config.settings import RealtimeConfig

_SCHED_SETATTR: Final = MappingProxyType({"x86_64": 314, "aarch64": 274, "riscv64": 274})
"""Number of the system call; the C library has no name for it before 2.41."""
_ATTR: Final = "=IIQiIQQQ"
"""struct sched_attr: size, policy, flags, nice, priority, runtime, deadline, period."""
_CURRENT, _FUTURE, _ONFAULT = 1, 2, 4
"""MCL_CURRENT and so on. Pages are locked as they come into use: libraries of which little is used stay small."""


def apply_realtime(config: RealtimeConfig) -> list[str]:
    """Request everything that the settings name, for the calling thread and its memory; return the refusals.

    Each refusal is one line: what was refused, why, and what to do about it.
    """
    wanted: list[tuple[bool, Callable[[], str | None]]] = [
        (config.slice_s is not None, lambda: request_slice(config.slice_s or 0.0)),
        (config.core is not None, lambda: _pin(config.core or 0)),
        (config.lock_memory, _lock),
        (config.priority is not None, lambda: _priority(config.priority or 0)),
    ]
    answers = [request() for is_set, request in wanted if is_set]
    return [refusal for refusal in answers if refusal is not None]


def request_slice(slice_s: float) -> str | None:
    """Request a short time slice: the scheduler prefers threads that run briefly; return why it is refused.

    A slice of 0 restores the system's default. Since Linux 6.12 (EEVDF) a thread's virtual deadline follows from its
    slice; older kernels ignore it.
    """
    number = _SCHED_SETATTR.get(platform.machine()) if platform.system() == "Linux" else None
    if number is None or os.sched_getscheduler(0) != os.SCHED_OTHER:
        return None
    size, niceness = struct.calcsize(_ATTR), os.getpriority(os.PRIO_PROCESS, 0)
    attributes = struct.pack(_ATTR, size, os.SCHED_OTHER, 0, niceness, 0, round(1e9 * slice_s), 0, 0)
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.syscall(number, 0, attributes, 0) == 0:
        return None
    reason = os.strerror(ctypes.get_errno())
    return f"realtime.slice_s = {slice_s:g} is refused ({reason}): leave it out; cycles begin later on a busy machine"


def _pin(core: int) -> str | None:
    """Run on this core only; return why that is refused, or None, as the next two functions do."""
    allowed = sorted(os.sched_getaffinity(0))
    if core not in allowed:
        listed = ", ".join(map(str, allowed))
        return f"realtime.core = {core} is not a core this process may use ({listed}): name one of these"
    try:
        os.sched_setaffinity(0, {core})
    except OSError as error:
        return f"realtime.core = {core} is refused ({error.strerror}): leave it out, or ask the machine's owner"
    return None


def _lock() -> str | None:
    """Lock all memory, now and later, as it is touched; return why the system refuses that, None if it does not."""
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.mlockall(_CURRENT | _FUTURE | _ONFAULT) == 0:
        return None
    reason = os.strerror(ctypes.get_errno())
    return (
        f"realtime.lock_memory is refused ({reason}): raise the limit on locked memory (ulimit -l unlimited; "
        "LimitMEMLOCK=infinity in a systemd unit), or leave it out"
    )


def _priority(priority: int) -> str | None:
    """Run this thread with a real-time priority; return why the system refuses that, None if it does not."""
    try:
        # Child processes must not inherit it.
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(priority))
    except OSError as error:
        return (
            f"realtime.priority = {priority} is refused ({error.strerror}): allow it (ulimit -r {priority}; "
            f"LimitRTPRIO={priority} in a systemd unit), run with CAP_SYS_NICE, or leave it out"
        )
    return None
