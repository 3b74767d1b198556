"""The node: publishers, subscriptions, services and parameters of the bridge. The only module of it that needs ROS.

rclpy runs in a thread of its own; whatever it receives is passed on by the functions of `Commands`. Messages are made
from plain data, see `runtime.analysis.export.ros_messages`.
"""

from __future__ import annotations

import contextlib
import math
import threading
from collections.abc import Awaitable, Callable, Sequence
from types import MappingProxyType
from typing import Any, Final, Protocol

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Point, PoseStamped, PoseWithCovarianceStamped, Twist, TwistStamped
from nav_msgs.msg import OccupancyGrid, Odometry
from rclpy.context import Context
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from sensor_msgs.msg import LaserScan, Range
from std_msgs.msg import String
from std_srvs.srv import Trigger
from visualization_msgs.msg import Marker, MarkerArray

from drivers import ros_tf
from runtime.analysis.export.ros_messages import DEPTHS, FRAMES_DEPTH, QOS, Frames, Output, Qos

PROFILES: Final = MappingProxyType(
    {
        Qos.SENSOR_DATA: QoSProfile(depth=DEPTHS[Qos.SENSOR_DATA], reliability=ReliabilityPolicy.BEST_EFFORT),
        Qos.RELIABLE: QoSProfile(depth=DEPTHS[Qos.RELIABLE]),
        Qos.LATCHED: QoSProfile(depth=DEPTHS[Qos.LATCHED], durability=DurabilityPolicy.TRANSIENT_LOCAL),
    }
)
NEWEST: Final = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
"""For velocities: it matches every publisher, and a late one is worth nothing."""
FRAMES: Final = QoSProfile(depth=FRAMES_DEPTH)
TYPES: Final = MappingProxyType(
    {
        "sensor_msgs/Range": Range,
        "sensor_msgs/LaserScan": LaserScan,
        "nav_msgs/Odometry": Odometry,
        "nav_msgs/OccupancyGrid": OccupancyGrid,
        "geometry_msgs/PoseWithCovarianceStamped": PoseWithCovarianceStamped,
        "visualization_msgs/MarkerArray": MarkerArray,
        "diagnostic_msgs/DiagnosticArray": DiagnosticArray,
        "std_msgs/String": String,
    }
)
GRAPH_S: Final = 1.0
"""How often other nodes are looked at."""
ELEMENTS: Final = MappingProxyType(
    {"markers": Marker, "points": Point, "status": DiagnosticStatus, "values": KeyValue}
)
"""Classes of the elements of lists, by the name of the list."""


class Commands(Protocol):
    """What ROS asks for; called in the thread of ROS."""

    def velocity(self, v: float, w: float) -> None:
        """Drive at a velocity, m/s and rad/s, that has just arrived."""

    def trigger(self, name: str, done: Callable[[bool, str], None]) -> None:
        """Carry out arm, disarm or halt, then call `done` with whether it was, and why not."""

    def goal(self, x: float, y: float, heading_rad: float | None, frame: str) -> None:
        """Drive to a place in the frame `odom` or `map`."""

    def place(self, x: float, y: float, theta: float) -> None:
        """Say where the robot is in the map."""


