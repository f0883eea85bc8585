"""Every code is shown by a test, and explained from where it is raised and from the pages that show
it."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from toolchain import ROOT, printed

from kybflow.api.codes import (
    codes,
    families,
    list_codes,
    page,
    sections,
    sections_of,
    show_code,
)

PAGE = ROOT / "docs" / "checks.md"


def test_the_page_of_all_codes_is_current() -> None:
    mend = "mend it with: kybflow explain --write docs/checks.md"
    assert PAGE.read_text(encoding="utf-8") == page(), mend


@pytest.mark.parametrize("code", codes().values(), ids=codes())
def test_a_code_says_what_it_means_in_one_sentence(code) -> None:
    assert 15 < len(code.title) < 230
    assert "\n" not in code.title
    assert show_code(code).startswith(f"{code.code}: {code.title}")


def test_what_a_page_is_about_is_shown_with_its_report() -> None:
    for section in sections():
        for code in section.codes:
            assert f"[{code}]" in section.report, section.heading


def test_a_code_shows_wrong_and_right() -> None:
    code, text = printed("explain", "kyb203")
    assert code == 0
    assert "Wrong: a behavior that can't follow another\n" in text
    assert "error[KYB203]: `rest` can't follow `up`" in text
    assert "Right:\n    -      up:   {do: take_off" in text


def test_without_a_code_all_are_listed_by_family() -> None:
    code, text = printed("explain")
    assert code == 0
    assert text == list_codes() + "\n"
    listed = [member.code for members in families().values() for member in members]
    assert sorted(listed) == list(codes())
    assert all(listed.count(name) == 1 for name in codes())


def test_an_unknown_code_gets_the_nearest() -> None:
    code, text = printed("explain", "KYB2033")
    assert code == 2
    assert "KYB203" in text


def test_the_page_is_written_and_checked(tmp_path: Path) -> None:
    file = tmp_path / "checks.md"
    assert printed("explain", "--check", str(file))[0] == 2
    assert printed("explain", "--write", str(file))[0] == 0
    assert printed("explain", "--check", str(file)) == (0, "")


def test_a_change_must_fit_once() -> None:
    text = "# P\n\n## KYB203: t\n\n```yaml\na: 1\na: 1\n```\n\n```diff\n-a: 1\n+a: 2\n```\n"
    (section,) = sections_of(text)
    with pytest.raises(ValueError, match="fits 2 times"):
        section.mended()


SOURCES = [
    *sorted((ROOT / "kybflow" / "dsl").rglob("*.py")),
    ROOT / "kybflow" / "api" / "rehearsal" / "findings.py",
]
RAISED = {
    code
    for path in SOURCES
    for code in re.findall(r'^\s+"(KYB\d{3})",?$|\("(KYB\d{3})"', path.read_text(), re.MULTILINE)
    for code in code
    if code
}
EXPLAINED = re.compile(r'^ {4}"(KYB\d{3})": "|"""(KYB\d{3})\b', re.MULTILINE)


def test_each_is_explained() -> None:
    explained = {
        code
        for path in SOURCES
        for found in EXPLAINED.findall(path.read_text())
        for code in found
        if code
    }
    assert RAISED - explained == set()


def test_each_is_shown() -> None:
    texts = [p.read_text() for p in (ROOT / "tests").rglob("*") if p.suffix in (".md", ".py")]
    shown = {code for text in texts for code in re.findall(r"KYB\d{3}", text)}
    assert RAISED - shown == set()
