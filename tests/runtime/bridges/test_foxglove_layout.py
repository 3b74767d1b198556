"""The layout: every panel is placed once, and every plotted field is one of a state."""

from __future__ import annotations

from typing import Any

from runtime.bridges.foxglove_layout import PLOTS, layout
from runtime.bridges.foxglove_scene import STATE_FIELDS


def placed(tree: Any) -> list[str]:
    return [tree] if isinstance(tree, str) else [*placed(tree["first"]), *placed(tree["second"])]


def test_every_panel_is_placed_once() -> None:
    made = layout()
    assert sorted(placed(made["layout"])) == sorted(made["configById"])
    kinds = {name.partition("!")[0] for name in made["configById"]}
    assert {"3D", "Plot", "RosOut", "RawMessages", "StateTransitions", "Parameters"} == kinds


def test_every_plotted_field_is_one_of_a_state() -> None:
    plotted = [field.replace("[", ".").partition(".")[0] for _, fields in PLOTS for field in fields]
    assert set(plotted) <= set(STATE_FIELDS)
