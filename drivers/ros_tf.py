"""Frames of ROS 2, `tf2_msgs/msg/TFMessage`, as bytes, and its type where ROS is installed without that package.

The packages of ROS on PyPI have every common message but this one. Its content is a list of
`geometry_msgs/TransformStamped`, which they have, so that a type that differs in its name only publishes and receives
the serialized messages. `encode` and `decode` work without ROS.

Serialized form: OMG's CDR, little endian, with the four bytes of the encapsulation before it.
"""

from __future__ import annotations

import contextlib
import ctypes
import functools
import math
import struct
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, Final, NamedTuple

HEAD: Final = b"\x00\x01\x00\x00"
"""Plain CDR, little endian."""
POINTERS: Final = 7
"""Words of the structure of callbacks of Fast DDS."""
LENGTH_MAX: Final = 10_000


class Frame(NamedTuple):
    """A frame in its parent: place (m), rotation (a unit quaternion x, y, z, w) and time (ns)."""

    stamp_ns: int
    parent: str
    child: str
    translation: tuple[float, float, float]
    rotation: tuple[float, float, float, float]


def planar(stamp_ns: int, parent: str, child: str, x: float, y: float, yaw: float) -> Frame:
    """Return a frame in the plane of its parent (m, rad)."""
    turn = (0.0, 0.0, math.sin(0.5 * yaw), math.cos(0.5 * yaw))
    return Frame(stamp_ns, parent, child, (x, y, 0.0), turn)


def encode(frames: Iterable[Frame]) -> bytes:
    """Return the serialized message of these frames."""
    rows = list(frames)
    data = bytearray(struct.pack("<I", len(rows)))
    for stamp_ns, parent, child, translation, rotation in rows:
        data += bytes(-len(data) % 4) + struct.pack("<iI", stamp_ns // 1_000_000_000, stamp_ns % 1_000_000_000)
        for name in (parent, child):
            text = name.encode() + b"\x00"
            data += bytes(-len(data) % 4) + struct.pack("<I", len(text)) + text
        data += bytes(-len(data) % 8) + struct.pack("<7d", *translation, *rotation)
    return HEAD + bytes(data)


def decode(message: bytes) -> list[Frame]:
    """Return the frames of a serialized message.

    Raises
    ------
    ValueError
        It is not such a message.
    """
    try:
        return list(_decode(message))
    except (struct.error, UnicodeDecodeError) as error:
        raise ValueError(f"not a message of frames: {error}") from error


def _decode(message: bytes) -> Iterator[Frame]:
    """Yield the frames of a serialized message.

    Raises
    ------
    ValueError, struct.error, UnicodeDecodeError
        It is malformed.
    """
    data, order = message[4:], {b"\x00\x00": ">", b"\x00\x01": "<"}.get(message[:2])
    if order is None:
        raise ValueError(f"encoding {message[:2].hex()} is not plain CDR")
    (count,) = struct.unpack_from(f"{order}I", data)
    if count > LENGTH_MAX:
        raise ValueError(f"{count} frames in one message")
    at = 4
    for _ in range(count):
        at += -at % 4
        sec, nanosec = struct.unpack_from(f"{order}iI", data, at)
        at += 8
        names = []
        for _ in range(2):
            at += -at % 4
            (length,) = struct.unpack_from(f"{order}I", data, at)
            names.append(data[at + 4 : at + 3 + length].decode())
            at += 4 + length
        parent, child = names
        at += -at % 8
        x, y, z, qx, qy, qz, qw = struct.unpack_from(f"{order}7d", data, at)
        at += 56
        yield Frame(sec * 1_000_000_000 + nanosec, parent, child, (x, y, z), (qx, qy, qz, qw))


def create_publisher(node: Any, topic: str, qos: Any) -> Any:  # noqa: ANN401 - objects of rclpy
    """Return a publisher of serialized messages of frames."""
    publisher = node.create_publisher(_message_type(), topic, qos)
    _forget_error()
    return publisher


def subscribe(node: Any, topic: str, take: Callable[[bytes], None], qos: Any) -> Any:  # noqa: ANN401 - objects of rclpy
    """Return a subscription that passes on serialized messages of frames."""
    subscription = node.create_subscription(_message_type(), topic, take, qos, raw=True)
    _forget_error()
    return subscription


@functools.cache
def _message_type() -> Any:  # noqa: ANN401 - a class of ROS
    """Return the message's class: that of ROS, or one that serves for serialized messages."""
    try:
        from tf2_msgs.msg import TFMessage
    except ImportError:
        return _renamed()
    return TFMessage


def _forget_error() -> None:
    """Remove the error that Fast DDS leaves where it finds no further description of a type; it would be reported."""
    with contextlib.suppress(OSError, AttributeError):
        maps = Path("/proc/self/maps").read_text("utf-8", "replace").split()
        loaded = next((path for path in maps if "librcutils" in path), None)
        if loaded is not None:
            ctypes.CDLL(loaded).rcutils_reset_error()


class _Support(ctypes.Structure):
    """`rosidl_message_type_support_t`."""

    _fields_ = (
        ("identifier", ctypes.c_char_p),
        ("data", ctypes.c_void_p),
        ("find", ctypes.c_void_p),
        ("hash", ctypes.c_void_p),
        ("description", ctypes.c_void_p),
        ("sources", ctypes.c_void_p),
    )


class _Callbacks(ctypes.Structure):
    """`message_type_support_callbacks_t` of Fast DDS: two names, then functions."""

    _fields_ = (
        ("namespace", ctypes.c_char_p),
        ("name", ctypes.c_char_p),
        ("functions", ctypes.c_void_p * (POINTERS - 2)),
    )


def _renamed() -> Any:  # noqa: ANN401 - a class of ROS
    """Return a type with the name of `TFMessage` and the functions of `TransformStamped`, which bytes do not need.

    Raises
    ------
    ImportError
        ROS has no support for it here.
    """
    from geometry_msgs.msg import TransformStamped

    python = ctypes.pythonapi
    python.PyCapsule_GetPointer.restype = ctypes.c_void_p
    python.PyCapsule_GetPointer.argtypes = [ctypes.py_object, ctypes.c_char_p]
    python.PyCapsule_New.restype = ctypes.py_object
    python.PyCapsule_New.argtypes = [ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p]
    like = TransformStamped
    like.__class__.__import_type_support__()
    general = _Support.from_address(python.PyCapsule_GetPointer(like._TYPE_SUPPORT, None))
    find = ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_void_p, ctypes.c_char_p)(general.find)
    found = find(ctypes.addressof(general), b"rosidl_typesupport_fastrtps_c")
    if found is None:
        raise ImportError("tf2_msgs is not installed, and ROS runs without Fast DDS: install ros-…-tf2-msgs")
    support = _Support.from_buffer_copy(_Support.from_address(found))
    callbacks = _Callbacks.from_buffer_copy(_Callbacks.from_address(support.data))
    callbacks.namespace, callbacks.name = b"tf2_msgs::msg", b"TFMessage"
    support.data = ctypes.addressof(callbacks)
    members = {name: getattr(like, name) for name in dir(like.__class__) if name.startswith(("_CONVERT", "_CREATE"))}
    members |= {
        "_DESTROY_ROS_MESSAGE": like._DESTROY_ROS_MESSAGE,
        "_TYPE_SUPPORT": python.PyCapsule_New(ctypes.addressof(support), None, None),
        "_kept": (support, callbacks),  # the capsule does not keep them
    }
    return type("TFMessageType", (type,), members)("TFMessage", (), {})  # rclpy looks at the class of the class
