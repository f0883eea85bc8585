"""What the README shows is true: its report, its mission's length, its links."""

import re
import shlex
from pathlib import Path

import pytest
from command_lines import command as command_of
from toolchain import ROOT

from kybflow.dsl.compiler import compile_mission
from kybflow.dsl.diagnostics import render
from kybflow.parts.catalog import load_catalog
from kybflow.parts.observables import OBSERVABLES

TEXT = (ROOT / "README.md").read_text(encoding="utf-8")
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]


def test_the_report_is_what_kybflow_says(tmp_path: Path, monkeypatch):
    missions = tmp_path / "missions"
    (missions / "library").mkdir(parents=True)
    for file in (ROOT / "missions" / "library").iterdir():
        (missions / "library" / file.name).write_bytes(file.read_bytes())
    mission = (ROOT / "missions" / "figure_eight.yaml").read_text(encoding="utf-8")
    wrong = mission.replace("width: 1.46 m", "width: 1.46 s")
    (missions / "figure_eight.yaml").write_text(wrong, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    result = compile_mission("missions/figure_eight.yaml", catalog=load_catalog())
    [finding] = result.diagnostics
    assert render(finding, result.texts) in TEXT


def test_the_mission_is_as_long_as_it_says():
    [(lines, path)] = re.findall(r"\[(\d+) lines\]\((.*?)\)", TEXT)
    assert int(lines) == len((ROOT / path).read_text(encoding="utf-8").splitlines())


def test_the_language_page_has_every_observable():
    page = (ROOT / "docs" / "mission-language.md").read_text(encoding="utf-8")
    missing = [name for name in OBSERVABLES if f"`{name}`" not in page]
    assert missing == []


def commands() -> set[str]:
    """Every command that a page shows, in the line or in a block, without its comment."""
    shown = "\n".join(page.read_text(encoding="utf-8") for page in PAGES)
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
        (page.name, link)
        for page in PAGES
        for link in re.findall(r"\]\((?!http)([^)#]+)", page.read_text(encoding="utf-8"))
        if not (page.parent / link).exists()
    ]
    assert broken == []
