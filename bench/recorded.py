"""The command with a stopwatch on what recording asks of the loop: `python -m bench.recorded OUT run …`.

Everything the loop hands to the recorder between the end of one cycle and the end of the next is one sample.
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
    """Adds up what is timed until it is read."""

    def __init__(self) -> None:
        self.samples_us: list[tuple[float, float]] = []
        """Wall time, and the thread's own processor time, of each cycle."""
        self._took_s = self._cpu_s = 0.0

    def timed(self, call: Callable[..., None], *, ends: bool = False) -> Callable[..., None]:
        """Return `call` with its time taken; one that `ends` a cycle makes a sample of all since the last."""

        def timed(*args: Any) -> None:
            begin_host_s, cpu_s = time.monotonic(), time.thread_time()
            call(*args)
            self._took_s += time.monotonic() - begin_host_s
            self._cpu_s += time.thread_time() - cpu_s
            if ends:
                self.samples_us.append((1e6 * self._took_s, 1e6 * self._cpu_s))
                self._took_s = self._cpu_s = 0.0

        return timed


def run(out: Path) -> None:
    """Run the command as it is called, and write the samples, a line each."""
    use_kernel_cache()  # before numba is loaded, with the recorder
    from runtime.recording.recorder import Recorder

    watch = Stopwatch()
    for name in ("on_bytes", "on_log", "on_settings", "on_summary"):
        setattr(Recorder, name, watch.timed(getattr(Recorder, name)))
    Recorder.on_cycle = watch.timed(Recorder.on_cycle, ends=True)  # type: ignore[method-assign]
    try:
        main()
    finally:
        out.write_text("".join(f"{wall:.1f},{cpu:.1f}\n" for wall, cpu in watch.samples_us), encoding="ascii")


if __name__ == "__main__":
    place = Path(sys.argv.pop(1))
    run(place)
