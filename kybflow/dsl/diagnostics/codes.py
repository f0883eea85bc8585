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
from collections.abc import Iterable, Iterator
from types import ModuleType
from typing import NamedTuple

import kybflow.dsl
from kybflow.core.text import did_you_mean
from kybflow.dsl.diagnostics.pages import Section, sections

_HEAD = re.compile(r"(KYB\d{3}): (.*)", re.DOTALL)
_SENTENCE = re.compile(r"(.*?[.:])(?: |\n\n|$)(.*)", re.DOTALL)
_FAMILIES = {
    "KYB001": "Files that can't be read",
    "KYB101": "Keys, values and names",
    "KYB120": "Imports and `like`",
    "KYB130": "Parameters",
    "KYB140": "Parts",
    "KYB143": "Transitions between behaviors",
    "KYB150": "Targets, rates and the world",
    "KYB157": "Stacks and chains",
    "KYB170": "Callbacks",
    "KYB180": "Faults",
    "KYB190": "Groups and flows",
    "KYB201": "Transitions between behaviors",
    "KYB205": "That everything comes down",
    "KYB206": "Transitions between behaviors",
    "KYB210": "Conditions and expectations",
    "KYB230": "Callbacks",
    "KYB240": "Groups and flows",
    "KYB250": "That everything comes down",
    "KYB253": "Conditions and expectations",
    "KYB255": "Estimators",
    "KYB257": "Conditions and expectations",
    "KYB301": "Data from sensor to rotor",
    "KYB311": "Where it goes and how fast",
    "KYB323": "Gains and their margins",
    "KYB330": "Faults",
    "KYB340": "Where it goes and how fast",
    "KYB360": "Estimators and failsafe",
    "KYB370": "Files that parts read",
    "KYB380": "Printed tags",
    "KYB385": "Cameras",
    "KYB386": "Printed tags",
    "KYB387": "Cameras",
    "KYB390": "Sensors",
    "KYB395": "Payloads",
    "KYB400": "Inputs and steering",
    "KYB410": "Conditions and expectations",
    "KYB415": "Transitions between behaviors",
    "KYB416": "Estimators and failsafe",
    "KYB420": "Airframes and what they carry",
    "KYB422": "Printed tags",
    "KYB423": "Conditions and expectations",
    "KYB426": "Where it goes and how fast",
    "KYB430": "Time and energy",
    "KYB436": "Groups and flows",
    "KYB438": "Faults",
    "KYB439": "Estimators and failsafe",
    "KYB440": "Several vehicles",
    "KYB442": "Callbacks",
    "KYB443": "Groups and flows",
    "KYB444": "Where it goes and how fast",
    "KYB445": "Printed tags",
    "KYB446": "Estimators and failsafe",
    "KYB447": "Inputs and steering",
    "KYB448": "Time and energy",
    "KYB449": "Transitions between behaviors",
    "KYB450": "Callbacks",
    "KYB453": "Where it goes and how fast",
    "KYB454": "Groups and flows",
    "KYB455": "Time and energy",
    "KYB460": "Parameters",
    "KYB461": "Callbacks",
    "KYB462": "Groups and flows",
    "KYB470": "Rehearsals",
    "KYB510": "Where it goes and how fast",
    "KYB520": "Groups and flows",
    "KYB535": "Data from sensor to rotor",
    "KYB545": "Where it goes and how fast",
    "KYB553": "Callbacks",
    "KYB556": "Where it goes and how fast",
}
"""The families of codes, each from its first code on."""


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
    for module in _modules():
        for code, text in _explained(module):
            if len(text) > len(texts.get(code, "")):
                texts[code] = text
    shown: dict[str, list[Section]] = {}
    for section in sections():
        for code in section.codes:
            shown.setdefault(code, []).append(section)
    return {code: _code(code, texts[code], _best(code, shown)) for code in sorted(texts)}


def _best(code: str, shown: dict[str, list[Section]]) -> list[Section]:
    """The sections that are about a code, else the first in whose report it is."""
    found = shown.get(code, [])
    return [section for section in found if code in section.heading] or found[:1]


