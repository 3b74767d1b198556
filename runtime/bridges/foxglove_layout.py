"""A layout for Foxglove: plan, plots of every numeric field of `/state`, log, state and parameters."""

from __future__ import annotations

from typing import Any, Final

from runtime.timing.phases import Phase

PLOTS: Final = (
    ("motion", ("pose[0]", "pose[1]", "pose[2]", "ring_yaw", "twist[0]", "twist[1]")),
    ("cycle", ("cycle_us", "late_us", *(f"phases.{phase.value}" for phase in Phase))),
    ("counts", ("missed", "late", "quanta", "waiting", "clients", "cycle", "speed")),
    ("line", ("link.frames", "link.bad", "link.lost")),
)
"""The plots, each with its fields of `/state`."""
SHOWN: Final = ("/ring", "/cross_paths", "/segments", "/clusters", "/models", "/truth", "/pose")
"""Topics on the plan."""


def layout() -> dict[str, Any]:
    """Return the layout, as Foxglove imports it."""
    panels: dict[str, Any] = {
        "3D!plan": {
            "followTf": "odom",
            "cameraState": {"perspective": False, "distance": 12.0, "phi": 0.0, "thetaOffset": 90.0},
            "scene": {"transforms": {"visible": True}},
            "topics": {topic: {"visible": True} for topic in SHOWN},
        },
        "RosOut!log": {"topicToRender": "/log"},
        "StateTransitions!mode": {"paths": [{"value": "/state.mode", "timestampMethod": "receiveTime"}]},
        "RawMessages!state": {"topicPath": "/state"},
        "Parameters!settings": {"title": "Settings"},
    }
    for name, fields in PLOTS:
        one = {"enabled": True, "timestampMethod": "receiveTime"}
        paths = [{"value": f"/state.{field}", **one} for field in fields]
        panels[f"Plot!{name}"] = {"title": name, "paths": paths, "showLegend": True, "followingViewWidth": 30}
    plots = [f"Plot!{name}" for name, _ in PLOTS]
    right = _stack([*plots, "StateTransitions!mode"])
    texts = _beside("RosOut!log", _beside("RawMessages!state", "Parameters!settings"))
    left = {"direction": "column", "first": "3D!plan", "second": texts, "splitPercentage": 65}
    return {
        "configById": panels,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": {"direction": "row", "first": left, "second": right, "splitPercentage": 60},
    }


def _stack(panels: list[str]) -> Any:  # noqa: ANN401 - a tree of panels
    if len(panels) == 1:
        return panels[0]
    share = 100.0 / len(panels)
    return {"direction": "column", "first": panels[0], "second": _stack(panels[1:]), "splitPercentage": share}


def _beside(first: Any, second: Any) -> dict[str, Any]:  # noqa: ANN401 - trees of panels
    return {"direction": "row", "first": first, "second": second}
