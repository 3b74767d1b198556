"""Runs the firmware's own main.py in real time; standard input and output are its USB socket."""

import gc

from board import BOARD  # first: a real board has none of it in its heap

gc.collect()
import ring.build  # noqa: F401 - while there is room to compile

gc.collect()
import robot_config

BOARD.wire(robot_config)
BOARD.run_in_real_time()

import main  # noqa: F401 - it runs on import