class BridgeNode:
    """The node of one run.

    Arguments are those of ROS, as `--ros-args -r __ns:=/robot1`; commands get what ROS asks for.
    """

    def __init__(self, arguments: Sequence[str], commands: Commands) -> None:
        self._context = Context()
        rclpy.init(args=list(arguments), context=self._context, signal_handler_options=SignalHandlerOptions.NO)
        self._node = rclpy.create_node("echolocate", context=self._context)
        self._commands = commands
        self._publishers: dict[str, Any] = {}
        """By topic; each is created with the first message for it."""
        self._warned: set[str] = set()
        """Lines of `warn_once` so far."""

        names = Frames()
        values = {name: self._parameter(f"{name}_frame", getattr(names, name)) for name in ("map", "odom", "base")}
        self.frames = Frames(**values, prefix=self._parameter("frame_prefix", ""))
        self.timeout_s = float(self._parameter("cmd_vel_timeout", 0.15))
        self._age_max_s = float(self._parameter("cmd_vel_age_max", 0.5))
        both = self._switch("publish_tf", default=True)
        switches = {values["map"]: "publish_map_tf", self.frames.named(values["odom"]): "publish_odom_tf"}
        self._without = {
            parent for parent, name in switches.items() if not (self._switch(name, default=True) and both)
        }
        """Parents of the transforms that are not published."""
        self.publishes_grid = self._switch("publish_grid", default=True)
        self.max_range_for_silence = self._switch("no_echo_as_max_range", default=False)
        self.publishes_scan = self._switch("publish_scan", default=False)
        self._tf = ros_tf.create_publisher(self._node, "/tf", FRAMES)
        self._tf_static = ros_tf.create_publisher(self._node, "/tf_static", PROFILES[Qos.LATCHED])
        self._looked_s = -math.inf
        """When `look_around` looked last."""
        self._subscribe()
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._thread = threading.Thread(target=self._spin, name="ros", daemon=True)
        self._thread.start()

    def _parameter(self, name: str, default: Any) -> Any:  # noqa: ANN401 - the value of any parameter
        """Declare a parameter of the node and return its value."""
        return self._node.declare_parameter(name, default).value

    def _switch(self, name: str, *, default: bool) -> bool:
        """Declare a parameter that is true or false and return its value."""
        return bool(self._parameter(name, default))

    def _subscribe(self) -> None:
        """Create the subscriptions and services: what ROS may ask for."""
        node, reliable = self._node, PROFILES[Qos.RELIABLE]
        stamped = self._switch("cmd_vel_stamped", default=True)
        self._velocity_hint = f"start the bridge with -p cmd_vel_stamped:={str(not stamped).lower()}"
        self._subscriptions = [
            node.create_subscription(TwistStamped, "cmd_vel", self._on_stamped, NEWEST)
            if stamped
            else node.create_subscription(Twist, "cmd_vel", self._on_velocity, NEWEST),
            node.create_subscription(PoseStamped, "goal_pose", self._on_goal, reliable),
            node.create_subscription(PoseWithCovarianceStamped, "initialpose", self._on_place, reliable),
        ]
        for name in ("arm", "disarm", "halt"):
            node.create_service(Trigger, name, self._service(name))

    def now_s(self) -> float:
        """Return ROS time, s: that of this machine, or simulated time with `use_sim_time`."""
        return 1e-9 * float(self._node.get_clock().now().nanoseconds)

    def warn(self, text: str) -> None:
        """Log a line as a warning."""
        self._node.get_logger().warning(text)

    def info(self, text: str) -> None:
        """Log a line."""
        self._node.get_logger().info(text)

    def warn_once(self, text: str) -> None:
        """Log a line as a warning unless it has been logged before."""
        if text not in self._warned and len(self._warned) < 100:
            self._warned.add(text)
            self.warn(text)

    def publish(self, outputs: Sequence[Output], frames: Sequence[ros_tf.Frame]) -> None:
        """Publish the messages and frames of a state."""
        wanted = [frame for frame in frames if frame.parent not in self._without]
        if wanted:
            self._tf.publish(ros_tf.encode(wanted))
        for topic, kind, fields in outputs:
            publisher = self._publishers.get(topic)
            if publisher is None:
                publisher = self._publishers[topic] = self._create_publisher(topic, kind)
            publisher.publish(_fill(TYPES[kind](), fields))

    def publish_static(self, frames: Sequence[ros_tf.Frame]) -> None:
        """Publish the frames that do not move, for receivers now and later."""
        self._tf_static.publish(ros_tf.encode(frames))

    def look_around(self, host_s: float) -> None:
        """Warn once of a second bridge, and of a publisher whose type this node does not take; at a time, s."""
        if host_s - self._looked_s < GRAPH_S:
            return
        self._looked_s = host_s
        if self._node.count_publishers("mode") > 1:
            topic = self._node.resolve_topic_name("mode")
            self.warn_once(
                f"another bridge publishes {topic}, too: receivers get both; stop one, or give each its namespace: "
                f"--ros-args -r __ns:=/robot2"
            )
        for subscription in self._subscriptions:
            topic, own = subscription.topic_name, _name_of(subscription.msg_type)
            for other in self._node.get_publishers_info_by_topic(topic):
                if other.topic_type != own:
                    hint = self._velocity_hint if topic.endswith("cmd_vel") else f"publish {own}"
                    self.warn_once(
                        f"{topic} is not carried out: {other.node_name} publishes {other.topic_type}, and this "
                        f"bridge takes {own}; {hint}"
                    )

    def close(self) -> None:
        """End the node and its thread."""
        self._executor.shutdown(timeout_sec=1.0)
        self._node.destroy_node()
        rclpy.try_shutdown(context=self._context)
        self._thread.join(timeout=2.0)

    def _spin(self) -> None:
        with contextlib.suppress(ExternalShutdownException):  # the end of the node
            self._executor.spin()

    def _create_publisher(self, topic: str, kind: str) -> Any:  # noqa: ANN401 - a publisher of ROS
        """Return a publisher that warns once of subscribers whose QoS it does not meet."""
        qos = QOS[kind]

        def incompatible(_: object) -> None:
            where = "sonar/*" if topic.startswith("sonar/") else topic
            self.warn_once(
                f"QoS mismatch on {where}: a subscriber asks for more than is offered ({qos.value}) and gets "
                f"nothing; give it the QoS of {'sensor data' if qos is Qos.SENSOR_DATA else 'the system default'}"
            )

        events = PublisherEventCallbacks(incompatible_qos=incompatible, use_default_callbacks=False)
        return self._node.create_publisher(TYPES[kind], topic, PROFILES[qos], event_callbacks=events)

    def _on_stamped(self, message: Any) -> None:  # noqa: ANN401 - a message of ROS
        """Pass on a velocity, unless it is in another frame than the base, or too old."""
        frame, stamp = message.header.frame_id.lstrip("/"), message.header.stamp
        base = self.frames.prefix + self.frames.base
        if frame not in {"", base}:
            self.warn_once(f"bad frame: cmd_vel is in {frame!a} and not carried out; give it in {base!a}")
            return
        stamp_s = stamp.sec + 1e-9 * stamp.nanosec
        late_s = self.now_s() - stamp_s
        if stamp_s > 0.0 and abs(late_s) > self._age_max_s:
            self.warn_once(
                f"cmd_vel is stamped {'more than' if late_s > 0.0 else 'later than now by'} {self._age_max_s:g} s "
                f"{'ago ' if late_s > 0.0 else ''}and not carried out; synchronise the clocks of both machines, or "
                f"leave the stamp zero"
            )
            return
        self._on_velocity(message.twist)

    def _on_velocity(self, twist: Any) -> None:  # noqa: ANN401 - a message of ROS
        """Pass on a velocity, unless it is not finite. Called in the thread of ROS, as are all of these."""
        v, w = twist.linear.x, twist.angular.z
        if not (math.isfinite(v) and math.isfinite(w)):
            self.warn_once("cmd_vel holds a number that is not finite and is not carried out; its sender is faulty")
            return
        self._commands.velocity(v, w)

    def _on_goal(self, message: Any) -> None:  # noqa: ANN401 - a message of ROS
        frame = self._frame_of(message.header.frame_id, "goal_pose")
        if frame is not None:
            where = message.pose.position
            self._commands.goal(where.x, where.y, yaw_of(message.pose.orientation), frame)

    def _on_place(self, message: Any) -> None:  # noqa: ANN401 - a message of ROS
        if self._frame_of(message.header.frame_id, "initialpose") == "map":
            where = message.pose.pose.position
            self._commands.place(where.x, where.y, yaw_of(message.pose.pose.orientation) or 0.0)

    def _frame_of(self, name: str, topic: str) -> str | None:
        """Return `map` or `odom` for the name of a frame; None, and a line in the log, for any other."""
        known = {self.frames.map: "map", self.frames.prefix + self.frames.odom: "odom"}
        frame = known.get(name.lstrip("/"))
        if frame is None:
            self.warn_once(f"bad frame: {topic} is in {name!a} and not carried out; give it in {' or '.join(known)}")
        return frame

    def _service(self, name: str) -> Callable[[Any, Any], Awaitable[Any]]:
        """Return the handler of a service: it waits for the answer without holding up the thread of ROS."""

        async def answer(_request: object, response: Any) -> Any:  # noqa: ANN401 - messages of ROS
            future = Future(executor=self._executor)

            def done(*result: object) -> None:
                future.set_result(result)
                self._executor.wake()  # else it goes on with the next message only

            self._commands.trigger(name, done)
            response.success, response.message = await future
            return response

        return answer


def yaw_of(q: Any) -> float | None:  # noqa: ANN401 - a message of ROS
    """Return the direction of a quaternion in the plane, rad; None if it is none, as all zeros for no direction."""
    if abs(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w - 1.0) > 0.01:
        return None
    return math.atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z))


def _name_of(kind: Any) -> str:  # noqa: ANN401 - a class of ROS
    """Return the name of a type of message, as `geometry_msgs/msg/Twist`."""
    return f"{kind.__module__.partition('.')[0]}/msg/{kind.__name__}"


def _fill(message: Any, fields: dict[str, Any]) -> Any:  # noqa: ANN401 - any message of ROS
    """Set the fields of a message, and of those within it; return it."""
    for name, value in fields.items():
        if type(value) is dict:
            _fill(getattr(message, name), value)
        elif type(value) is list and (element := ELEMENTS.get(name)) is not None:
            setattr(message, name, [_fill(element(), one) for one in value])
        else:
            setattr(message, name, value)
    return message
