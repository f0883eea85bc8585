"""Findings as a SARIF 2.1.0 log, for code scanning (OASIS, Static Analysis Results Interchange
Format). Columns count characters from 1; a place behind an import is a related one."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import PurePath
from typing import Any
from urllib.parse import quote

from kybflow import __version__
from kybflow.dsl.diagnostics.codes import codes
from kybflow.dsl.diagnostics.diagnostic import Diagnostic
from kybflow.dsl.diagnostics.placed import primary
from kybflow.dsl.diagnostics.render import clipped, printable
from kybflow.dsl.reading.source import Span

SCHEMA = (
    "https://docs.oasis-open.org/sarif/sarif/v2.1.0/errata01/os/schemas/sarif-schema-2.1.0.json"
)


def to_sarif(diagnostics: Iterable[Diagnostic]) -> str:
    """One run of kybflow with everything that was found, as JSON text."""
    found = list(diagnostics)
    seen = sorted({d.code for d in found})
    driver = {"name": "kybflow", "version": __version__, "rules": [_rule(code) for code in seen]}
    run = {
        "tool": {"driver": driver},
        "columnKind": "unicodeCodePoints",
        "results": [_result(d, seen.index(d.code)) for d in found],
    }
    return json.dumps({"$schema": SCHEMA, "version": "2.1.0", "runs": [run]}, indent=2)


def _rule(code: str) -> dict[str, Any]:
    known = codes().get(code)
    title = known.title if known else code
    rule = {"id": code, "shortDescription": {"text": title}}
    if known and known.meaning:
        rule["fullDescription"] = {"text": known.meaning}
    return rule | {"help": {"text": f"kybflow explain {code}"}}


def _result(diagnostic: Diagnostic, rule: int) -> dict[str, Any]:
    span, shown = diagnostic.span, primary(diagnostic.span)
    found: dict[str, Any] = {
        "ruleId": diagnostic.code,
        "ruleIndex": rule,
        "level": diagnostic.severity.value,
        "message": {"text": message_of(diagnostic)},
        "locations": [_location(shown)],
    }
    related = [(span, "found here")] if shown is not span else []
    related += [(use, "used here") for use in span.used]
    related += [(reached, "imported here") for reached in span.via]
    if related:
        found["relatedLocations"] = [
            {**_location(place), "message": {"text": why}} for place, why in related
        ]
    return found


def message_of(diagnostic: Diagnostic) -> str:
    """All that is said of a finding, a line each, without its place."""
    way_out = f"help: {diagnostic.help}" if diagnostic.help else ""
    label = f": {diagnostic.label}" if diagnostic.label else ""
    lines = [f"{diagnostic.message}{label}", *diagnostic.notes, way_out]
    return "\n".join(clipped(printable(line)) for line in lines if line)


def _location(span: Span) -> dict[str, Any]:
    region = {
        "startLine": span.line,
        "startColumn": span.column,
        "endLine": span.end_line,
        "endColumn": span.end_column,
    }
    place = {"artifactLocation": {"uri": _uri(span.file)}, "region": region}
    return {"physicalLocation": place}


def _uri(file: str) -> str:
    """A reference as RFC 3986 wants it: a relative path stays one."""
    path = PurePath(file.encode("utf-8", "replace").decode())
    return path.as_uri() if path.is_absolute() else quote(path.as_posix())
