"""Decodes the bytes of a terminal into pressed keys."""

from __future__ import annotations

import re

ENTER, ESCAPE = "enter", "escape"
_PASTE, _PASTED = "\x1b[200~", "\x1b[201~"
_UNIT = re.compile(
    r"\x1b\[[0-?]*[ -/]*[@-~]|\x1bO[^\x1b]|\x1b[^\[O\x1b]|\x1b(?=\x1b)|[^\x1b]", re.DOTALL
)
"""One of: a named key such as an arrow, a key pressed with Alt, an escape before another escape, or
a letter."""
_NAMED = {"\r": ENTER, "\n": ENTER, "\x1b": ESCAPE}


class PressedKeys:
    """Decodes the bytes of a terminal. Arrows, function keys and pasted text are ignored, so that
    pasting sends no command."""

    def __init__(self) -> None:
        self._rest = ""
        self._pastes = False

    def read(self, data: bytes) -> list[str]:
        """Return the keys in `data`: printable letters, ENTER and ESCAPE. Empty data ends a pending
        escape sequence."""
        text = self._rest + data.decode("utf-8", errors="ignore")
        keys: list[str] = []
        end = 0
        while unit := _UNIT.match(text, end):
            end = unit.end()
            self._take(unit.group(), keys)
        self._rest = text[end:] if data else ""
        if text[end:] == "\x1b" and not data:
            self._take("\x1b", keys)
        return keys

    def _take(self, unit: str, keys: list[str]) -> None:
        if unit in (_PASTE, _PASTED):
            self._pastes = unit == _PASTE
        elif not self._pastes and (key := _NAMED.get(unit, unit)).isprintable():
            keys.append(key)
