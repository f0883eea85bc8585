"""The pages of the documentation, as tests read them."""

from __future__ import annotations

import re

from toolchain import ROOT


def page(name: str) -> str:
    """The text of a page, such as `docs/ardrone.md`."""
    return (ROOT / name).read_text(encoding="utf-8")


def section(text: str, heading: str) -> str:
    """What is below a heading of the second level, up to the next."""
    return text.partition(f"## {heading}\n")[2].partition("\n## ")[0]


def blocks(text: str, language: str = "yaml") -> list[str]:
    """What the fences of a language hold, in order."""
    return re.findall(rf"^```{language}\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)
