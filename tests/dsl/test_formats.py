"""Collector for code scanning (SARIF) and for GitHub Actions."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from toolchain import MISSIONS, invoke

from kybflow.api.validation import to_annotation, to_sarif
from kybflow.dsl.diagnostics import Diagnostic, Severity, Span

IMPORTED = Span("m.yaml", 3, 9, 3, 20)


LIBRARY = ".venv/lib/python3.12/site-packages/bees/bees.yaml"
USE = Span("m.yaml", 7, 5, 7, 9)


def finding(
    file: str = "m.yaml",
    severity: Severity = Severity.ERROR,
    end: int = 2,
    via: tuple[Span, ...] = (IMPORTED,),
    used: tuple[Span, ...] = (),
) -> Diagnostic:
    span = Span(file, 2, 3, end, 5, via, used)
    return Diagnostic("KYB203", "50 % off: a, b", span, "here", ("why",), "do", severity)


def run_of(*findings: Diagnostic) -> dict:
    log = json.loads(to_sarif(findings))
    assert log["version"] == "2.1.0"
    assert log["$schema"].endswith("/sarif-schema-2.1.0.json")
    (run,) = log["runs"]
    return run


def test_sarif_has_a_rule_for_each_code_and_a_result_for_each_finding() -> None:
    run = run_of(finding(), finding(severity=Severity.WARNING))
    driver = run["tool"]["driver"]
    assert driver["name"] == "kybflow"
    (rule,) = driver["rules"]
    assert rule["id"] == "KYB203"
    assert rule["shortDescription"]["text"].startswith("A behavior can't follow another")
    assert [result["level"] for result in run["results"]] == ["error", "warning"]
    assert {result["ruleIndex"] for result in run["results"]} == {0}
    assert run["results"][0]["message"]["text"] == "50 % off: a, b: here\nwhy\nhelp: do"


def test_sarif_has_places_that_count_from_1() -> None:
    (result,) = run_of(finding())["results"]
    (location,) = result["locations"]
    assert run_of()["columnKind"] == "unicodeCodePoints"
    assert location["physicalLocation"] == {
        "artifactLocation": {"uri": "m.yaml"},
        "region": {"startLine": 2, "startColumn": 3, "endLine": 2, "endColumn": 5},
    }
    (related,) = result["relatedLocations"]
    assert related["physicalLocation"]["region"]["startLine"] == 3
    assert related["message"]["text"] == "imported here"


@pytest.mark.parametrize(
    ("file", "uri"),
    [
        ("a b/ä#?.yaml", "a%20b/%C3%A4%23%3F.yaml"),
        ("/tmp/a b.yaml", "file:///tmp/a%20b.yaml"),
        ("\ud800.yaml", "%3F.yaml"),
    ],
)
def test_sarif_names_files_by_a_uri_reference(file: str, uri: str) -> None:
    (result,) = run_of(finding(file, via=()))["results"]
    location = result["locations"][0]["physicalLocation"]["artifactLocation"]
    assert location["uri"] == uri


def test_sarif_of_nothing_is_a_run_without_results() -> None:
    assert run_of()["results"] == []


def test_a_github_annotation_escapes_text_and_properties() -> None:
    assert to_annotation(finding("a,b:c.yaml")) == (
        "::error file=a%2Cb%3Ac.yaml,line=2,endLine=2,col=3,endColumn=5,title=kybflow KYB203"
        "::50 %25 off: a, b: here%0Awhy%0Ahelp: do%0Aimported from m.yaml:3"
    )


def test_a_finding_inside_of_a_library_is_annotated_where_the_mission_uses_it() -> None:
    text = to_annotation(finding(LIBRARY, used=(USE, Span(LIBRARY, 9, 1, 9, 4))))
    assert text.startswith("::error file=m.yaml,line=7,endLine=7,col=5,endColumn=9,")
    ways = ("m.yaml:3", f"{LIBRARY}:9", "m.yaml:7")
    verbs = ("imported from", "used at", "used at")
    lines = [f"{verb} {way}" for verb, way in zip(verbs, ways, strict=True)]
    assert text.endswith("%0A".join(("", f"in {LIBRARY}:2:3", *lines)))


def test_a_finding_inside_of_a_library_that_no_chain_uses_is_annotated_at_the_import() -> None:
    assert to_annotation(finding("../bees.yaml")).startswith("::error file=m.yaml,line=3,")
    assert to_annotation(finding("lab/bees.yaml")).startswith("::error file=lab/bees.yaml,line=2,")


def test_sarif_of_a_finding_inside_of_a_library_relates_its_place() -> None:
    (result,) = run_of(finding(LIBRARY, used=(USE,)))["results"]
    assert result["locations"][0]["physicalLocation"]["region"]["startLine"] == 7
    related = [(r["message"]["text"], r["physicalLocation"]) for r in result["relatedLocations"]]
    assert [why for why, _ in related] == ["found here", "used here", "imported here"]
    assert related[0][1]["artifactLocation"]["uri"] == LIBRARY


def test_a_github_annotation_of_several_lines_has_no_columns() -> None:
    text = to_annotation(finding(end=4, severity=Severity.WARNING))
    assert text.startswith("::warning file=m.yaml,line=2,endLine=4,title=kybflow KYB203::")


def test_nothing_in_a_file_can_begin_another_command() -> None:
    text = to_annotation(finding("x\n::set-env name=A::b\r"))
    assert len(text.splitlines()) == 1


@pytest.mark.parametrize(("format", "begins"), [("sarif", "{"), ("github", "::error file=")])
def test_validate_speaks_both(format: str, begins: str, tmp_path: Path) -> None:
    bad = tmp_path / "bad.yaml"
    bad.write_text("kybflow: 1\nmission: bad\n", encoding="utf-8")
    result = invoke("validate", bad, "--format", format)
    assert result.exit_code == 2
    assert result.output.startswith(begins)


def test_a_good_mission_is_a_log_without_results() -> None:
    mission = MISSIONS / "first_flight.yaml"
    result = invoke("validate", mission, "--format", "sarif")
    assert result.exit_code == 0
    assert json.loads(result.output)["runs"][0]["results"] == []
