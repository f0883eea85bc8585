"""Where a finding is shown that is inside of an installed library: a review shows only files of the
folder under review, so it stands at the place there that leads to it."""

from __future__ import annotations

import os.path
from collections.abc import Iterator
from pathlib import PurePath

from kybflow.dsl.reading.source import Span

_INSTALLED = frozenset({"site-packages", "dist-packages"})


def primary(span: Span) -> Span:
    """`span`, or where it is outside of the current folder the outermost use, else the outermost
    import, that is inside."""
    if not _is_outside(span.file):
        return span
    leads = (place for place in (*span.used, *span.via) if not _is_outside(place.file))
    return next(leads, span)


def ways_to(span: Span) -> Iterator[str]:
    """How the place was reached, the nearest first, a line each."""
    for reached in reversed(span.via):
        yield f"imported from {reached.at}"
    for use in reversed(span.used):
        yield f"used at {use.at}"


def _is_outside(file: str) -> bool:
    if _INSTALLED.intersection(PurePath(file).parts):
        return True
    try:
        steps = PurePath(os.path.relpath(file)).parts
    except ValueError:  # another drive, or no path at all
        return True
    return steps[:1] == ("..",)
