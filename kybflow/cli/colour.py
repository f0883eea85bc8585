"""Colour for reports, where they are read in a terminal."""

from __future__ import annotations

import re

from rich.console import Console
from rich.text import Text

_STYLES = (
    (re.compile(r"^.*error\[KYB\d+\]:.*$", re.MULTILINE), "bold"),
    (re.compile(r"error\[KYB\d+\]"), "bold red"),
    (re.compile(r"warning\[KYB\d+\]"), "bold yellow"),
    (re.compile(r"^ {6}\| .*$", re.MULTILINE), "red"),
    (re.compile(r"^ +\d+ \|| {6}[|=]", re.MULTILINE), "blue"),
    (re.compile(r"\bhelp:"), "green"),
)


def coloured(text: str) -> str:
    """`text` with the terminal's codes."""
    styled = Text(text)
    for pattern, style in _STYLES:
        for match in pattern.finditer(text):
            styled.stylize(style, *match.span())
    console = Console(force_terminal=True, highlight=False)
    with console.capture() as capture:
        console.print(styled, end="", soft_wrap=True)
    return capture.get()
