"""Steer with a recorded or handwritten table of an input's readings.

    t, x, y, z, turn, buttons, lost
    0, 0, 0, 0, 0, ,
    2.5, 0.4, 0, 0, 0, dead_man,
    9, 0, 0, 0, 0, dead_man land,
    12, , , , , , unplugged

`t` is the run's time in seconds; each row holds until the next, the last one to the end. The
columns between `t` and `buttons` are the axes, each -1 to 1 (`nan` simulates a broken device);
`steer` needs `x` forward, `y` left, `z` up and `turn` counterclockwise. `buttons` are the names of
held buttons; a button emits an event when it is pressed. A text in `lost` is the reason why the
input is silent from then on.

`kybflow record-input` records such a file from a device, and every run saves one for each input in
its folder. The file must be in the mission's folder or below.
"""

from __future__ import annotations

from functools import cache

from kybflow.core.files import File
from kybflow.core.signals import InputReading, Time
from kybflow.inputs.rows import InputRow, InputRows, parse
from kybflow.parts import Input, InputLink, param, params
from kybflow.parts.input import SticksOf


@cache
def read_rows(file: File) -> InputRows:
    """Return the rows of a table. Raises FileError."""
    return parse(file.text)


@params
class ScriptParams:
    file: File = param("Table of readings.", read_only=True, reads=read_rows)


class Script(Input[ScriptParams]):
    stuck_after = None

    @classmethod
    def real_time(cls, params: ScriptParams) -> bool:
        return False

    @classmethod
    def axes(cls, params: ScriptParams) -> tuple[str, ...]:
        return read_rows(params.file).axes

    @classmethod
    def buttons(cls, params: ScriptParams) -> tuple[str, ...]:
        return read_rows(params.file).buttons

    @classmethod
    def open(cls, params: ScriptParams, sticks_of: SticksOf) -> InputLink:
        return RowsLink(read_rows(params.file).rows)


class RowsLink(InputLink):
    """Delivers the rows of a table at their times in the run."""

    def __init__(self, rows: tuple[InputRow, ...]) -> None:
        self._rows, self._next = rows, 0

    def read(self, now: Time) -> InputReading | None:
        held: frozenset[str] = frozenset()
        while self._next < len(self._rows) and self._rows[self._next].time <= now:
            held |= self._rows[self._next].held
            self._next += 1
        if self._next == 0 or self.trouble() is not None:
            return None
        row = self._rows[self._next - 1]
        return InputReading(now, row.axes, held | row.held)

    def trouble(self) -> str | None:
        return self._rows[self._next - 1].lost or None if self._next else None

    def close(self) -> None:
        """There is nothing to release."""
