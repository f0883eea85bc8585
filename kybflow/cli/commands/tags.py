"""`kybflow tags`."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from kybflow.cli.arguments import PATH, Subcommand, argument, compiled, examples
from kybflow.cli.output import echo
from kybflow.vision import WAY_OUT

if TYPE_CHECKING:
    from kybflow.vision.sheets import Page
    from kybflow.world.tags import TagMap

EXAMPLES = examples(
    "kybflow tags missions/courier.yaml --paper a3 --out floor.pdf",
    "kybflow tags --family 36h11 --ids 0-99 --size 19.5cm --paper a3 --out floor.pdf",
    "kybflow tags --family 36h11 --ids 100,101,102 --size 4cm --out pad.png",
)
_BARE = re.compile(r"\s*[\d.]+\s*\Z")
_RANGE = re.compile(r"\s*(\d{1,6})\s*(?:-\s*(\d{1,6})\s*)?\Z")


@click.command("tags", cls=Subcommand, epilog=EXAMPLES)
@argument("mission", "A mission, all of whose tags are to be printed.", type=PATH, required=False)
@click.option(
    "--out", type=PATH, required=True, help="The file to write: .pdf, or .png, a file a page."
)
@click.option("--ids", help="Which tags: numbers and ranges, such as 0-9,12.")
@click.option("--size", help="Side of the black square, such as 19.5cm.")
@click.option("--family", help="The tags' family; 36h11 unless said.")
@click.option(
    "--paper", type=click.Choice(["a4", "a3"]), default="a4", help="What it is printed on."
)
def command(
    mission: Path | None,
    out: Path,
    ids: str | None,
    size: str | None,
    family: str | None,
    paper: str,
) -> None:
    """Write sheets of tags to print, true to scale: those of a mission, or some of a family."""
    try:
        from kybflow.vision.sheets import lay_out
    except ImportError as error:
        raise click.BadParameter(
            f"tags are drawn with OpenCV and ReportLab ({error}); {WAY_OUT}"
        ) from None
    if out.suffix not in (".pdf", ".png"):
        raise click.BadParameter(f"`{out}` should end in .pdf or .png", param_hint="--out")
    pages: list[Page] = []
    for sort, side, numbers in _requested(mission, ids, size, family):
        try:
            pages += lay_out(sort, numbers, side, paper)
        except ValueError as error:
            option, way = _way_out(sort, side, paper, mission, size)
            raise click.BadParameter(f"{error}; {way}", param_hint=option) from None
    for path, data in _files(out, pages, paper):
        try:
            path.write_bytes(data)
        except OSError as error:
            message = f"`{path}` can't be written: {error.strerror}"
            raise click.BadParameter(message, param_hint="--out") from None
        echo(f"wrote {path}")
    echo("print at 100 %, not fitted to the page; the bar must measure 100 mm")


def _way_out(
    family: str, side: float, paper: str, mission: Path | None, size: str | None
) -> tuple[str, str]:
    """(option or argument, advice) for a tag that is too large for the paper."""
    from kybflow.vision.sheets import lay_out

    if size is not None and _BARE.match(size):
        return "--size", f"a number alone is metres: write the unit, such as {size.strip()}cm"
    if paper != "a3":
        try:
            lay_out(family, [0], side, "a3")
        except ValueError:
            pass
        else:
            return "--paper", "take --paper a3" + ("" if mission else ", or a smaller --size")
    if mission is None:
        return "--size", "make it smaller"
    return "MISSION", "make the tags of its world smaller"


def _requested(
    mission: Path | None, ids: str | None, size: str | None, family: str | None
) -> list[tuple[str, float, list[int]]]:
    """(family, side in metres, numbers) of the tags to print."""
    if mission is not None:
        if ids or size or family:
            raise click.BadParameter(
                "a mission says its tags itself; leave out --ids, --size and --family"
            )
        plan, _ = compiled(mission)
        return _sorts(plan.tags, mission)
    if ids is None or size is None:
        raise click.BadParameter("say which tags: MISSION, or --ids and --size")
    family = family or "36h11"
    side = _size(size)
    return [(family, side, _numbers(ids, family))]


def _sorts(tags: TagMap, mission: Path) -> list[tuple[str, float, list[int]]]:
    """The tags of a mission, those of one family and size together, the largest first."""
    sorts: dict[tuple[str, float], list[int]] = {}
    for tag in tags:
        sorts.setdefault((tag.family, tag.size), []).append(tag.id)
    if not sorts:
        message = f"`{mission}` has no tags; they stand in `world: {{tags: ...}}`"
        raise click.BadParameter(message, param_hint="MISSION")
    order = sorted(sorts, key=lambda sort: (-sort[1], sort[0]))
    return [(*sort, sorted(sorts[sort])) for sort in order]


def _files(out: Path, pages: Sequence[Page], paper: str) -> Iterator[tuple[Path, bytes]]:
    """The files to write: `floor.pdf`, or `floor-1.png`, `floor-2.png`, ... for several pages."""
    from kybflow.vision.sheets import pdf, png

    if out.suffix == ".pdf":
        yield out, pdf(pages, paper)
        return
    for i, page in enumerate(pages):
        number = f"-{i + 1}" if len(pages) > 1 else ""
        yield out.with_name(f"{out.stem}{number}.png"), png(page, paper)


def _size(text: str) -> float:
    from kybflow.core.errors import UnitError
    from kybflow.core.units import LENGTH, parse_quantity

    try:
        size = parse_quantity(text, LENGTH)
    except UnitError as error:
        message = f"{error}; {error.hint}" if error.hint else str(error)
        raise click.BadParameter(message, param_hint="--size") from None
    if size <= 0.0:
        raise click.BadParameter(f"`{text}` must be above 0", param_hint="--size")
    return size


def _numbers(text: str, family: str) -> list[int]:
    from kybflow.vision.families import FAMILIES

    if family not in FAMILIES:
        known = ", ".join(FAMILIES)
        message = f"there is no family `{family}`; there are {known}"
        raise click.BadParameter(message, param_hint="--family")
    most = FAMILIES[family][1]
    numbers: list[int] = []
    for part in text.split(","):
        match = _RANGE.match(part)
        if match is None:
            message = f"`{part}` is no number and no range; write it like 0-9,12"
            raise click.BadParameter(message, param_hint="--ids")
        first, last = int(match[1]), int(match[2] or match[1])
        if not first <= last < most:
            message = f"`{part}` is no range of {family}, whose tags are 0 to {most - 1}"
            raise click.BadParameter(message, param_hint="--ids")
        numbers += range(first, last + 1)
    return numbers
