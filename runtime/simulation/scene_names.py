"""The names of the scenes, separate from the scenes so that the command line can offer them without loading them."""

from __future__ import annotations

from typing import Literal, TypeAlias

SceneName: TypeAlias = Literal[
    "clean", "moved", "noisy", "walls", "jit10", "boxes", "boxes_facing", "boxes_45", "halls"
]