def families() -> dict[str, list[Code]]:
    """The codes by family, in the order of their codes."""
    found: dict[str, list[Code]] = {}
    for code in codes().values():
        found.setdefault(code.family, []).append(code)
    return found


def unknown_code(name: str) -> str:
    """The message for a code that no diagnostic has."""
    return f"no finding has the code `{name}`; {did_you_mean(name.upper(), codes())}"


def _modules() -> Iterator[ModuleType]:
    for info in pkgutil.walk_packages(kybflow.dsl.__path__, "kybflow.dsl."):
        yield importlib.import_module(info.name)


def _explained(module: ModuleType) -> Iterator[tuple[str, str]]:
    """(code, its explanation) of each that a module raises."""
    yield from getattr(module, "CODES", {}).items()
    for function in vars(module).values():
        if inspect.isfunction(function) and function.__module__ == module.__name__:
            match = _HEAD.match(inspect.cleandoc(function.__doc__ or ""))
            if match is not None:
                yield match[1], match[2]


def _code(code: str, text: str, examples: list[Section]) -> Code:
    first, _, rest = text.partition("\n\n")
    sentence = _SENTENCE.match(" ".join(first.split()) + " ")
    title, more = (sentence[1], sentence[2].strip()) if sentence else (first, "")
    if title.endswith(":"):
        title, more = " ".join(first.split()), ""
    family = next(name for begin, name in reversed(_FAMILIES.items()) if begin <= code)
    paragraphs = [" ".join(p.split()) for p in (more, *rest.split("\n\n")) if p.strip()]
    title = title[0].upper() + title[1:].rstrip(".")
    return Code(code, family, title, "\n\n".join(paragraphs), tuple(examples))


def list_codes() -> str:
    """Every code by family, one line each."""
    parts = []
    for family, members in families().items():
        parts.append("\n".join([family, *(f"  {c.code}  {c.title}" for c in members)]))
    return "\n\n".join(parts)


def show_code(code: Code) -> str:
    """The page of one code for the terminal."""
    return "\n".join(_shown(code)).rstrip()


def _shown(code: Code) -> Iterator[str]:
    yield f"{code.code}: {code.title}"
    if code.meaning:
        yield f"\n{code.meaning}"
    for example in code.examples:
        yield f"\nWrong: {example.title}"
        if example.prose:
            yield f"{example.prose}"
        yield ""
        yield from _indented(_reports(code.code, example.report))
        if example.mend:
            yield "\nRight:"
            yield from _indented(example.mend.rstrip("\n").split("\n"))


def _indented(lines: Iterable[str]) -> Iterator[str]:
    return (f"    {line}".rstrip() for line in lines)


def _reports(code: str, report: str) -> list[str]:
    """The parts of a report that are of this code."""
    own = [part for part in report.strip("\n").split("\n\n") if f"[{code}]" in part]
    return "\n\n".join(own).split("\n")


def page() -> str:
    """`docs/checks.md`: what each check means, with an example of wrong and right."""
    return "\n".join(_page())


_INTRODUCTION = """\
# What each check means

Before anything flies, `kybflow validate` proves what can be proven of a mission. A finding has a
code; `kybflow explain CODE` prints what stands here. Errors keep a mission on the ground; warnings
say what can't be decided before the flight, or what is most likely a slip.

This page is made from the checks and from their tests: `kybflow explain --write docs/checks.md`.
"""


def _page() -> Iterator[str]:
    yield _INTRODUCTION
    for family in families():
        yield f"- [{family}](#{_anchor(family)})"
    yield ""
    for family, members in families().items():
        yield f"## {family}\n"
        for code in members:
            yield f"### {code.code}\n"
            yield f"**{code.title}.**\n"
            yield from ([f"{code.meaning}\n"] if code.meaning else ())
            for example in code.examples:
                yield from _example(code, example)


def _example(code: Code, example: Section) -> Iterator[str]:
    yield f"Wrong: {example.title}. {example.prose}".rstrip() + "\n"
    yield "```text\n" + "\n".join(_reports(code.code, example.report)) + "\n```\n"
    if example.mend:
        yield f"Right:\n\n```diff\n{example.mend}```\n"


def _anchor(heading: str) -> str:
    return re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-")
