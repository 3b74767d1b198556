"""The foot in metres: the paper, the Denning and many constants were measured in feet."""

from __future__ import annotations

from typing import Final

FOOT_M: Final = 0.3048
"""An international foot, m."""
