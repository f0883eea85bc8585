"""Bad missions beside the exact report: every Markdown file in `literate/` is a test.

A section (`##`) has one block of YAML a file: the first is `mission.yaml`, the others say their
path (```` ```yaml library/x.yaml ````); arguments follow the word `with` (```` ```yaml with
--set lap=8s ````). The block `report` is what `kybflow validate` prints.
Rewrite the reports of a file with: python tests/dsl/test_literate.py NAME.md
"""

from __future__ import annotations

import contextlib
import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

from kybflow.catalog import load_catalog
from kybflow.dsl.compiler import compile_mission
from kybflow.dsl.render import render

FOLDER = Path(__file__).parent / "literate"
_BLOCK = re.compile(r"^```(yaml|report)(?: ([^\n]*))?\n(.*?)^```$", re.MULTILINE | re.DOTALL)


class Case(NamedTuple):
    name: str
    files: dict[str, str]
    arguments: tuple[str, ...]
    report: str


def cases_of(path: Path) -> Iterator[Case]:
    for section in re.split(r"^## ", path.read_text(encoding="utf-8"), flags=re.MULTILINE)[1:]:
        files: dict[str, str] = {}
        arguments: tuple[str, ...] = ()
        report = ""
        for kind, info, body in _BLOCK.findall(section):
            if kind == "report":
                report = body
                continue
            name, _, given = info.partition("with ")
            files[name.strip() or "mission.yaml"] = body
            arguments = tuple(given.split("; ")) if given else arguments
        yield Case(f"{path.stem}: {section.splitlines()[0]}", files, arguments, report)


def report_of(case: Case, folder: Path) -> str:
    for name, text in case.files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")
    options = dict(a.removeprefix("--").split(" ", 1) for a in case.arguments if "--set" not in a)
    sets = [a.removeprefix("--set ") for a in case.arguments if "--set" in a]
    with contextlib.chdir(folder):
        result = compile_mission(
            "mission.yaml", catalog=load_catalog(), target=options.get("target"), sets=sets
        )
    return "\n\n".join(render(d, result.texts) for d in result.diagnostics) + "\n"


CASES = [case for path in sorted(FOLDER.glob("*.md")) for case in cases_of(path)]


@pytest.mark.parametrize("case", CASES, ids=[case.name for case in CASES])
def test_report_is_exactly_this(case: Case, tmp_path: Path) -> None:
    assert report_of(case, tmp_path) == case.report


def rewrite(path: Path, folder: Path) -> None:
    """Write the reports as they are now."""
    text = path.read_text(encoding="utf-8")
    for number, case in enumerate(cases_of(path)):
        new = report_of(case, folder / f"{path.stem}{number}")
        start = text.index("## " + case.name.split(": ", 1)[1] + "\n")
        end = text.find("\n## ", start)
        section = text[start : end if end > 0 else len(text)]
        fresh = re.sub(r"(?ms)^```report\n.*?^```$", lambda _, n=new: f"```report\n{n}```", section)
        text = text.replace(section, fresh)
    path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    import sys
    import tempfile

    for markdown in (FOLDER / name for name in sys.argv[1:]):
        with tempfile.TemporaryDirectory() as scratch:
            rewrite(markdown, Path(scratch))
