"""The cache of compiled kernels: its folder, and which parts of it a run needs.

Numba's own cache lies beside the sources, does not notice a change in another file, and fails where it cannot write.
So kernels are in the user's cache, each named by a digest of all that it depends on (`perception.kernel_digest`): all
copies and versions of the sources share what they have in common. Within, each version of the sources has a folder
whose files say which parts of it are compiled, so that nothing is imported to know it.
"""

from __future__ import annotations

import atexit
import contextlib
import functools
import hashlib
import os
import shutil
import stat
import sys
import tempfile
from collections.abc import Iterable
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Final

from platformdirs import user_cache_path

from config.errors import UserError
from runtime.support.user_folders import users_own

if TYPE_CHECKING:
    from config.settings import Settings

PACKAGES: Final = (
    "perception",
    "perception.sensor_faults",
    "perception.ring_faults",
    "perception.obstacle_echoes",
    "perception.paper",
    "perception.bayes.memory",
    "perception.bayes.inference",
    "perception.bayes.segments",
    "perception.bayes.circles",
    "perception.bayes.polygons",
    "perception.bayes.walls",
    "perception.bayes.tracks",
    "perception.bayes.reports",
    "perception.localization.room",
    "perception.localization.known_room",
    "perception.localization.drift",
    "perception.localization.submaps",
    "perception.mapping.grid",
    "perception.mapping.surfaces",
    "behaviors.valley",
    "drivers.emulator",
)
"""Packages that hold kernels, or what is compiled into them."""

PAPER: Final = "paper"
BAYES: Final = "bayes"
POLYGONS: Final = "polygons"
EMULATOR: Final = "emulator"
RING: Final = "ring"
LOCALIZATION: Final = "localization"
KNOWN_ROOM: Final = "known_room"
VALLEY: Final = "valley"
SURFACES: Final = "surfaces"
ECHO_LAG: Final = "echo_lag"
GRIDS: Final = ("directed", "moravec_elfes", "elfes")
PARTS: Final = (EMULATOR, RING, BAYES, POLYGONS, PAPER, LOCALIZATION, KNOWN_ROOM, VALLEY, SURFACES, ECHO_LAG, *GRIDS)
"""What is compiled separately: what keeps the ring's echoes and finds false ones, without which no robot drives; a
method by its name, what the Bayesian method needs beyond it for polygons, the emulator, the correction of drift,
finding the robot in a known room, the choice of a valley, the map of surfaces, the lag of ranges behind odometry, and
each kind of evidence grid. A file with the name of a part in the folder of `use_kernel_cache` says that it is
compiled."""

COMPILED_SUFFIX: Final = ".compiled"
"""Ending of empty files in the folder of `use_kernel_cache`, one for each kernel that was compiled; progress is
shown from them."""

PRIVATE: Final = 0o700
OTHERS_WRITE: Final = stat.S_IWGRP | stat.S_IWOTH


def kernels_key() -> str:
    """Return a digest of everything that compiled kernels may depend on: the sources, Python, numba and numpy."""
    return _key(*(os.environ.get(name, "") for name in ("NUMBA_BOUNDSCHECK", "NUMBA_OPT")))


@functools.cache
def _key(*compiler: str) -> str:
    """Return the digest for these settings of the compiler; a start asks four times, and reading takes 7 ms."""
    digest = hashlib.sha256(f"{sys.version}{version('numba')}{version('numpy')}{list(compiler)}".encode())
    for package in PACKAGES:
        spec = find_spec(package)
        for place in spec.submodule_search_locations or () if spec else ():
            for source in sorted(Path(place).glob("*.py")):
                digest.update(source.read_bytes())
    return digest.hexdigest()[:16]


