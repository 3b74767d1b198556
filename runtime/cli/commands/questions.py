"""Questions of the command line: options first, then a person's answers, otherwise the defaults."""

from __future__ import annotations

import sys
from collections.abc import Callable, Collection, Mapping
from typing import Any, TypeVar

from config.errors import WRONG_CALL, UserError
from config.files import one_line

Given = Mapping[str, Any]
T = TypeVar("T")


class Questions:
    """Asks for what no option gives, where a person can answer; otherwise takes the defaults.

    Parameters
    ----------
    given : mapping
        The options; None for one that was not given.
    asks : bool
        Whether to ask.
    """

    def __init__(self, given: Given, *, asks: bool) -> None:
        self._given = given
        self.asks = asks
        """Whether a person is asked."""
        self._answers: dict[str, Any] = {}
        self._asked = 0
        self._used: set[str] = set()

    def text(self, name: str, question: str, default: str) -> str:
        """Return a text."""
        return self._answer(name, question, default, str)

    def number(self, name: str, question: str, default: float, low: float, high: float) -> float:
        """Return a number from `low` to `high`; another answer is asked for again, another option refused.

        A default outside of them is the nearest one inside.
        """

        def parse(answer: str) -> float:
            problem = f"expected a number from {low:g} to {high:g}"
            try:
                value = float(answer.replace(",", "."))
            except ValueError:
                raise ValueError(problem) from None
            if not low <= value <= high:
                raise ValueError(problem)
            return value

        return self._answer(name, question, min(max(default, low), high), parse)

    def count(self, name: str, question: str, default: int, low: int, high: int) -> int:
        """Return a whole number from `low` to `high`."""

        def parse(answer: str) -> int:
            problem = f"expected a whole number from {low} to {high}"
            try:
                value = int(answer)
            except ValueError:
                raise ValueError(problem) from None
            if not low <= value <= high:
                raise ValueError(problem)
            return value

        return self._answer(name, question, min(max(default, low), high), parse)

    def choice(self, name: str, question: str, choices: tuple[str, ...]) -> str:
        """Return one of the choices, the first by default."""

        def parse(answer: str) -> str:
            if answer not in choices:
                raise ValueError(f"expected one of {', '.join(choices)}")
            return answer

        return self._answer(name, f"{question} ({', '.join(choices)})", choices[0], parse)

    def say(self, text: str) -> None:
        """Write what the next answers mean or cost, where a person is asked."""
        if self.asks:
            sys.stderr.write(f"{text}\n")

    def is_given(self, name: str) -> bool:
        """Return whether an option is given that is a flag."""
        self._used.add(name)
        return bool(self._given.get(name))

    def refuse_unused(self, depends_on: str, to_come: Collection[str] = ()) -> None:
        """Refuse options that no question has asked for in this round, nor will: they have no effect.

        Parameters
        ----------
        depends_on : str
            The options on which it depends what is asked for.
        to_come : collection of str
            What is still to be asked for.

        Raises
        ------
        UserError
            There is such an option.
        """
        given = (name for name, value in self._given.items() if value is not None and value is not False)
        unused = [f"--{name.replace('_', '-')}" for name in given if name not in {*self._used, *to_come}]
        if unused:
            raise UserError(
                f"{', '.join(unused)}: no meaning beside the other options and answers; leave out, or choose another "
                f"{depends_on}",
                WRONG_CALL,
            )

    def again(self, refusal: str) -> None:
        """Say why the answers together are refused, and keep them as the defaults of the next round.

        Raises
        ------
        UserError
            Nothing was asked: the options alone are refused.
        """
        if not self._asked:
            raise UserError(refusal, WRONG_CALL)
        self._asked = 0
        self._used.clear()  # another answer may ask for other options
        sys.stderr.write(f"{one_line(refusal)}\nOnce more: Enter keeps an answer.\n")

    def _answer(self, name: str, question: str, default: T, parse: Callable[[str], T]) -> T:
        """Return the option `name` if it was given, else what is answered on the terminal, else the default."""
        self._used.add(name)
        given = self._given.get(name)
        if given is not None:
            try:
                return parse(str(given))
            except ValueError as error:
                raise UserError(f"--{name.replace('_', '-')} {one_line(str(given))}: {error}", WRONG_CALL) from error
        default = self._answers.get(name, default)
        while self.asks:
            self._asked += 1
            sys.stderr.write(f"{question} [{default}]: ")
            sys.stderr.flush()
            line = sys.stdin.readline()
            if not line:
                raise UserError("the questions were not answered to their end; nothing was written", WRONG_CALL)
            if not line.strip():
                break
            try:
                default = parse(line.strip())
            except ValueError as error:
                sys.stderr.write(f"  {one_line(str(error))}\n")
            else:
                self._answers[name] = default
                break
        return default
