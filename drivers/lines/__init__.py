"""Robots that speak lines of text: driver and emulated robot of any whose lines a `wire.Wire` reads and writes."""
