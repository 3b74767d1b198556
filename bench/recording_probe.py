"""The command with the loop's calls to the recorder timed: `python -m bench.recording_probe OUT run …`.

All calls between the end of one cycle and the end of the next make one sample.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from runtime.cli.app import main
from runtime.support.kernel_cache import use_kernel_cache


class Stopwatch:
    """Sums the times of calls up to the end of each cycle."""

    def __init__(self) -> None:
        self.samples_us: list[tuple[float, float]] = []
        """Wall time and the thread's CPU time of each cycle, µs."""
        self._took_s = self._cpu_s = 0.0

    def timed(self, call: Callable[..., None], *, ends_cycle: bool = False) -> Callable[..., None]:
        """Return `call` wrapped so that it is timed; with `ends_cycle` each call completes a sample."""

        def timed(*args: Any) -> None:
            begin_s, begin_cpu_s = time.monotonic(), time.thread_time()
            call(*args)
            self._took_s += time.monotonic() - begin_s
            self._cpu_s += time.thread_time() - begin_cpu_s
            if ends_cycle:
                self.samples_us.append((1e6 * self._took_s, 1e6 * self._cpu_s))
                self._took_s = self._cpu_s = 0.0

        return timed


def run(out: Path) -> None:
    """Run the command with the arguments of this process, and write the samples to `out`, one per line."""
    use_kernel_cache()  # before the recorder imports numba
    from runtime.recording.recorder import Recorder

    stopwatch = Stopwatch()
    for name in ("on_bytes", "on_log", "on_settings", "on_summary", "on_cycle"):
        setattr(Recorder, name, stopwatch.timed(getattr(Recorder, name), ends_cycle=name == "on_cycle"))
    try:
        main()
    finally:
        out.write_text("".join(f"{wall:.1f},{cpu:.1f}\n" for wall, cpu in stopwatch.samples_us), encoding="ascii")


if __name__ == "__main__":
    run(Path(sys.argv.pop(1)))
