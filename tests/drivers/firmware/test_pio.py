"""The program of the RP2040's state machines, run cycle by cycle by a plain interpreter of its few instructions."""

from __future__ import annotations

import ast
from collections.abc import Callable
from pathlib import Path

import pytest

import drivers.firmware

SOURCE = Path(drivers.firmware.__file__).with_name("board") / "ring" / "pio.py"
OVER = 0xFFFF_FFFF
CYCLES_PER_US = 2
INPUT_DELAY = 2
"""Cycles that the input synchroniser of a pin takes."""


def program() -> tuple[list[tuple[str, tuple[str, ...]]], dict[str, int]]:
    """Return the instructions with their arguments as text, and the places of the labels."""
    tree = ast.parse(SOURCE.read_text("utf-8"))
    (body,) = (node.body for node in tree.body if isinstance(node, ast.FunctionDef) and node.name == "_pulse")
    instructions: list[tuple[str, tuple[str, ...]]] = []
    labels: dict[str, int] = {}
    for statement in body[1:]:
        assert isinstance(statement, ast.Expr)
        call = statement.value
        assert isinstance(call, ast.Call)
        arguments = tuple(ast.unparse(argument).strip("'") for argument in call.args)
        if ast.unparse(call.func) == "label":
            labels[arguments[0]] = len(instructions)
        else:
            instructions.append((ast.unparse(call.func), arguments))
    return instructions, labels


def pushed(longest_us: int, pin_at: Callable[[int], int], cycles: int) -> list[int]:
    """Return what the program pushes within so many cycles, given the pin's level at each."""
    instructions, labels = program()
    tx, rx, at, x, osr, isr = [longest_us], list[int](), 0, 0, 0, 0
    for cycle in range(cycles):
        pin = pin_at(cycle - INPUT_DELAY)
        match instructions[at]:
            case ("pull", ("block",)):
                if not tx:
                    continue
                osr = tx.pop()
            case ("mov", ("x", "osr")):
                x = osr
            case ("mov", ("isr", "x")):
                isr = x
            case ("wait", (level, "pin", "0")):
                if pin != int(level):
                    continue
            case ("jmp", ("pin", label)):
                if pin:
                    at = labels[label]
                    continue
            case ("jmp", ("x_dec", label)):
                was, x = x, (x - 1) & OVER
                if was:
                    at = labels[label]
                    continue
            case ("jmp", (label,)):
                at = labels[label]
                continue
            case ("push", ("noblock",)):
                rx.append(isr)
                isr = 0
            case unknown:  # pragma: no cover
                raise AssertionError(unknown)
        at = (at + 1) % len(instructions)
    return rx


@pytest.mark.parametrize("width_us", [1, 2, 150, 5831, 22_999, 23_280])
def test_a_pulse_is_timed_to_a_microsecond(width_us: int) -> None:
    longest_us, rise = 23_281, 901
    fall = rise + CYCLES_PER_US * width_us
    (left,) = pushed(longest_us, lambda cycle: int(rise <= cycle < fall), fall + 50)
    assert abs(longest_us - left - width_us) <= 1


def test_a_pulse_longer_than_expected_is_over_and_none_gives_nothing() -> None:
    assert pushed(100, lambda cycle: int(cycle >= 50), 1000) == [OVER]
    assert pushed(100, lambda _cycle: 0, 1000) == []


def test_it_fits_beside_others() -> None:
    """Each of the two blocks has 32 instructions for the programs of its four machines."""
    instructions, labels = program()
    assert len(instructions) <= 10
    assert labels.keys() == {"high", "more", "low"}