def cache_folder() -> Path:
    """Return the folder of all kernels, which only this user can write; it is created if needed.

    Numba unpickles what it finds there, so a user who can write into it can run code as this one. It is in the user's
    cache; where that cannot be written or others can write into it, it is a new folder for this process and its
    children, which is removed at the end.

    Raises
    ------
    UserError
        Neither can be created.
    """
    own = users_own(user_cache_path)
    if own is not None:
        folder = own / "kernels"
        with contextlib.suppress(OSError):
            folder.mkdir(mode=PRIVATE, parents=True, exist_ok=True)
            if all(_is_ours(place) for place in (folder, folder.parent)):
                with tempfile.TemporaryFile(dir=folder):
                    return folder
    try:
        private = Path(tempfile.mkdtemp(prefix="echolocate-kernels-"))
    except OSError as error:
        raise UserError(
            f"compiled kernels can be stored neither in {own or 'a home folder'} nor in a temporary folder: "
            f"{error.strerror or error}; make room, or name a folder in XDG_CACHE_HOME or TMPDIR"
        ) from error
    atexit.register(shutil.rmtree, private, ignore_errors=True)
    return private


def _is_ours(folder: Path) -> bool:
    """Return whether a folder, not a link to one, belongs to this user and no other can write into it."""
    found = folder.lstat()
    return stat.S_ISDIR(found.st_mode) and found.st_uid == os.geteuid() and not found.st_mode & OTHERS_WRITE


def use_kernel_cache() -> Path:
    """Set numba's cache folder, unless the environment names one; call this before importing numba.

    Returns
    -------
    Path
        The folder in it that says which parts of these sources are compiled.
    """
    kernels = os.environ.get("NUMBA_CACHE_DIR")
    if not kernels:  # numba takes an empty one for none, too
        kernels = os.environ["NUMBA_CACHE_DIR"] = str(cache_folder())
    folder = Path(kernels) / kernels_key()
    with contextlib.suppress(OSError):  # what writes into it says what is wrong
        folder.mkdir(parents=True, exist_ok=True)
    return folder


def is_interpreted() -> bool:
    """Return whether numba's compiler is switched off."""
    return os.environ.get("NUMBA_DISABLE_JIT", "0") not in {"", "0"}


def needed_parts(settings: Settings) -> tuple[str, ...]:
    """Return the parts that a run needs. Polygons take half of the time to compile, and many runs have none."""
    has_polygons = any(model.arc_radius_m is None for model in settings.models)
    polygons = (POLYGONS,) if has_polygons and settings.perception.method == BAYES else ()
    place = settings.perception.localization
    localization = (LOCALIZATION,) if place.correct_drift else ()
    echo_lag = (ECHO_LAG,) if place.finds_echo_lag(settings.ring) else ()
    known_room = () if place.known_room is None else (KNOWN_ROOM,)
    grid = () if settings.perception.grid.method == "off" else (settings.perception.grid.method,)
    surfaces = (SURFACES,) if settings.perception.maps_surfaces else ()
    method = settings.perception.method
    return (EMULATOR, RING, method, *polygons, *localization, *known_room, VALLEY, *surfaces, *grid, *echo_lag)


def uncompiled_parts(folder: Path, parts: Iterable[str]) -> list[str]:
    """Return those parts that are not yet compiled, as the files in the folder of `use_kernel_cache` say."""
    return [part for part in parts if not (folder / part).exists()]


def is_compiled(part: str) -> bool:
    """Return whether a part is compiled in the cache, or need not be as there is no compiler."""
    return is_interpreted() or not uncompiled_parts(use_kernel_cache(), [part])


def compiled_signatures() -> int:
    """Return how many kernel signatures this process has compiled or loaded; a drive must not add to them."""
    dispatchers = sys.modules.get("numba.core.dispatcher")
    if dispatchers is None:
        return 0
    # A kernel imported by several modules is one object.
    kernels = {
        id(value): value
        for name, module in list(sys.modules.items())
        if name.rpartition(".")[0] in PACKAGES
        for value in list(vars(module).values())  # another thread may be importing it
        if isinstance(value, dispatchers.Dispatcher)
    }
    return sum(len(kernel.overloads) for kernel in kernels.values())
