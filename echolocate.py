"""echolocate: recognition by sonar as a library, and the entry point of the command.

`import echolocate` gives the public surface in one name; each part is imported when it is first used. The packages
behind it have plain names (`config`, `runtime`), which a file on `PYTHONPATH` can hide. So this module checks first
that they are its own.
"""

from __future__ import annotations

import os
import sys

TYPE_CHECKING = False
"""As in `typing`, which is not imported before signals are handled."""

if TYPE_CHECKING:
    from typing import Any, Final

    from config.load import load_mission, load_model, load_robot, load_settings, load_world
    from drivers.messages import Firing, Pose
    from perception.detected_object import DetectedObject
    from perception.polyline import Polyline
    from perception.recogniser import Recogniser
    from runtime.recording.ring_log import read_ring_log
    from runtime.recording.ring_log_rows import write_ring_log
    from runtime.simulation.closed_loop import SimulationResult, simulate
    from runtime.simulation.random_halls import random_hall

__all__ = [
    "DetectedObject",
    "Firing",
    "Polyline",
    "Pose",
    "Recogniser",
    "SimulationResult",
    "load_mission",
    "load_model",
    "load_robot",
    "load_settings",
    "load_world",
    "random_hall",
    "read_ring_log",
    "simulate",
    "write_ring_log",
]

PACKAGES: Final = ("config", "drivers", "perception", "behaviors", "runtime")
ROOT: Final = os.path.dirname(os.path.realpath(__file__))
"""The folder in which the packages lie beside this module."""
_MODULES: Final = {
    "DetectedObject": "perception.detected_object",
    "Firing": "drivers.messages",
    "Polyline": "perception.polyline",
    "Pose": "drivers.messages",
    "Recogniser": "perception.recogniser",
    "SimulationResult": "runtime.simulation.closed_loop",
    "load_mission": "config.load",
    "load_model": "config.load",
    "load_robot": "config.load",
    "load_settings": "config.load",
    "load_world": "config.load",
    "random_hall": "runtime.simulation.random_halls",
    "read_ring_log": "runtime.recording.ring_log",
    "simulate": "runtime.simulation.closed_loop",
    "write_ring_log": "runtime.recording.ring_log_rows",
}
_WRONG_CALL: Final = 2
"""Exit code; `config.errors` has it too, and may be what is hidden."""


def hidden_package() -> str | None:
    """Return a line that names a package of ours and the file imported in its place; None if none is hidden."""
    for package in PACKAGES:
        specs = (finder.find_spec(package, None) for finder in sys.meta_path)
        spec = next((spec for spec in specs if spec is not None), None)
        if spec is None:
            return f"the package '{package}' is missing in {ROOT}: install echolocate again"
        # A folder without __init__.py has no origin.
        place = spec.origin or next(iter(spec.submodule_search_locations or ()), "")
        if os.path.dirname(os.path.realpath(place)) != os.path.join(ROOT, package):
            return (
                f"{place} hides echolocate's own package '{package}': rename it, or take its folder out of PYTHONPATH"
            )
    return None


def main() -> None:
    """Run the command line and exit."""
    problem = hidden_package()
    if problem is not None:
        sys.stderr.write(f"echolocate: {problem}\n")
        sys.exit(_WRONG_CALL)
    from runtime.cli.__main__ import main as run_command_line

    run_command_line()


def __getattr__(name: str) -> Any:  # noqa: ANN401 - whatever the public surface has
    """Import a part of the public surface at its first use.

    Raises
    ------
    AttributeError
        There is no such part.
    ImportError
        A file hides one of the packages.
    """
    if name not in _MODULES:
        raise AttributeError(f"module 'echolocate' has no attribute '{name}'")
    problem = hidden_package()
    if problem is not None:
        raise ImportError(problem)
    from importlib import import_module  # noqa: TID251 - the imports are written out above, for the type checker

    value = getattr(import_module(_MODULES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)


if __name__ == "__main__":
    main()
