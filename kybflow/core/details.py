"""Messages with a table of details, which a reader may show or leave out.

The first line, the headline, is a message in itself. Each line of the table is indented and ends
with a newline, so that the table can still be found after several messages were joined by `; `.
"""

from __future__ import annotations

from collections.abc import Iterable

INDENT = "  "


def detailed(headline: str, lines: Iterable[str]) -> str:
    """Return `headline` with `lines` as its table."""
    below = "".join(f"{INDENT}{line}\n" for line in lines)
    return f"{headline}\n{below}" if below else headline


def headline(text: str) -> str:
    """Return `text` without its tables; unchanged if it has none."""
    lines = text.split("\n")
    rest = [line for line in lines if not line.startswith(INDENT)]
    return text if len(rest) == len(lines) else "".join(rest)


def details(text: str) -> list[str]:
    """Return the lines of the tables in `text`, without their indent."""
    return [line.removeprefix(INDENT) for line in text.split("\n") if line.startswith(INDENT)]
