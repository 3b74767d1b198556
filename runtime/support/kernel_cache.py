"""Where compiled kernels are kept, and compiling them before the robot needs them.

Numba's own cache sits beside the sources, does not notice a change in another file, and fails where it cannot
write. So each version of the sources gets a folder of its own, named by their content, in the user's cache; and one
process compiles everything before a second one starts.
"""

from __future__ import annotations

import hashlib
import os
import sys
import tempfile
from collections.abc import Iterable, Sequence
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from rich.console import Console

    from config.settings import Settings

PACKAGES: Final = ("perception", "perception.paper", "perception.bayes", "drivers.emulator")
"""Where kernels live."""

PAPER: Final = "paper"
CIRCLES: Final = "bayes"
POLYGONS: Final = "polygons"
EMULATOR: Final = "emulator"
PARTS: Final = (EMULATOR, CIRCLES, POLYGONS, PAPER)
"""What is compiled for itself; a file of this name in the cache says that it was done. Methods lend their names."""


def kernels_key() -> str:
    """Return a digest of everything that compiled kernels depend on: these very sources, Python and numba."""
    checked = os.environ.get("NUMBA_BOUNDSCHECK", "")  # numba's own key does not hold it
    digest = hashlib.sha256(f"{sys.version}{version('numba')}{version('numpy')}{checked}".encode())
    for package in PACKAGES:
        spec = find_spec(package)
        for place in spec.submodule_search_locations or () if spec else ():
            for source in sorted(Path(place).glob("*.py")):
                digest.update(source.read_bytes())
    return digest.hexdigest()[:16]


def cache_folder() -> Path:
    """Return the folder for the kernels of these very sources, Python and numba; made if it can be."""
    key = kernels_key()
    mine = f"echolocate-{os.getuid()}"
    homes = [Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"), Path(tempfile.gettempdir()) / mine]
    for home in homes:
        folder = home / "echolocate" / "kernels" / key
        try:
            folder.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=folder):
                return folder
        except OSError:
            continue
    return Path(tempfile.mkdtemp(prefix="echolocate-"))


def use_cache() -> Path:
    """Tell numba where to keep kernels; call it before numba is imported. An existing setting is respected."""
    return Path(os.environ.setdefault("NUMBA_CACHE_DIR", str(cache_folder())))


def is_interpreted() -> bool:
    """Tell whether nothing is compiled at all."""
    return os.environ.get("NUMBA_DISABLE_JIT", "0") not in {"", "0"}


def needed(settings: Settings) -> tuple[str, ...]:
    """Return the parts that a run with these settings needs: polygons are half the work, and many runs have none."""
    outlines = any(model.arc_radius_m is None for model in settings.models)
    polygons = (POLYGONS,) if outlines and settings.perception.method == CIRCLES else ()
    return (EMULATOR, settings.perception.method, *polygons)


def missing(folder: Path, parts: Iterable[str]) -> list[str]:
    """Return those of the parts that were never compiled into `folder`."""
    return [part for part in parts if not (folder / part).exists()]


def warm_up(settings: Settings, parts: Iterable[str]) -> None:
    """Run every kernel of these parts once, so that none is compiled later.

    What a person does by hand is done as well: a first edit must not hold up a cycle.

    Parameters
    ----------
    settings : Settings
        Ring, models and constants of the run.
    parts : iterable of str
        Of `PARTS`.
    """
    from runtime.support import kernel_warmup as warming

    for part in parts:
        warming.RUN_ONCE[part](settings)


def compiled_signatures() -> int:
    """Return how many signatures of our kernels are compiled or loaded by now: a drive must not add to them."""
    dispatchers = sys.modules.get("numba.core.dispatcher")
    if dispatchers is None:
        return 0
    # One kernel imported by several modules is the same object in all of them.
    kernels = {
        id(value): value
        for name, module in list(sys.modules.items())
        if name.rpartition(".")[0] in PACKAGES
        for value in vars(module).values()
        if isinstance(value, dispatchers.Dispatcher)
    }
    return sum(len(kernel.overloads) for kernel in kernels.values())


def ready_kernels(settings: Settings, console: Console, parts: Iterable[str] | None = None) -> None:
    """Have every kernel compiled, or say that it takes a while and compile it.

    Parameters
    ----------
    settings : Settings
        Ring, models and constants of the run.
    console : Console
        Where to say so.
    parts : iterable of str, optional
        Of `PARTS`; what a run with these settings needs where not given.
    """
    folder = use_cache()
    if is_interpreted():
        return
    parts = needed(settings) if parts is None else tuple(parts)
    absent = missing(folder, parts)
    if not absent:
        warm_up(settings, (part for part in parts if part != EMULATOR))
        return
    with console.status("compiling kernels; this happens once"):
        compile_parts(settings, folder, absent)
        warm_up(settings, (part for part in parts if part not in {*absent, EMULATOR}))


def compile_parts(settings: Settings, folder: Path, parts: Sequence[str]) -> None:
    """Compile these parts into `folder`, two at a time where there are two processors, and note that it was done."""
    from runtime.support import kernel_warmup as warming

    if CIRCLES in parts and (os.cpu_count() or 1) > 1:
        # What another process compiled meanwhile is found in the cache; what begins first depends on nothing of it.
        with warming.helper(POLYGONS if POLYGONS in parts else CIRCLES):
            warming.hear(settings)
            if POLYGONS in parts:
                warming.RUN_ONCE[CIRCLES](settings)
    warm_up(settings, parts)
    for part in parts:
        (folder / part).touch()
