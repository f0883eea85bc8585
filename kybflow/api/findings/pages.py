"""Reads the literate pages: wrong missions, the report that each one gets, and its correction.

The pages are tests and also the examples of `kybflow explain`. A page is a Markdown file whose
title names a family of checks. A section (`##`) has these blocks:

- One block of YAML or Python per file. The first is `mission.yaml`; the others give their path:
  ```` ```yaml library/x.yaml ````. Arguments of the command line follow the word `with`:
  ```` ```yaml with --set lap=8s ````. A file that a page can't hold is described after `as`:
  ```` ```yaml mission.yaml as latin-1 ```` is written in that encoding, and `as 30000 lines`
  repeats the last line until the file has that length.
- `report`: the output of `kybflow validate`.
- `diff`: the correction of the findings in the heading. The lines with `+` replace the lines with
  `-` above them; lines with a space stay. A change of a file's header (`-mission.yaml as latin-1`)
  changes its encoding or path.
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
    """One wrong mission.

    family: the title of its page. codes: the reported codes that the heading names, or else all
    reported ones. prose: the text around the blocks. files: the contents of its files, by path.
    arguments: the arguments of the command line. report: the expected output. mend: the diff, may
    be empty.
    """

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
        """The heading without codes."""
        return self.heading.rpartition(": ")[2]

    def mended(self) -> dict[str, str]:
        """Return the files with the diff applied. Raises ValueError for a change that doesn't fit
        exactly once."""
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
    """Write the files of a section into the folder `place`."""
    for called, text in files.items():
        name, _, form = called.partition(" as ")
        (place / name).parent.mkdir(parents=True, exist_ok=True)
        count, _, unit = form.partition(" ")
        last = text.splitlines(keepends=True)[-1:]
        more = last * (int(count) - text.count("\n")) if unit == "lines" else []
        encoding = form if form and not unit else "utf-8"
        (place / name).write_text("".join([text, *more]), encoding=encoding)


def folder() -> Path:
    """Return the folder of the pages: `kybflow/literate` in a wheel, `tests/dsl/literate` in a
    checkout."""
    package = Path(kybflow.__file__).parent
    shipped = package / "literate"
    return shipped if shipped.is_dir() else package.parent / "tests" / "dsl" / "literate"


def sections() -> Iterator[Section]:
    """Yield every section of every page."""
    for path in sorted(folder().glob("*.md")):
        yield from sections_of(path.read_text(encoding="utf-8"))


def sections_of(text: str) -> Iterator[Section]:
    """Yield the sections of one page."""
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
