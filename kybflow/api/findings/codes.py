"""Every code of a finding: what it means, from the docstring or the `CODES` beside the place that
raises it, and how it looks and is mended, from the literate pages. Nothing is written twice.

Only `kybflow explain` and the reports for programs ask; a validation does not come here.
"""

from __future__ import annotations

import functools
import importlib
import inspect
import pkgutil
import re
from collections.abc import Iterator
from types import ModuleType
from typing import NamedTuple

import kybflow.dsl
from kybflow.api.findings.pages import Section, sections

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
    "That everything comes down": (205, 250),
    "Conditions and expectations": (210, 253, 257, 410, 423),
    "Estimators": (255,),
    "Data from sensor to rotor": (301, 535),
    "Where it goes and how fast": (311, 340, 426, 444, 453, 510, 545, 556),
    "Gains and their margins": (323,),
    "Estimators and failsafe": (360, 416, 439, 446),
    "Files that parts read": (370,),
    "Printed tags": (380, 386, 422, 445),
    "Cameras": (385, 387),
    "Sensors": (390,),
    "Payloads": (395,),
    "Inputs and steering": (400, 447),
    "Airframes and what they carry": (420,),
    "Time and energy": (430, 448, 455),
    "Several vehicles": (440,),
    "Rehearsals": (470,),
}
"""The families of codes, and the first code of each range that belongs to one: it goes on until the
next range begins."""


class Code(NamedTuple):
    """One code: its family, what it means in one sentence, what more there is to say, examples."""

    code: str
    family: str
    title: str
    meaning: str
    examples: tuple[Section, ...]


@functools.cache
def codes() -> dict[str, Code]:
    """Every code that the compiler can give, in order."""
    texts: dict[str, str] = {}
    modules = [info.name for info in pkgutil.walk_packages(kybflow.dsl.__path__, "kybflow.dsl.")]
    for name in (*modules, "kybflow.api.rehearsal.findings"):
        for code, text in _explained(importlib.import_module(name)):
            if len(text) > len(texts.get(code, "")):
                texts[code] = text
    shown: dict[str, list[Section]] = {}
    for section in sections():
        for code in section.codes:
            shown.setdefault(code, []).append(section)
    return {code: _code(code, texts[code], shown.get(code, [])) for code in sorted(texts)}


def _explained(module: ModuleType) -> Iterator[tuple[str, str]]:
    """(code, its explanation) of each that a module raises."""
    yield from getattr(module, "CODES", {}).items()
    for function in vars(module).values():
        if inspect.isfunction(function) and function.__module__ == module.__name__:
            match = _HEAD.match(inspect.cleandoc(function.__doc__ or ""))
            if match is not None:
                yield match[1], match[2]


def _code(code: str, text: str, shown: list[Section]) -> Code:
    """A code with its explanation and the sections in whose report it is: the examples are those
    that are about it, else the first."""
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
    """The codes by family, in the order of their codes."""
    found: dict[str, list[Code]] = {}
    for code in codes().values():
        found.setdefault(code.family, []).append(code)
    return found


def list_codes() -> str:
    """Every code by family, one line each."""
    return "\n\n".join(
        "\n".join([family, *(f"  {c.code}  {c.title}" for c in members)])
        for family, members in families().items()
    )


def show_code(code: Code) -> str:
    """The page of one code for the terminal."""
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
    """The parts of a report that are of this code."""
    return "\n\n".join(p for p in report.strip("\n").split("\n\n") if f"[{code}]" in p)


_INTRODUCTION = """\
# What each check means

Before anything flies, `kybflow validate` proves what can be proven of a mission. A finding has a
code; `kybflow explain CODE` prints what stands here. Errors keep a mission on the ground; warnings
say what can't be decided before the flight, or what is most likely a slip.

This page is made from the checks and from their tests: `kybflow explain --write docs/checks.md`.
"""


def page() -> str:
    """`docs/checks.md`: what each check means, with an example of wrong and right."""
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
