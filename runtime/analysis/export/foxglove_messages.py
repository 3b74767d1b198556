"""A run as Foxglove's messages, for a file and for a live server: topics, frames and drawings.

`echolocate export --to foxglove` writes them to a file, the live bridge to the clients of a server. Frames: `map`
(while the robot knows its place in one) → `odom` → `base`, which turns with the wheels. Echoes are in `odom`, from
the pose that the ring had at their firing; so is the true world, where the odometry began. All times `at` are
nanoseconds since 1970.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Final

import foxglove
from foxglove import channels as ch
from foxglove import messages as fx

from drivers.messages import Pose
from runtime.analysis.export.shapes import CROSS, HEIGHT_M, MODEL, SEGMENT, TRUTH, Colour, yaw_quaternion
from runtime.analysis.plots.cross_arcs import cross_arcs, heard_cross_paths
from runtime.analysis.timeline import CrossPathRows

ARC_POINTS: Final = 9
LINE_PX: Final = 2.0
POLYLINE_PX: Final = 1.0
FONT_M: Final = 0.15

Places = Iterable[Iterable[float]]
Outline = tuple[Places, bool]
"""Points of a line, m, and whether it is closed."""
Label = tuple[float, float, str]
"""A place, m, and a text."""


class RunChannels:
    """The channels that every run has.

    The context is that of the file or of the server.
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

    def write_frames(self, frames: Iterable[tuple[str, str, Pose]], at: int) -> None:
        """Write frames: the parent's name, the child's, and the child's pose in the parent."""
        transforms = [
            fx.FrameTransform(
                timestamp=stamp(at),
                parent_frame_id=parent,
                child_frame_id=child,
                translation=fx.Vector3(x=pose.x, y=pose.y, z=0.0),
                rotation=_quaternion(pose.theta),
            )
            for parent, child, pose in frames
        ]
        self._frames.log(fx.FrameTransforms(transforms=transforms), log_time=at)

    def write_pose(self, pose: Pose, at: int) -> None:
        """Write the robot's pose."""
        message = fx.PoseInFrame(timestamp=stamp(at), frame_id="odom", pose=foxglove_pose(pose.x, pose.y, pose.theta))
        self._pose.log(message, log_time=at)

    def write_ring(self, ring: Pose, ranges_m: Sequence[float], at: int) -> None:
        """Write a firing of an even ring as one scan; the ranges are those from its centre, a sensor each."""
        self._write_scan(ring, 0.0, 2.0 * math.pi * (len(ranges_m) - 1) / len(ranges_m), ranges_m, at)

    def write_arc(self, sensor: Pose, half_angle: float, range_m: float, at: int) -> None:
        """Write the firing of one sensor as an arc across its beam; `half_angle` in rad."""
        self._write_scan(sensor, -half_angle, half_angle, [range_m] * ARC_POINTS, at)

    def _write_scan(self, eye: Pose, start: float, end: float, ranges_m: Sequence[float], at: int) -> None:
        """Write ranges (m) at even angles from `start` to `end`, rad from the direction of `eye`."""
        message = fx.LaserScan(
            timestamp=stamp(at),
            frame_id="odom",
            pose=foxglove_pose(eye.x, eye.y, eye.theta),
            start_angle=start,
            end_angle=end,
            ranges=list(ranges_m),
        )
        self._ring.log(message, log_time=at)

    def write_cross_paths(self, rows: CrossPathRows, half_angle: float, at: int) -> None:
        """Replace the arcs of cross paths; `half_angle` is that of a beam, rad."""
        arcs = cross_arcs(heard_cross_paths(rows), half_angle).tolist()
        scene(self._crosses, "cross_paths", [line(points, CROSS, closed=False) for points in arcs], [], at)

    def write_segments(self, ends: Sequence[Sequence[float]], at: int) -> None:
        """Replace the outline segments: points x, y (m), two a segment."""
        many = fx.LinePrimitive(
            type=fx.LinePrimitiveLineType.LineList,
            thickness=LINE_PX,
            scale_invariant=True,
            points=[fx.Point3(x=x, y=y) for x, y in ends],
            color=_colour(SEGMENT),
        )
        scene(self._segments, "segments", [many] if ends else [], [], at)

    def write_objects(
        self, outlines: Iterable[Outline], polylines: Iterable[Places], labels: Iterable[Label], at: int
    ) -> None:
        """Replace what was recognised: outlines of objects, polylines, and what is written beside the objects."""
        lines = [line(points, MODEL, closed=closed) for points, closed in outlines]
        lines += [line(points, MODEL, closed=False, thickness_px=POLYLINE_PX) for points in polylines]
        texts = [
            fx.TextPrimitive(
                pose=foxglove_pose(x, y, 0.0, HEIGHT_M),
                billboard=True,
                font_size=FONT_M,
                color=_colour(MODEL),
                text=text,
            )
            for x, y, text in labels
        ]
        scene(self._objects, "models", lines, texts, at)

    def write_truth(self, loops: Iterable[Places], lines: Iterable[Places], at: int) -> None:
        """Write the true world: what is closed, and what is not."""
        drawn = [line(points, TRUTH, closed=True) for points in loops]
        drawn += [line(points, TRUTH, closed=False) for points in lines]
        scene(self._truth, "truth", drawn, [], at)

    def write_log(self, level: str, text: str, at: int) -> None:
        """Write a line of the log."""
        levels = {"debug": fx.LogLevel.Debug, "warning": fx.LogLevel.Warning, "error": fx.LogLevel.Error}
        level_of = levels.get(level, fx.LogLevel.Info)
        self._log.log(fx.Log(timestamp=stamp(at), level=level_of, message=text, name="echolocate"), log_time=at)


