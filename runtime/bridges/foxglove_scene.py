"""States of a run as Foxglove messages, with the schemas and topics of `echolocate export --to foxglove`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final

import foxglove
import numpy as np
import orjson

from drivers.messages import Pose
from runtime.analysis.export.foxglove_messages import RunChannels, object_label
from runtime.analysis.export.shapes import even_radius
from runtime.analysis.timeline import CROSS_PATH, CrossPathRows
from runtime.bridges.console_client import ConsoleClient, Message
from runtime.support.log_sentence import sentence

CIRCLE_POINTS: Final = 36
MAP_EVERY: Final = 4
"""Every so many states show segments and objects."""
STATE_FIELDS: Final = (
    "mode",
    "reason",
    "hold_reason",
    "cycle",
    "robot_s",
    "pose",
    "ring_yaw",
    "twist",
    "flags",
    "cycle_us",
    "late_us",
    "missed",
    "late",
    "quanta",
    "waiting",
    "phases",
    "link",
    "clients",
    "speed",
    "paused",
    "localized",
    "sensors",
)
"""What `/state` has of a state, as JSON, to be plotted."""


class SceneChannels:
    """The channels of a live run."""

    def __init__(self, context: foxglove.Context) -> None:
        self._run = RunChannels(context)
        self._state = foxglove.Channel("/state", schema={"type": "object"}, message_encoding="json", context=context)
        self._session: Mapping[str, Any] = {}
        """The newest session; empty before the first."""
        self._states = 0
        """Number of states written."""

    def begin(self, session: Mapping[str, Any], at: int) -> None:
        """Take in a session at a time, ns since 1970."""
        self._session = session
        self._write_truth(at)

    def take(self, state: Message, client: ConsoleClient, at: int) -> None:
        """Write a state; segments and polylines are those of the client."""
        if not self._session or state["playback"] is not None:
            return
        self._write_frames(state, at)
        self._write_ranges(state, at)
        if state.get("cross_paths"):  # a run of an earlier version sends none
            rows = cross_path_rows(state["cross_paths"], self._session["ring"])
            self._run.write_cross_paths(rows, self._session["ring"]["half_angle"], at)
        self._state.log(orjson.dumps({name: state[name] for name in STATE_FIELDS}), log_time=at)
        if self._states % MAP_EVERY == 0:
            self._write_map(state["objects"], client, at)
            self._write_truth(at)  # for clients that have connected since
        self._states += 1

    def take_log(self, entry: Message, at: int) -> None:
        """Write a line of the log."""
        self._run.write_log(entry["level"], sentence(entry["event"], entry["fields"]), at)

    def _write_frames(self, state: Message, at: int) -> None:
        """Write the pose in `odom`, and that of `odom` in the map while it is known."""
        x, y, theta = state["pose"]
        localized, rows = state["localized"], [("odom", "base", Pose(x, y, theta))]
        if localized is not None and localized["status"] == "tracking":
            rows.insert(0, ("map", "odom", Pose(*localized["frame"]).inverse()))
        self._run.write_frames(rows, at)
        self._run.write_pose(Pose(x, y, theta), at)

    def _write_ranges(self, state: Message, at: int) -> None:
        """Write the sensors that fired: one scan for an even ring, otherwise an arc for each sensor."""
        ring, fired = self._session["ring"], state["firing"]
        if not fired:
            return
        mounts, ranges = ring["mounts"], [math.inf if r == -1.0 else r for r in state["ranges"]]
        base = Pose(state["pose"][0], state["pose"][1], state["ring_yaw"])
        radius = even_radius(mounts)
        if radius is not None:
            from_centre = [ranges[k] + radius if k in fired else math.nan for k in range(len(mounts))]
            self._run.write_ring(base, from_centre, at)
            return
        half = ring["half_angle"]
        for sensor in fired:
            turned = Pose(*state["pose"]) if sensor in ring["turning"] else base
            self._run.write_arc(turned.compose(Pose(*mounts[sensor])), half, ranges[sensor], at)

    def _write_map(self, objects: list[Message], client: ConsoleClient, at: int) -> None:
        """Write segments, objects, walls and polylines."""
        ends = [point for row in client.segments.values() for point in (row[:2], row[2:4])]
        self._run.write_segments(ends, at)
        models = {model["name"]: model for model in self._session["models"]}
        labels = [
            (seen["x"], seen["y"], object_label(seen["number"], seen["model"], seen["score"]))
            for seen in objects
            if seen["ends"] is None
        ]
        outlines = [outline(seen, models.get(seen["model"])) for seen in objects]
        self._run.write_objects(outlines, [one["points"] for one in client.polylines], labels, at)

    def _write_truth(self, at: int) -> None:
        """Write the true world of an emulated robot, or the known room, in odometry's frame."""
        truth = self._session["truth"]
        if truth is None:
            return
        walls = [[(x1, y1), (x2, y2)] for x1, y1, x2, y2 in truth["walls"]]
        self._run.write_truth([*(circle(*drum) for drum in truth["drums"]), *truth["polygons"]], walls, at)


def cross_path_rows(firings: list[Message], ring: Message) -> CrossPathRows:
    """Return the cross paths of a state, (n,) `CROSS_PATH`, in odometry's frame.

    `t_s` is the robot's clock here, as there is no time of the run. `ring`: that of the session.
    """
    rows = []
    for firing in firings:
        x, y, heading, ring_yaw = firing["pose"]
        yaws = (heading if k in ring["turning"] else ring_yaw for k in range(len(ring["mounts"])))
        eyes = [Pose(x, y, yaw).compose(Pose(*mount)) for yaw, mount in zip(yaws, ring["mounts"], strict=True)]
        for transmitter, listener, half_m in firing["paths"]:
            one, other = eyes[transmitter], eyes[listener]
            places = (one.x, one.y, one.theta, other.x, other.y, other.theta)
            rows.append((firing["robot_s"], transmitter, listener, *places, half_m, firing["robot_s"]))
    return np.array(rows, CROSS_PATH)


def outline(seen: Message, model: Message | None) -> tuple[list[tuple[float, float]], bool]:
    """Return the outline of an object (m), and whether it is closed."""
    if seen["ends"] is not None:
        x1, y1, x2, y2 = seen["ends"]
        return [(x1, y1), (x2, y2)], False
    if model is None or model["arc_radius_m"] is not None:
        return circle(seen["x"], seen["y"], 0.1 if model is None else model["arc_radius_m"]), True
    place = Pose(seen["x"], seen["y"], seen["theta"])
    corners = [place.compose(Pose(x, y, 0.0)) for x, y in model["vertices"]]
    return [(corner.x, corner.y) for corner in corners], model["closed"]


def circle(x: float, y: float, radius: float) -> list[tuple[float, float]]:
    """Return the corners of a circle about x, y, m."""
    turns = (2.0 * math.pi * k / CIRCLE_POINTS for k in range(CIRCLE_POINTS))
    return [(x + radius * math.cos(turn), y + radius * math.sin(turn)) for turn in turns]
