"""Every code of a finding is explained beside where it is raised, and shown by a test."""

from __future__ import annotations

import re
from pathlib import Path

REPO = Path(__file__).parents[2]
SOURCES = [
    *sorted((REPO / "kybflow" / "dsl").rglob("*.py")),
    REPO / "kybflow" / "api" / "rehearsal" / "findings.py",
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
    texts = [p.read_text() for p in (REPO / "tests").rglob("*") if p.suffix in (".md", ".py")]
    shown = {code for text in texts for code in re.findall(r"KYB\d{3}", text)}
    assert RAISED - shown == set()
