"""Firmware of a ring that anybody can build: the board's files (`board/`, MicroPython), and how to get them."""
