"""States of a run as Foxglove messages, with the schemas and topics of `echolocate export --to foxglove`."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Final

import foxglove
import numpy as np
import orjson
from foxglove import channels as ch
from foxglove import messages as fx

from drivers.messages import Pose
from runtime.analysis.export.foxglove import (
    ARC_POINTS,
    colour,
    line,
    placed,
    quaternion,
    scene,
    stamp,
    write_cross_paths,
    write_log,
    write_segments,
)
from runtime.analysis.export.shapes import HEIGHT_M, MODEL, TRUTH, even_radius
from runtime.analysis.timeline import CROSS_PATH, CrossPathRows
from runtime.bridges.console_client import ConsoleClient, Message

CIRCLE_POINTS: Final = 36
MAP_EVERY: Final = 4
"""Every so many states show segments and objects."""
STATE_FIELDS: Final = (
    "mode", "reason", "hold_reason", "cycle", "robot_s", "pose", "ring_yaw", "twist", "flags", "cycle_us", "late_us",
    "missed", "late", "quanta", "waiting", "phases", "link", "clients", "speed", "paused", "localized", "sensors",
)  # fmt: skip
"""What `/state` has of a state, as JSON, to be plotted."""


class SceneChannels:
    """The channels of a live run.

    Parameters
    ----------
    context : foxglove.Context
        Of the server.
    """

    def __init__(self, context: foxglove.Context) -> None:
        self._frames = ch.FrameTransformsChannel("/tf", context=context)
        self._pose = ch.PoseInFrameChannel("/pose", context=context)
        self._ring = ch.LaserScanChannel("/ring", context=context)
        self._crosses = ch.SceneUpdateChannel("/cross_paths", context=context)
        self._segments = ch.SceneUpdateChannel("/segments", context=context)
        self._objects = ch.SceneUpdateChannel("/models", context=context)
        self._truth = ch.SceneUpdateChannel("/truth", context=context)
        self._log = ch.LogChannel("/log", context=context)
        self._state = foxglove.Channel("/state", schema={"type": "object"}, message_encoding="json", context=context)
        self._session: Message = {}
        self._states = 0

    def begin(self, session: Message, at: int) -> None:
        """Take in a session at a time, ns since 1970."""
        self._session = session
        self._write_truth(at)

    def take(self, state: Message, client: ConsoleClient, at: int) -> None:
        """Write a state; the map of segments is that of the client."""
        if not self._session or state["playback"] is not None:
            return
        self._write_frames(state, at)
        self._write_ranges(state, at)
        if state.get("cross_paths"):  # a run of an earlier version sends none
            rows = cross_path_rows(state["cross_paths"], self._session["ring"])
            write_cross_paths(self._crosses, rows, self._session["ring"]["half_angle"], at)
        self._state.log(orjson.dumps({name: state[name] for name in STATE_FIELDS}), log_time=at)
        if self._states % MAP_EVERY == 0:
            self._write_map(state["objects"], client.segments.values(), at)
            self._write_truth(at)  # for clients that have connected since
        self._states += 1

    def take_log(self, entry: Message, at: int) -> None:
        """Write a line of the log."""
        fields = " ".join(f"{name}={value}" for name, value in entry["fields"].items())
        write_log(self._log, entry["level"], f"{entry['event']} {fields}".strip(), at)

    def _write_frames(self, state: Message, at: int) -> None:
        x, y, theta = state["pose"]
        localized, rows = state["localized"], [("odom", "base", Pose(x, y, theta))]
        if localized is not None and localized["status"] == "tracking":
            rows.insert(0, ("map", "odom", Pose(*localized["frame"]).inverse()))
        transforms = [
            fx.FrameTransform(
                timestamp=stamp(at), parent_frame_id=parent, child_frame_id=child,
                translation=fx.Vector3(x=pose.x, y=pose.y, z=0.0), rotation=quaternion(pose.theta),
            )
            for parent, child, pose in rows
        ]  # fmt: skip
        self._frames.log(fx.FrameTransforms(transforms=transforms), log_time=at)
        self._pose.log(
            fx.PoseInFrame(timestamp=stamp(at), frame_id="odom", pose=placed(x, y, theta)), log_time=at
        )  # fmt: skip

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
            self._scan(base, 0.0, 2.0 * math.pi * (len(mounts) - 1) / len(mounts), from_centre, at)
            return
        half = ring["half_angle"]
        for sensor in fired:
            turned = Pose(*state["pose"]) if sensor in ring["turning"] else base
            self._scan(turned.compose(Pose(*mounts[sensor])), -half, half, [ranges[sensor]] * ARC_POINTS, at)

    def _scan(self, eye: Pose, start: float, end: float, ranges: list[float], at: int) -> None:
        message = fx.LaserScan(
            timestamp=stamp(at), frame_id="odom", pose=placed(eye.x, eye.y, eye.theta), start_angle=start,
            end_angle=end, ranges=ranges,
        )  # fmt: skip
        self._ring.log(message, log_time=at)

    def _write_map(self, objects: list[Message], segments: Iterable[list[float]], at: int) -> None:
        ends = [point for row in segments for point in (row[:2], row[2:4])]
        write_segments(self._segments, ends, at)
        models = {model["name"]: model for model in self._session["models"]}
        outlines = [outline(seen, models.get(seen["model"])) for seen in objects]
        lines = [line(points, MODEL, closed=closed) for points, closed in outlines]
        texts = [
            fx.TextPrimitive(
                pose=placed(seen["x"], seen["y"], 0.0, HEIGHT_M), billboard=True, font_size=0.15, color=colour(MODEL),
                text=f"{seen['number']} {seen['model']} {seen['score']:.2f}",
            )
            for seen in objects
            if seen["ends"] is None
        ]  # fmt: skip
        scene(self._objects, "models", lines, texts, at)

    def _write_truth(self, at: int) -> None:
        """Write the true world of an emulated robot, or the known room, in odometry's frame."""
        truth = self._session["truth"]
        if truth is None:
            return
        loops = [circle(*drum) for drum in truth["drums"]] + truth["polygons"]
        walls = [[(x1, y1), (x2, y2)] for x1, y1, x2, y2 in truth["walls"]]
        lines = [line(points, TRUTH, closed=True) for points in loops] + [
            line(points, TRUTH, closed=False) for points in walls
        ]
        scene(self._truth, "truth", lines, [], at)


def cross_path_rows(firings: list[Message], ring: Message) -> CrossPathRows:
    """Return the cross paths of a state as an analysis has them; `t_s` is the robot's clock."""
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
