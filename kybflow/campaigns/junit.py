"""Writes results as JUnit XML: a suite for each mission, a case for each seed."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from xml.etree.ElementTree import Element, ElementTree, SubElement, indent

from kybflow.campaigns.cases import FlightResult

_FORBIDDEN = re.compile(r"[^\t\n\r\x20-\ud7ff\ue000-\ufffd]")
"""The characters that XML 1.0 forbids, and those outside the basic plane, which some readers drop.
"""


def write_junit(path: Path, results: Sequence[FlightResult]) -> None:
    """Write the results to `path`. Raises OSError."""
    root = Element("testsuites", name="kybflow test")
    by_mission: dict[Path, list[FlightResult]] = {}
    for one in results:
        by_mission.setdefault(one.case.path, []).append(one)
    for mission, cases in by_mission.items():
        _suite(root, str(mission), cases)
    indent(root)
    ElementTree(root).write(path, encoding="utf-8", xml_declaration=True)


def _suite(root: Element, name: str, cases: Sequence[FlightResult]) -> None:
    suite = SubElement(
        root,
        "testsuite",
        name=_plain(name),
        tests=str(len(cases)),
        failures=str(sum(_is_failure(one) for one in cases)),
        errors=str(sum(not one.passed and not _is_failure(one) for one in cases)),
        time=f"{sum(one.seconds for one in cases):.3f}",
    )
    for one in cases:
        case = SubElement(
            suite,
            "testcase",
            classname=_plain(name),
            name=f"seed {one.case.seed}",
            time=f"{one.seconds:.3f}",
        )
        if not one.passed:
            tag = "failure" if _is_failure(one) else "error"
            first = _plain(one.reason[0]) if one.reason else one.verdict
            fault = SubElement(case, tag, message=first.splitlines()[0], type=one.verdict)
            fault.text = _plain("\n".join(one.reason))


def _is_failure(result: FlightResult) -> bool:
    """Return whether the mission failed. An invalid mission or a failed driver counts as an error
    instead."""
    return result.verdict == "failed"


def _plain(text: str) -> str:
    return _FORBIDDEN.sub("?", text)
