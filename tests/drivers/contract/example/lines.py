"""The Chirp's wire format: lines of words, each line with a checksum."""

from __future__ import annotations

import binascii

LINE_MAX = 400
"""Longest line, bytes; a longer one is noise."""


def line(*words: object) -> bytes:
    """Return a line with its checksum."""
    text = " ".join(map(str, words)).encode()
    return b"%b *%04X\n" % (text, binascii.crc_hqx(text, 0xFFFF))


class LineReader:
    """Takes bytes in any pieces and returns whole lines as words; never raises, keeps at most one line.

    Attributes
    ----------
    good, bad
        Lines with a right and with a wrong checksum.
    """

    def __init__(self) -> None:
        self.good = self.bad = 0
        self._rest = b""
        self._is_first = True

    def feed(self, data: bytes) -> list[list[str]]:
        """Return the lines that `data` completes."""
        *ended, self._rest = (self._rest + data).split(b"\n")
        if len(self._rest) > LINE_MAX:
            self._rest = self._rest[-1:]
        found = [words for raw in ended if (words := self._words(raw)) is not None]
        if ended:
            self._is_first = False  # what came before the first end may be the rest of a line
        return found

    def _words(self, raw: bytes) -> list[str] | None:
        text, _, check = raw.rpartition(b" *")
        if check == b"%04X" % binascii.crc_hqx(text, 0xFFFF):
            self.good += 1
            return text.decode("ascii", "replace").split()
        self.bad += not self._is_first
        self._is_first = False
        return None
