"""Runs the firmware's own main.py in real time; standard input and output are its USB socket."""

import gc

import ring.build  # noqa: F401 - first, while there is room to compile

gc.collect()
import robot_config
from board import BOARD

BOARD.wire(robot_config)
BOARD.run_in_real_time()

import main  # noqa: F401 - it runs on import
