"""What the live table shows of the keys: each with what it gives, and the last answer."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from math import ceil

from rich.text import Text

from kybflow.cli.keys.offered import Offer
from kybflow.cli.keys.terminal_commander import Saying

_GAP, _LABEL = 3, 10
_STYLES = {"asked": "bold yellow", "accepted": "green", "refused": "bold red"}


def drawn(offers: Sequence[Offer], saying: Saying, width: int, most: int) -> Iterator[Text]:
    """Yield at most `most` lines, each at most `width` letters wide: the offers by their groups,
    then what is said of the last key, in as many lines as that takes."""
    lines = [line for group in _groups(offers) for line in _group(group, width)]
    left = max(most - max(ceil(len(saying.text) / width), 1), 2)
    if len(lines) > left:
        yield from lines[: left - 1]
        yield _cut(Text("more: `kybflow command state` says all that is legal", style="dim"))
    else:
        yield from lines
    yield Text(saying.text, style=_STYLES.get(saying.kind, ""), overflow="fold")


def _groups(offers: Iterable[Offer]) -> Iterator[list[Offer]]:
    groups: dict[str, list[Offer]] = {}
    for offer in offers:
        groups.setdefault(offer.group, []).append(offer)
    yield from groups.values()


def _group(offers: Sequence[Offer], width: int) -> Iterator[Text]:
    """Yield the lines of one group. A line ends between two offers."""
    line = Text(f"{offers[0].group[: _LABEL - 1]:{_LABEL}}", style="dim")
    for offer in offers:
        shown = Text.assemble((f" {offer.key or '-'} ", "bold not dim reverse"), f" {offer.name}")
        if line.cell_len > _LABEL and line.cell_len + _GAP + shown.cell_len > width:
            yield _cut(line)
            line = Text(" " * _LABEL)
        if line.cell_len > _LABEL:
            line.append(" " * _GAP)
        line.append_text(Text("", style="not dim").append_text(shown))
    yield _cut(line)


def _cut(line: Text) -> Text:
    line.no_wrap, line.overflow = True, "ellipsis"
    return line
