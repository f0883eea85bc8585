"""Spans: where a piece of text was written, kept through imports, `like` and parameters."""

from __future__ import annotations

from typing import NamedTuple

PREFIX = "world.points."
"""What stands before the name of a point of the world."""
SET = "--set"
"""The name of the file that spans of settings point into; each setting is one of its lines."""


class Span(NamedTuple):
    """A piece of a file. Lines and columns count from 1; `end` is just behind the last character.

    `via` says how the file was reached: the spans of the imports, outermost first; `used` how the
    chain was that the text stands in: the spans of the uses, outermost first; `given` where the
    value was written that took the place of a `$name` there, `is_set` whether in a file: not as
    the default, nor by `--set`. Neither counts when spans are compared.
    """

    file: str
    line: int
    column: int
    end_line: int
    end_column: int
    via: tuple[Span, ...] = ()
    used: tuple[Span, ...] = ()
    given: Span | None = None
    is_set: bool = False

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Span) and self[:_COMPARED] == other[:_COMPARED]

    def __ne__(self, other: object) -> bool:
        return not self == other

    def __hash__(self) -> int:
        return hash(self[:_COMPARED])

    @property
    def value(self) -> Span | None:
        """Where a user wrote the value that stands here for a `$name` of a chain or of a library;
        None where the text here says it."""
        given = self.given
        if given is None or not self.is_set or (given.file == self.file and not self.used):
            return None
        return given

    @property
    def at(self) -> str:
        """`file:line`, as events and plans carry it."""
        return f"{self.file}:{self.line}"

    def is_in(self, around: Span) -> bool:
        """Whether all of it lies in `around`."""
        begins = (around.line, around.column) <= (self.line, self.column)
        ends = (self.end_line, self.end_column) <= (around.end_line, around.end_column)
        return self.file == around.file and begins and ends

    def beside(self, other: Span) -> str:
        """Where it is, for a report about `other`: its line, and its file where that differs."""
        return f"line {self.line}" if self.file == other.file else self.at


_COMPARED = Span._fields.index("given")


class Inset(NamedTuple):
    """A value in the place of a parameter: the characters `start` to `end` of the text stand for
    `written_start` to `written_end` of what was written, and are `given` there."""

    start: int
    end: int
    written_start: int
    written_end: int
    given: Span | None = None


class Text(NamedTuple):
    """A scalar, and where. `verbatim` is true when column arithmetic inside it holds (plain, one
    line). `written` is what the author wrote where parameters stood in it, `insets` their values.
    """

    text: str
    span: Span
    verbatim: bool = True
    written: str = ""
    insets: tuple[Inset, ...] = ()

    @property
    def as_written(self) -> str:
        """The text as its author wrote it, `$name` and all."""
        return self.written or self.text

    def part(self, start: int, end: int) -> Span:
        """The span of the characters `start` to `end` of the text; the whole span where that can't
        be told."""
        if not self.verbatim or self.span.line != self.span.end_line:
            return self.span
        s = self.span
        first = self._written_at(start)
        last = max(self._written_at(end, is_end=True), first + 1)
        inside = (i.given for i in self.insets if i.start < end and start < i.end)
        place = Span(s.file, s.line, s.column + first, s.line, s.column + last, s.via, s.used)
        return place._replace(given=next(inside, None)) if self.insets else place

    def _written_at(self, position: int, is_end: bool = False) -> int:
        """Where the character at `position` of the text stands in what was written."""
        shift = 0
        for inset in self.insets:
            if is_end and inset.start < position <= inset.end:
                return inset.written_end
            if not is_end and inset.start <= position < inset.end:
                return inset.written_start
            if position <= inset.start:
                break
            shift = inset.written_end - inset.end
        return position + shift
