"""The literate pages: bad missions beside the report that they get and the change that mends them.

They are tests and the examples of `kybflow explain` at once. A page is a Markdown file: its title
names a family of checks; a section (`##`) has one block of YAML or Python a file: the first is
`mission.yaml`, the others say their path (```` ```yaml library/x.yaml ````); arguments follow the
word `with` (```` ```yaml with --set lap=8s ````). What a page can't hold stands after `as`:
```` ```yaml mission.yaml as latin-1 ```` is written in that encoding, `as 30000 lines` with its
last line again and again. The block `report` is what `kybflow validate` prints. The block `diff`
mends what the heading's codes are about: lines with `-` give way to those with `+` below them,
lines with a space stay; a change of a file's own line (`-mission.yaml as latin-1`) writes it
otherwise, or elsewhere.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import kybflow

_BLOCK = re.compile(
    r"^```(yaml|python|report|diff)(?: ([^\n]*))?\n(.*?)^```$", re.MULTILINE | re.DOTALL
)
_CODE = re.compile(r"KYB\d{3}")
_REPORTED = re.compile(r"\[(KYB\d{3})\]: ")


class Section(NamedTuple):
    """One bad mission. `family` is the title of its page; `codes` are those that its heading names,
    else those of its report; `prose` what is said of it; `files` its texts by path, `arguments`
    those of the command line."""

    family: str
    heading: str
    codes: tuple[str, ...]
    prose: str
    files: dict[str, str]
    arguments: tuple[str, ...]
    report: str
    mend: str

    @property
    def title(self) -> str:
        """The heading without its codes."""
        return self.heading.rpartition(": ")[2]

    def mended(self) -> dict[str, str]:
        """The files after the diff. Raises ValueError for a change that fits nowhere or twice."""
        texts = [f"{name}\n{text}" for name, text in self.files.items()]
        for hunk in self.mend.split("\n\n") if self.mend else ():
            lines = hunk.strip("\n").split("\n")
            old, new = ("\n".join(line[1:] for line in lines if line[0] != m) for m in "+-")
            places = [place for place, text in enumerate(texts) for _ in range(text.count(old))]
            if len(places) != 1:
                raise ValueError(f"{self.heading}: this fits {len(places)} times:\n{old}")
            texts[places[0]] = texts[places[0]].replace(old, new)
        return {name: text for name, _, text in (text.partition("\n") for text in texts)}


def write(files: dict[str, str], place: Path) -> None:
    """Write the files of a section below `place`."""
    for called, text in files.items():
        name, _, form = called.partition(" as ")
        (place / name).parent.mkdir(parents=True, exist_ok=True)
        count, _, unit = form.partition(" ")
        last = text.splitlines(keepends=True)[-1:]
        more = last * (int(count) - text.count("\n")) if unit == "lines" else []
        encoding = form if form and not unit else "utf-8"
        (place / name).write_text("".join([text, *more]), encoding=encoding)


def folder() -> Path:
    """`kybflow/literate` in a wheel, `tests/dsl/literate` in a checkout."""
    package = Path(kybflow.__file__).parent
    shipped = package / "literate"
    return shipped if shipped.is_dir() else package.parent / "tests" / "dsl" / "literate"


def sections() -> Iterator[Section]:
    """Every section of every page."""
    for path in sorted(folder().glob("*.md")):
        yield from sections_of(path.read_text(encoding="utf-8"))


def sections_of(text: str) -> Iterator[Section]:
    """The sections of one page."""
    head, *parts = re.split(r"^## ", text, flags=re.MULTILINE)
    family = head.strip().splitlines()[0].removeprefix("# ")
    for part in parts:
        heading, _, body = part.partition("\n")
        files: dict[str, str] = {}
        arguments: tuple[str, ...] = ()
        written = {"report": "", "diff": ""}
        for kind, info, block in _BLOCK.findall(body):
            if kind in written:
                written[kind] = block
                continue
            name, _, given = info.partition("with ")
            files[name.strip() or "mission.yaml"] = block
            arguments = tuple(given.split("; ")) if given else arguments
        prose = _BLOCK.sub("", body).strip()
        report, mend = written["report"], written["diff"]
        reported = dict.fromkeys(_REPORTED.findall(report))
        named = [code for code in _CODE.findall(heading) if code in reported]
        codes = tuple(named or reported)
        yield Section(family, heading, codes, prose, files, arguments, report, mend)
