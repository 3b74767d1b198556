"""The line to the process that holds ROS: a pair of sockets, one of which the process inherits."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import threading
from typing import Final

from config.robot import RobotConfig
from drivers.serial_port import GatewayError
from drivers.tcp_port import TcpPort

MODULE: Final = "drivers.ros2.gateway"
READY: Final = b"ready\n"
"""What the process sends first; otherwise a line that says why it ends."""
_ANSWER_MAX_S: Final = 25.0
_LINE_MAX: Final = 2_000
_BUFFER_BYTES: Final = 16_384


class GatewayPort(TcpPort):
    """An open line; opening blocks until ROS has found the robot's odometry.

    Raises
    ------
    GatewayError
        ROS is not installed, or the robot's topics are not there.
    """

    def __init__(self, config: RobotConfig) -> None:
        self.timeout = self.write_timeout = self.baudrate = 0
        self._socket, other = socket.socketpair()
        for end in (self._socket, other):
            end.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _BUFFER_BYTES)
        text = config.model_dump_json(include=set(RobotConfig.model_fields))
        paths = os.pathsep.join(path for path in sys.path if path)
        with other:
            process = subprocess.Popen(  # noqa: S603 - this program
                [sys.executable, "-P", "-m", MODULE, str(other.fileno()), text],
                pass_fds=[other.fileno()],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                env={**os.environ, "PYTHONPATH": paths},
                start_new_session=True,
            )
        threading.Thread(target=process.wait, name="end of the ROS process", daemon=True).start()
        try:
            self._await_ready()
        except BaseException:
            self._socket.close()  # the process ends with it
            raise
        self._socket.settimeout(0.0)

    def _await_ready(self) -> None:
        """Wait until the process says that the robot is there.

        Raises
        ------
        GatewayError
            It says why not, or nothing.
        """
        self._socket.settimeout(_ANSWER_MAX_S)
        line = b""
        try:
            while not line.endswith(b"\n") and len(line) < _LINE_MAX and (byte := self._socket.recv(1)):
                line += byte
        except TimeoutError:
            line = b"the process with ROS 2 does not answer; look at its messages on the terminal"
        if line != READY:
            text = line.decode("utf-8", "replace").strip()
            raise GatewayError(text or "the process with ROS 2 ended at its start; look at its messages")
