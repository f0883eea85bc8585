"""Findings as workflow commands of GitHub Actions, which shows each beside its line.

In the text `%`, CR and LF are escaped as `%25`, `%0D` and `%0A`, in a property also `:` and `,` as
`%3A` and `%2C` (GitHub's own toolkit does so).
"""

from __future__ import annotations

from collections.abc import Iterator

from kybflow.dsl.diagnostics.diagnostic import Diagnostic
from kybflow.dsl.diagnostics.placed import primary, ways_to
from kybflow.dsl.diagnostics.render import printable
from kybflow.dsl.diagnostics.sarif import message_of
from kybflow.dsl.reading.source import Span

_TEXT = str.maketrans({"%": "%25", "\r": "%0D", "\n": "%0A"})
_PROPERTY = str.maketrans({"%": "%25", "\r": "%0D", "\n": "%0A", ":": "%3A", ",": "%2C"})


def to_annotation(diagnostic: Diagnostic) -> str:
    """The workflow command of one finding, a line."""
    span = primary(diagnostic.span)
    properties = {"file": printable(span.file), "line": span.line, "endLine": span.end_line}
    if span.line == span.end_line:  # columns of several lines are refused
        properties |= {"col": span.column, "endColumn": span.end_column}
    properties["title"] = f"kybflow {diagnostic.code}"
    told = ",".join(f"{key}={str(v).translate(_PROPERTY)}" for key, v in properties.items())
    text = "\n".join((message_of(diagnostic), *_places(diagnostic.span, span)))
    return f"::{diagnostic.severity.value} {told}::{text.translate(_TEXT)}"


def _places(span: Span, shown: Span) -> Iterator[str]:
    """Where it is when it is `shown` elsewhere, and how that was reached."""
    if shown is not span:
        yield printable(f"in {span.at}:{span.column}")
    yield from map(printable, ways_to(span))
