"""Runs the robot from power-on; the board starts this file by itself."""

import sys

import machine
import robot_config
from ring.robot import ConsoleRequested


def run() -> None:
    """Run until the host asks for the console; after any error stop the motors and start anew."""
    from ring.build import build

    robot = build(robot_config)
    del build, sys.modules["ring.build"]  # it has done its work, and memory is scarce
    watchdog = machine.WDT(timeout=2000) if robot_config.WATCHDOG else None
    try:
        while True:
            robot.poll()
            if watchdog is not None:
                watchdog.feed()
            machine.idle()
    except ConsoleRequested:
        robot.line.release()
    except Exception:  # noqa: BLE001 - whatever it is, a robot must not stay as it is
        robot.base.halt()
        machine.reset()
    finally:
        robot.base.timer.deinit()
        robot.base.halt()


run()
