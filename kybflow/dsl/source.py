"""Where a piece of text stands: spans that survive import, `like` and parameters."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Span:
    """A piece of a file. Lines and columns count from 1; `end` is just behind the last character.

    `via` says how the file was reached: the spans of the imports, outermost first.
    """

    file: str
    line: int
    column: int
    end_line: int
    end_column: int
    via: tuple[Span, ...] = ()

    @property
    def at(self) -> str:
        """`file:line`, as events and plans carry it."""
        return f"{self.file}:{self.line}"


@dataclass(frozen=True, slots=True)
class Text:
    """A scalar as written, and where. `verbatim` is true when column arithmetic inside it holds
    (plain, one line)."""

    text: str
    span: Span
    verbatim: bool = True

    def part(self, start: int, end: int) -> Span:
        """The span of the characters `start` to `end` of the text; the whole span where that can't
        be told."""
        if not self.verbatim or self.span.line != self.span.end_line:
            return self.span
        s = self.span
        column = s.column
        return Span(s.file, s.line, column + start, s.line, column + max(end, start + 1), s.via)
