"""Runs the firmware in virtual time, driven by lines on standard input.

`A MICROSECONDS HEX` gives the robot bytes and runs it up to a time; the answer is what it sent, as HEX.
`S SENSOR STATE`, `W SENSOR WIDTH`, `U WIDTH…`, `B WHEEL BLOCKED`, `P PIN LEVEL` and `V READING` change the world.
`D PIN` answers the duty of a pin, `H` the free bytes after a collection, `F SENSOR` how often it fired, `M` the ways
of both wheels, mm.
"""

import gc
import sys
from binascii import hexlify, unhexlify

from board import BOARD  # first: a real board has none of it in its heap

gc.collect()
from ring.build import build

gc.collect()
import machine
import robot_config

BOARD.now = getattr(robot_config, "START_US", 0)
BOARD.wire(robot_config)
START_US = BOARD.now
ROBOT = build(robot_config)
del build, sys.modules["ring.build"]  # as main.py does


def advance(until_us: int) -> None:
    while BOARD.now < until_us:
        ROBOT.poll()
        machine.idle()


def answer(kind: str, words):
    if kind == "A":
        if len(words) > 1:
            machine.UART.received.extend(unhexlify(words[1]))
        advance(START_US + int(words[0]))
        sent = hexlify(machine.UART.sent)
        machine.UART.sent = bytearray()
        return sent.decode()
    if kind == "H":
        gc.collect()
        return gc.mem_free()
    if kind == "M":
        return BOARD.wheels[0].way_mm, BOARD.wheels[1].way_mm
    if kind == "U":
        BOARD.widths = [int(word) for word in words]
        return ""
    first = int(words[0])
    if kind == "D":
        return BOARD.duties.get(first, -1)
    if kind == "F":
        return BOARD.fired[first]
    if kind == "V":
        machine.ADC.reading = first
    elif kind == "S":
        BOARD.states[first] = int(words[1])
    elif kind == "W":
        BOARD.widths[first] = int(words[1])
    elif kind == "B":
        BOARD.wheels[first].blocked = bool(int(words[1]))
    else:
        BOARD.set_input(first, int(words[1]))
    return ""


sys.stdout.write("ready\n")
while True:
    line = sys.stdin.readline()
    if not line:
        break
    sys.stdout.write(str(answer(line[0], line[2:].split())) + "\n")
