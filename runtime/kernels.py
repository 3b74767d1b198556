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
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from rich.console import Console

    from config.settings import Settings
    from perception.pipeline import Perception

PACKAGES: Final = ("perception", "perception.full", "drivers.emulator")
"""Where kernels live."""

WARM: Final = "warm"
"""A file of this name says that everything was compiled into this folder once."""


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


def is_warm(folder: Path) -> bool:
    """Say whether everything was compiled into `folder` before."""
    return (folder / WARM).exists() or os.environ.get("NUMBA_DISABLE_JIT", "0") not in {"", "0"}


def warm_up(settings: Settings) -> None:
    """Run every kernel of both methods once, on a robot that drives past a wall, so that none is compiled later.

    What a person does by hand is done as well: a first edit must not hold up a cycle.

    Parameters
    ----------
    settings : Settings
        Ring, models and constants of the run.
    """
    import numpy as np

    from config.model import ModelConfig
    from drivers.messages import Firing, Pose
    from perception.pipeline import Perception

    square = ModelConfig(name="warm-up", closed=True, vertices_m=((1.0, -1.0), (1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0)))
    eager = settings.perception.clusters.model_copy(update={"segments_min": 1})
    for method in ("paper", "full"):
        config = settings.perception.model_copy(update={"clusters": eager, "method": method})
        perception = Perception(settings.ring, (*settings.models, square), config)
        for k in range(24):
            ranges = np.full(len(settings.ring.mounts), 2.0)
            perception.observe(Firing(0.1 * k, Pose(0.1 * k, 0.0, 0.0), 0.0, ranges))
            while perception.pending:
                perception.refine()
        perception.things()
        edit_everything(perception, [m.name for m in (*settings.models, square)])


def edit_everything(perception: Perception, models: list[str]) -> None:
    """Do every kind of edit once, with each model."""
    from perception.edits import (
        ClearMap,
        ConfirmObject,
        DeleteSegments,
        MoveObject,
        PinSegments,
        PlaceModel,
        RejectObject,
    )

    numbers = tuple(perception.segments().numbers[:2].tolist())
    perception.edit(PinSegments(numbers, pinned=True))
    for model in models:
        perception.edit(PlaceModel(model, 1.0, 2.5, 0.0))
    for seen in perception.objects():
        if seen.number is not None:
            perception.evidence(seen.number)
            perception.edit(MoveObject(seen.number, 1.1, 2.5, 0.0))
            perception.edit(MoveObject(seen.number, 9.0, 9.0, 0.0))
            perception.edit(ConfirmObject(seen.number))
            perception.edit(RejectObject(seen.number))
    perception.edit(DeleteSegments(numbers))
    perception.edit(ClearMap())


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


def ready_kernels(settings: Settings, console: Console) -> None:
    """Have every kernel compiled, or say that it takes a while and compile it.

    Parameters
    ----------
    settings : Settings
        Ring, models and constants of the run.
    console : Console
        Where to say so.
    """
    folder = use_cache()
    if is_warm(folder):
        warm_up(settings)
        return
    with console.status("compiling kernels; this happens once"):
        compile_all(settings, folder)


def compile_all(settings: Settings, folder: Path) -> None:
    """Compile the kernels of perception and of the emulator, and note that it was done."""
    from config.world import DrumConfig, WallConfig, WorldConfig
    from drivers.emulator.device import EmulatedRobot

    warm_up(settings)
    for model in ("cone", "specular"):
        acoustics = WorldConfig().acoustics.model_copy(update={"model": model, "crosstalk": 0.5})
        world = WorldConfig(
            drum=(DrumConfig(x_m=2.0, y_m=0.0, radius_m=0.3),),
            wall=(WallConfig(x1_m=3.0, y1_m=-3.0, x2_m=3.0, y2_m=3.0),),
            acoustics=acoustics,
        )
        EmulatedRobot(settings, world, seed=0).advance(0.5)
    (folder / WARM).touch()
