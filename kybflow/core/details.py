"""Words that carry a table: told where something is told first, left out where it is told again.

The first line stands for itself. The lines below it are indented, and each ends with a line's end,
so that such words can be joined with others by `; ` and the tables still be found.
"""

from __future__ import annotations

from collections.abc import Iterable

INDENT = "  "


def detailed(headline: str, lines: Iterable[str]) -> str:
    """`headline` with `lines` below it."""
    below = "".join(f"{INDENT}{line}\n" for line in lines)
    return f"{headline}\n{below}" if below else headline


def headline(text: str) -> str:
    """`text` without its tables; as it is where it has none."""
    lines = text.split("\n")
    rest = [line for line in lines if not line.startswith(INDENT)]
    return text if len(rest) == len(lines) else "".join(rest)


def details(text: str) -> list[str]:
    """The lines of the tables in `text`, without their indent."""
    return [line.removeprefix(INDENT) for line in text.split("\n") if line.startswith(INDENT)]
