"""Files that other programs read while this one writes them: whole, or as they were."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path


@contextlib.contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Yield a path to write; afterwards the file is renamed to `path`, which is so never half written.

    Raises
    ------
    OSError
        It cannot be written.
    """
    part = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        yield part
        with part.open("rb") as file:
            os.fsync(file.fileno())  # else a machine that loses its power may keep the name and not the content
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)