def object_label(number: int | None, model: str, score: float) -> str:
    """Return what is written beside an object."""
    return f"{number} {model} {score:.2f}"


def scene(
    channel: ch.SceneUpdateChannel,
    name: str,
    lines: list[fx.LinePrimitive],
    texts: list[fx.TextPrimitive],
    at: int,
) -> None:
    """Replace an entity as a whole, so that elements that are gone disappear.

    The entity has this name as its id, and lines and texts in the frame `odom`; `at` is in nanoseconds since 1970.
    """
    entity = fx.SceneEntity(timestamp=stamp(at), frame_id="odom", id=name, lines=lines, texts=texts)
    channel.log(fx.SceneUpdate(entities=[entity]), log_time=at)


def line(points: Places, rgb: Colour, *, closed: bool, thickness_px: float = LINE_PX) -> fx.LinePrimitive:
    """Return a line through points (m), or the loop that they close."""
    kind = fx.LinePrimitiveLineType.LineLoop if closed else fx.LinePrimitiveLineType.LineStrip
    places = [fx.Point3(x=x, y=y) for x, y in points]
    return fx.LinePrimitive(
        type=kind, thickness=thickness_px, scale_invariant=True, points=places, color=_colour(rgb)
    )


def stamp(at: int) -> fx.Timestamp:
    """Return a time, ns since 1970."""
    return fx.Timestamp(sec=at // 1_000_000_000, nsec=at % 1_000_000_000)


def foxglove_pose(x: float, y: float, yaw: float, z: float = 0.0) -> fx.Pose:
    """Return a pose from place (m) and direction (rad)."""
    return fx.Pose(position=fx.Vector3(x=x, y=y, z=z), orientation=_quaternion(yaw))


def _quaternion(yaw: float) -> fx.Quaternion:
    x, y, z, w = yaw_quaternion(yaw)
    return fx.Quaternion(x=x, y=y, z=z, w=w)


def _colour(rgb: Colour) -> fx.Color:
    return fx.Color(r=rgb[0], g=rgb[1], b=rgb[2], a=1.0)
