"""A stub of the program that makes reports and maps: it writes files, fails or goes on, by the recording's name."""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

from runtime.support.progress import MARK, PROGRESS_LINES


def main() -> int:
    """Do as the command of the same arguments would; return its exit code."""
    assert os.environ[PROGRESS_LINES]
    recording, words = Path(sys.argv[2]), sys.argv[3:]
    if recording.stem == "broken":
        sys.stderr.write(f"warming up\necholocate: {recording.name}: holds no cycle\n")
        return 1
    sys.stderr.write(f"{MARK}0.250 reading\n{MARK}0.500 drawing the map\n")
    sys.stderr.flush()
    if recording.stem == "endless":
        time.sleep(3600.0)
    for option, target in zip(words[::2], words[1::2], strict=True):
        if option != "--units":
            Path(target).write_text("made\n", "utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
