"""`kybflow tags`."""

from __future__ import annotations

import re
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from typer import Argument, BadParameter, Option

from kybflow.cli.arguments import compiled, quantity, writing, wrong
from kybflow.cli.output import echo, grouped
from kybflow.core.units import LENGTH
from kybflow.vision import WAY_OUT

if TYPE_CHECKING:
    from kybflow.vision.sheets import Page

_BARE = re.compile(r"\s*[\d.]+\s*\Z")
_RANGE = re.compile(r"\s*(\d{1,6})\s*(?:-\s*(\d{1,6})\s*)?\Z")


def command(
    mission: Annotated[Path | None, Argument(help="A mission, to print all of its tags.")] = None,
    *,
    out: Annotated[Path, Option(help="The .pdf to write, or .png, one per page.")],
    ids: Annotated[str | None, Option(help="Tags as numbers and ranges, such as 0-9,12.")] = None,
    size: Annotated[str | None, Option(help="Side of the black square, such as 19.5cm.")] = None,
    family: Annotated[str | None, Option(help="The tags' family; 36h11 by default.")] = None,
    paper: Annotated[Literal["a4", "a3"], Option(help="The paper.")] = "a4",
) -> None:
    """Write sheets of tags for printing to scale: those of a mission, or some of a family.

    \b
    Examples:
      kybflow tags missions/courier.yaml --paper a3 --out floor.pdf
      kybflow tags --family 36h11 --ids 0-99 --size 19.5cm --paper a3 --out floor.pdf
      kybflow tags --family 36h11 --ids 100,101,102 --size 4cm --out pad.png
    """
    try:
        from kybflow.vision.sheets import lay_out, pdf, png
    except ImportError as error:
        raise BadParameter(
            f"tags are drawn with OpenCV and ReportLab ({error}); {WAY_OUT}"
        ) from None
    if out.suffix not in (".pdf", ".png"):
        raise wrong("--out", f"`{out}` doesn't end in .pdf or .png")
    sorts = _requested(mission, ids, size, family)
    pages: list[Page] = []
    for (sort, side), numbers in sorts.items():
        try:
            pages += lay_out(sort, numbers, side, paper)
        except ValueError as error:
            option, way = _way_out(sort, side, paper, mission, size)
            raise wrong(option, f"{error}; {way}") from None
    if out.suffix == ".pdf":
        files = {out: pdf(pages, paper)}
    else:
        several = len(pages) > 1
        names = (f"{out.stem}-{i + 1}" if several else out.stem for i in range(len(pages)))
        files = {
            out.with_name(f"{n}.png"): png(p, paper) for n, p in zip(names, pages, strict=True)
        }
    for file, data in files.items():
        with writing(file, "--out"):
            file.write_bytes(data)
        echo(f"wrote {file}")
    echo("print at 100 %, not fitted to the page; the bar must be 100 mm long")


def _way_out(
    family: str, side: float, paper: str, mission: Path | None, size: str | None
) -> tuple[str, str]:
    """Return (option or argument, advice) for a tag that is too large for the paper."""
    from kybflow.vision.sheets import lay_out

    if size is not None and _BARE.match(size):
        return "--size", f"a number without a unit is in metres; write {size.strip()}cm"
    if paper != "a3":
        with suppress(ValueError):
            lay_out(family, [0], side, "a3")
            return "--paper", "use --paper a3" + ("" if mission else " or a smaller --size")
    if mission is None:
        return "--size", "use a smaller one"
    return "MISSION", "use smaller tags in its world"


def _requested(
    mission: Path | None, ids: str | None, size: str | None, family: str | None
) -> dict[tuple[str, float], list[int]]:
    """Return the ids of the tags to print, by family and size (m), largest first."""
    if mission is None:
        if ids is None or size is None:
            raise wrong(None, "give a MISSION, or --ids and --size")
        side = quantity(size, LENGTH, "--size")
        if side <= 0.0:
            raise wrong("--size", f"`{size}` is not above 0")
        family = family or "36h11"
        return {(family, side): _numbers(ids, family)}
    if ids or size or family:
        raise wrong(None, "MISSION has tags of its own; leave out --ids, --size and --family")
    sorts = grouped(((tag.family, tag.size), tag.id) for tag in compiled(mission)[0].tags)
    if not sorts:
        raise wrong("MISSION", f"`{mission}` has no tags; add them in `world: {{tags: ...}}`")
    order = sorted(sorts, key=lambda sort: (-sort[1], sort[0]))
    return {sort: sorted(sorts[sort]) for sort in order}


def _numbers(text: str, family: str) -> list[int]:
    """Parse ids such as `0-9,12`. All must be in the family."""
    from kybflow.vision.tags import FAMILIES

    if family not in FAMILIES:
        known = ", ".join(FAMILIES)
        raise wrong("--family", f"there is no family `{family}`; the families are {known}")
    most = FAMILIES[family][1]
    numbers: list[int] = []
    for part in text.split(","):
        match = _RANGE.match(part)
        if match is None:
            raise wrong("--ids", f"`{part}` is neither a number nor a range such as 0-9")
        first, last = int(match[1]), int(match[2] or match[1])
        if not first <= last < most:
            raise wrong("--ids", f"`{part}` is not within 0 to {most - 1}, the tags of {family}")
        numbers += range(first, last + 1)
    return numbers
