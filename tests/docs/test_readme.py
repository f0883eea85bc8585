"""What the README shows is true: its report, its mission's length, its links."""

import re
import shlex
from pathlib import Path

import pytest
from command_lines import command as command_of
from pages import page
from toolchain import ROOT, with_library

from kybflow.dsl.compiler import compile_mission
from kybflow.dsl.diagnostics import render
from kybflow.parts.catalog import load_catalog
from kybflow.parts.observables import OBSERVABLES

TEXT = page("README.md")
DOCS = sorted(str(path.relative_to(ROOT)) for path in (ROOT / "docs").rglob("*.md"))
PAGES = ["README.md", "CONTRIBUTING.md", *DOCS]


def test_the_report_is_what_kybflow_says(tmp_path: Path, monkeypatch):
    (tmp_path / "missions").mkdir()
    wrong = with_library(tmp_path / "missions") / "figure_eight.yaml"
    text = page("missions/figure_eight.yaml").replace("width: 1.46 m", "width: 1.46 s")
    wrong.write_text(text, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    result = compile_mission("missions/figure_eight.yaml", catalog=load_catalog())
    [finding] = result.diagnostics
    assert render(finding, result.texts) in TEXT


def test_the_mission_is_as_long_as_it_says():
    [(lines, path)] = re.findall(r"\[(\d+) lines\]\((.*?)\)", TEXT)
    assert int(lines) == len(page(path).splitlines())


def test_the_language_page_has_every_observable():
    text = page("docs/mission-language.md")
    assert [name for name in OBSERVABLES if f"`{name}`" not in text] == []


def commands() -> set[str]:
    """Every command that a page shows, in the line or in a block, without its comment."""
    shown = "\n".join(map(page, PAGES))
    found = re.findall(
        r"(?:`|^ {4}|^\$ |^- run: |^```sh\n|&& )kybflow ([^`\n#>|]+)", shown, re.MULTILINE
    )
    return {command.strip() for command in found}


@pytest.mark.parametrize("command", sorted(commands()))
def test_a_command_that_is_shown_is_one(command: str):
    name, *arguments = shlex.split(command)
    known = command_of(name)
    if arguments:
        known.make_context(name, arguments)


def test_every_link_leads_somewhere():
    broken = [
        (name, link)
        for name in PAGES
        for link in re.findall(r"\]\((?!http)([^)#]+)", page(name))
        if not (ROOT / name).parent.joinpath(link).exists()
    ]
    assert broken == []
