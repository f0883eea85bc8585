"""Spans: where a piece of text was written. They are kept through imports, `like` and
parameters."""

from __future__ import annotations

from typing import NamedTuple

PREFIX = "world.points."
"""The prefix of the name of a point of the world."""
SET = "--set"
"""The file name in the spans of settings; each setting is one line of that file."""


class Span(NamedTuple):
    """A range of text in a file. Lines and columns count from 1; the end is just after the last
    character.

    via: the spans of the imports through which the file was reached, outermost first. used: the
    spans of the uses of the chain or flow that contains the text, outermost first. given: where the
    value that replaced a `$name` at this location was written. is_set: whether a file sets that
    value, in contrast to a default or `--set`. Comparisons of spans ignore `given` and `is_set`.
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
        """Where a user wrote the value that replaced a `$name` of a chain or library here; None if
        the value is a default, or is written in this text itself."""
        given = self.given
        if given is None or not self.is_set or (given.file == self.file and not self.used):
            return None
        return given

    @property
    def at(self) -> str:
        """The location as `file:line`, for events and plans."""
        return f"{self.file}:{self.line}"

    def is_in(self, around: Span) -> bool:
        """Return whether the span lies entirely within `around`."""
        begins = (around.line, around.column) <= (self.line, self.column)
        ends = (self.end_line, self.end_column) <= (around.end_line, around.end_column)
        return self.file == around.file and begins and ends

    def beside(self, other: Span) -> str:
        """Return the location for a report about `other`: its line, with the file if that
        differs."""
        return f"line {self.line}" if self.file == other.file else self.at


_COMPARED = Span._fields.index("given")


class Inset(NamedTuple):
    """A value that replaced a parameter in a text. start, end: the characters of the value in the
    text. written_start, written_end: the characters of `$name` in the text as written. given: where
    the value was written."""

    start: int
    end: int
    written_start: int
    written_end: int
    given: Span | None = None


class Text(NamedTuple):
    """The text of a scalar, with its span. verbatim: whether the columns of characters inside it
    can be computed (the text is in one line and without escapes). written: the text as its author
    wrote it, if parameters in it were replaced. insets: the values of these parameters."""

    text: str
    span: Span
    verbatim: bool = True
    written: str = ""
    insets: tuple[Inset, ...] = ()

    @property
    def as_written(self) -> str:
        """The text as its author wrote it, with `$name` not replaced."""
        return self.written or self.text

    def part(self, start: int, end: int) -> Span:
        """Return the span of the characters `start` to `end` of the text, or the whole span if
        their columns can't be computed."""
        if not self.verbatim or self.span.line != self.span.end_line:
            return self.span
        s = self.span
        first = self._written_at(start)
        last = max(self._written_at(end, is_end=True), first + 1)
        inside = (i.given for i in self.insets if i.start < end and start < i.end)
        place = Span(s.file, s.line, s.column + first, s.line, s.column + last, s.via, s.used)
        return place._replace(given=next(inside, None)) if self.insets else place

    def _written_at(self, position: int, is_end: bool = False) -> int:
        """Return the position in the text as written of the character at `position` in the text."""
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
