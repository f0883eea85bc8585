"""Collects every code of a finding, with its explanation and an example.

The explanation comes from the docstring, or the `CODES`, in the module that makes the finding. The
example comes from the literate pages, which are also tests: they hold wrong missions, the report
that each one gets, and its correction. Only `kybflow explain` and the reports for programs use this
module; a validation doesn't import it.

A page is a Markdown file whose title names a family of checks. A section (`##`) has these blocks:

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

import functools
import importlib
import inspect
import re
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
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


_HEAD = re.compile(r"(KYB\d{3}): (.*)", re.DOTALL)
_SENTENCE = re.compile(r"(.*?[.:])(?: |\n\n|$)(.*)", re.DOTALL)
_FAMILIES = {
    "Files that can't be read": (1,),
    "Keys, values and names": (101,),
    "Imports and `like`": (120,),
    "Parameters": (130, 460),
    "Parts": (140,),
    "Transitions between behaviors": (143, 201, 206, 415, 449),
    "Targets, rates and the world": (150,),
    "Stacks and chains": (157,),
    "Callbacks": (170, 230, 442, 450, 461, 553),
    "Faults": (180, 330, 438),
    "Groups and flows": (190, 240, 436, 443, 454, 462, 520),
    "Every flight ends on the ground": (205, 250),
    "Conditions and expectations": (210, 253, 257, 410, 423, 570),
    "Estimators": (255,),
    "Data from sensors to rotors": (301, 535),
    "Paths, limits and obstacles": (311, 340, 426, 444, 453, 510, 545, 556),
    "Gains and their margins": (323,),
    "Estimators and failsafe": (360, 416, 439, 446, 566, 590),
    "Files that parts read": (370,),
    "Printed tags": (380, 386, 422, 445),
    "Cameras": (385, 387),
    "Sensors": (390,),
    "Payloads": (395,),
    "Inputs and steering": (400, 447),
    "Airframes and what they carry": (420,),
    "Time and energy": (430, 448, 455, 575),
    "Several vehicles": (440,),
    "Objects": (580,),
    "Rehearsals": (470,),
}
"""The families of codes, with the first code of each of their ranges. A range extends to the next
range's first code."""


class Code(NamedTuple):
    """One code. title: its meaning in one sentence. meaning: further explanation, may be empty.
    examples: the sections of the literate pages that show it."""

    code: str
    family: str
    title: str
    meaning: str
    examples: tuple[Section, ...]


@functools.cache
def codes() -> dict[str, Code]:
    """Return every code that the compiler or a rehearsal can give, in order."""
    texts: dict[str, str] = {}
    home = Path(kybflow.__file__).parent
    files = (path for part in ("api", "dsl") for path in sorted((home / part).rglob("*.py")))
    for path in (path for path in files if _CODE.search(path.read_text(encoding="utf-8"))):
        name = ".".join(("kybflow", *path.relative_to(home).with_suffix("").parts))
        for code, text in _explained(importlib.import_module(name.removesuffix(".__init__"))):
            texts[code] = max(texts.get(code, ""), text, key=len)
    shown: dict[str, list[Section]] = {}
    for section in sections():
        for code in section.codes:
            shown.setdefault(code, []).append(section)
    return {code: _code(code, texts[code], shown.get(code, [])) for code in sorted(texts)}


def _explained(module: ModuleType) -> Iterator[tuple[str, str]]:
    """Yield (code, explanation) for each code that a module defines."""
    yield from getattr(module, "CODES", {}).items()
    for function in vars(module).values():
        if inspect.isfunction(function) and function.__module__ == module.__name__:
            match = _HEAD.match(inspect.cleandoc(function.__doc__ or ""))
            if match is not None:
                yield match[1], match[2]


def _code(code: str, text: str, shown: list[Section]) -> Code:
    """Return a code with its explanation and examples. shown: the sections whose reports contain
    the code; the examples are those that name it in the heading, or else the first one."""
    first, _, rest = text.partition("\n\n")
    sentence = _SENTENCE.match(" ".join(first.split()) + " ")
    title, more = (sentence[1], sentence[2].strip()) if sentence else (first, "")
    if title.endswith(":"):
        title, more = " ".join(first.split()), ""
    ranges = ((begin, family) for family, begins in _FAMILIES.items() for begin in begins)
    _, family = max((begin, family) for begin, family in ranges if begin <= int(code[3:]))
    paragraphs = [" ".join(p.split()) for p in (more, *rest.split("\n\n")) if p.strip()]
    title = title[0].upper() + title[1:].rstrip(".")
    examples = [section for section in shown if code in section.heading] or shown[:1]
    return Code(code, family, title, "\n\n".join(paragraphs), tuple(examples))


def families() -> dict[str, list[Code]]:
    """Return the codes of each family, sorted."""
    found: dict[str, list[Code]] = {}
    for code in codes().values():
        found.setdefault(code.family, []).append(code)
    return found


def list_codes() -> str:
    """Return a list of all codes by family, one per line."""
    return "\n\n".join(
        "\n".join([family, *(f"  {c.code}  {c.title}" for c in members)])
        for family, members in families().items()
    )


def show_code(code: Code) -> str:
    """Return the explanation of one code, for the terminal."""
    lines = [f"{code.code}: {code.title}"]
    if code.meaning:
        lines.append(f"\n{code.meaning}")
    for example in code.examples:
        lines += [f"\nWrong: {example.title}", *filter(None, (example.prose,)), ""]
        lines += _indented(_reports(code.code, example.report))
        if example.mend:
            lines += ["\nRight:", *_indented(example.mend.rstrip("\n"))]
    return "\n".join(lines).rstrip()


def _indented(text: str) -> Iterator[str]:
    return (f"    {line}".rstrip() for line in text.split("\n"))


def _reports(code: str, report: str) -> str:
    """Return the findings in a report that have this code."""
    return "\n\n".join(p for p in report.strip("\n").split("\n\n") if f"[{code}]" in p)


_INTRODUCTION = """\
# What each check means

`kybflow validate` checks a mission before anything flies. Each finding has a code;
`kybflow explain CODE` prints its section of this page. Errors keep a mission on the ground.
Warnings report what can't be decided before the flight, and what is probably a mistake.

This page is generated from the checks and their tests: `kybflow explain --write docs/checks.md`.
"""


def page() -> str:
    """Return the content of `docs/checks.md`: the meaning of each check, with wrong and right
    examples."""
    lines = [_INTRODUCTION]
    for family in families():
        anchor = re.sub(r"[^\w -]", "", family.lower()).replace(" ", "-")
        lines.append(f"- [{family}](#{anchor})")
    lines.append("")
    for family, members in families().items():
        lines.append(f"## {family}\n")
        for code in members:
            lines += [f"### {code.code}\n", f"**{code.title}.**\n"]
            if code.meaning:
                lines.append(f"{code.meaning}\n")
            for example in code.examples:
                lines.append(f"Wrong: {example.title}. {example.prose}".rstrip() + "\n")
                lines.append(f"```text\n{_reports(code.code, example.report)}\n```\n")
                if example.mend:
                    lines.append(f"Right:\n\n```diff\n{example.mend}```\n")
    return "\n".join(lines)
