"""Validates missions, and formats findings for people and for programs that review a change.

`to_sarif` gives a SARIF 2.1.0 log for code scanning (OASIS, Static Analysis Results Interchange
Format); its columns count characters from 1. `to_annotation` gives a workflow command of GitHub
Actions. As in GitHub's own toolkit, its text has `%`, CR and LF escaped as `%25`, `%0D` and `%0A`;
its properties also have `:` and `,` escaped as `%3A` and `%2C`.

A review shows only files in the folder under review. A finding inside an installed library is
therefore reported where the reviewed files use or import that library.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path, PurePath
from typing import Any
from urllib.parse import quote

from kybflow import __version__
from kybflow.dsl.compiler import Result, check_mission
from kybflow.dsl.diagnostics import (
    Diagnostic,
    Span,
    clipped,
    printable,
    render_all,
    to_json,
    ways_to,
)
from kybflow.dsl.reading.reader import mission_files
from kybflow.parts.catalog import load_catalog


@dataclass(frozen=True, slots=True)
class ValidatedFile:
    """A validated file. milliseconds: the duration of the validation."""

    path: str
    result: Result
    milliseconds: float
    valid: bool

    @property
    def reports(self) -> list[str]:
        """The text of each finding and, for a valid file, a line that says so."""
        texts = render_all(self.result.diagnostics, self.result.texts)
        count = len(texts)
        if self.valid:
            warned = f", {count} warning{'s' * (count > 1)}" if count else ""
            texts.append(f"{self.path}: ok{warned} ({self.milliseconds:.1f} ms)")
        return texts

    @property
    def annotations(self) -> list[str]:
        """The GitHub Actions command of each finding."""
        return [to_annotation(d) for d in self.result.diagnostics]

    @property
    def summary(self) -> dict[str, Any]:
        return {
            "path": self.path,
            "valid": self.valid,
            "milliseconds": round(self.milliseconds, 3),
            "diagnostics": [to_json(d) for d in self.result.diagnostics],
        }


def findings(result: Result, path: Path) -> list[str]:
    """Return the text of each finding of a compilation. A library counts as a finding, because a
    mission is needed."""
    found = render_all(result.diagnostics, result.texts)
    if result.plan is None and result.valid:
        found.append(f"{path} is a library, not a mission")
    return found


def validate_paths(
    paths: Iterable[Path], target: str | None, sets: Sequence[str], parts: Sequence[Path] = ()
) -> Iterator[ValidatedFile]:
    """Validate each of `paths`. In a folder, validate the missions and libraries in it and its
    subfolders. Raises PartError for a file of `parts`."""
    catalog = load_catalog(*parts)
    files = (mission_files(path) if os.path.isdir(path) else (path,) for path in paths)
    for path in chain.from_iterable(files):
        begin = time.perf_counter()
        result = check_mission(path, catalog=catalog, target=target, sets=sets)
        took = (time.perf_counter() - begin) * 1e3
        yield ValidatedFile(str(path), result, took, result.valid)


def whole(files: Sequence[ValidatedFile], format: str) -> str:
    """Return a single text about all files, in the format `json` or `sarif`."""
    if format == "sarif":
        return to_sarif(d for file in files for d in file.result.diagnostics)
    valid = all(f.valid for f in files)
    return json.dumps({"kybflow": 1, "valid": valid, "files": [f.summary for f in files]}, indent=2)


_INSTALLED = frozenset({"site-packages", "dist-packages"})


def primary(span: Span) -> Span:
    """Return `span` if it is inside the current folder; otherwise the outermost use, or else the
    outermost import, that leads to it and is inside. Return `span` if there is none."""
    if not _is_outside(span.file):
        return span
    leads = (place for place in (*span.used, *span.via) if not _is_outside(place.file))
    return next(leads, span)


def _is_outside(file: str) -> bool:
    if _INSTALLED.intersection(PurePath(file).parts):
        return True
    try:
        steps = PurePath(os.path.relpath(file)).parts
    except ValueError:  # another drive, or no path at all
        return True
    return steps[:1] == ("..",)


SCHEMA = (
    "https://docs.oasis-open.org/sarif/sarif/v2.1.0/errata01/os/schemas/sarif-schema-2.1.0.json"
)


def to_sarif(diagnostics: Iterable[Diagnostic]) -> str:
    """Return the log of one kybflow run with all findings, as JSON text."""
    from kybflow.api.codes import codes

    found, rules = list(diagnostics), list[dict[str, Any]]()
    seen = sorted({d.code for d in found})
    for code in seen:
        known = codes().get(code)
        rule = {"id": code, "shortDescription": {"text": known.title if known else code}}
        if known and known.meaning:
            rule["fullDescription"] = {"text": known.meaning}
        rules.append(rule | {"help": {"text": f"kybflow explain {code}"}})
    run = {
        "tool": {"driver": {"name": "kybflow", "version": __version__, "rules": rules}},
        "columnKind": "unicodeCodePoints",
        "results": [_result(d, seen.index(d.code)) for d in found],
    }
    return json.dumps({"$schema": SCHEMA, "version": "2.1.0", "runs": [run]}, indent=2)


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
    related += [(other.span, other.label) for other in diagnostic.related]
    related += [(use, "used here") for use in span.used]
    related += [(reached, "imported here") for reached in span.via]
    if related:
        found["relatedLocations"] = [
            {**_location(place), "message": {"text": why}} for place, why in related
        ]
    return found


def message_of(diagnostic: Diagnostic) -> str:
    """Return the message, notes and help of a finding, one per line."""
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
    path = PurePath(span.file.encode("utf-8", "replace").decode())
    uri = path.as_uri() if path.is_absolute() else quote(path.as_posix())  # RFC 3986
    return {"physicalLocation": {"artifactLocation": {"uri": uri}, "region": region}}


_TEXT = str.maketrans({"%": "%25", "\r": "%0D", "\n": "%0A"})
_PROPERTY = str.maketrans({"%": "%25", "\r": "%0D", "\n": "%0A", ":": "%3A", ",": "%2C"})


def to_annotation(diagnostic: Diagnostic) -> str:
    """Return the workflow command for a finding, as one line."""
    span = primary(diagnostic.span)
    properties = {"file": printable(span.file), "line": span.line, "endLine": span.end_line}
    if span.line == span.end_line:  # GitHub refuses columns for several lines
        properties |= {"col": span.column, "endColumn": span.end_column}
    properties["title"] = f"kybflow {diagnostic.code}"
    listed = ",".join(f"{key}={str(v).translate(_PROPERTY)}" for key, v in properties.items())
    found = diagnostic.span
    elsewhere = () if found is span else (f"in {found.at}:{found.column}",)
    places = map(printable, (*elsewhere, *ways_to(found)))
    text = "\n".join((message_of(diagnostic), *places)).translate(_TEXT)
    return f"::{diagnostic.severity.value} {listed}::{text}"
