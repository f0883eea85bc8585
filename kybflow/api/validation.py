"""Validates missions and formats the compiler's findings for people and programs."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any

from kybflow.dsl.compiler import Result, check_mission
from kybflow.dsl.diagnostics import render_all, to_json
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
        from kybflow.api.findings.formats import to_annotation

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
        found.append(f"{path} is a library, no mission")
    return found


def validate_paths(
    paths: Iterable[Path], target: str | None, sets: Sequence[str]
) -> Iterator[ValidatedFile]:
    """Validate each of `paths`. In a folder, validate the missions and libraries in it and its
    subfolders."""
    catalog = load_catalog()
    files = (mission_files(path) if os.path.isdir(path) else (path,) for path in paths)
    for path in chain.from_iterable(files):
        begin = time.perf_counter()
        result = check_mission(path, catalog=catalog, target=target, sets=sets)
        took = (time.perf_counter() - begin) * 1e3
        yield ValidatedFile(str(path), result, took, result.valid)


def _as_json(files: Sequence[ValidatedFile]) -> str:
    whole = {
        "kybflow": 1,
        "valid": all(f.valid for f in files),
        "files": [f.summary for f in files],
    }
    return json.dumps(whole, indent=2)


def _as_sarif(files: Sequence[ValidatedFile]) -> str:
    from kybflow.api.findings.formats import to_sarif

    return to_sarif(d for file in files for d in file.result.diagnostics)


WHOLE: dict[str, Callable[[Sequence[ValidatedFile]], str]] = {"json": _as_json, "sarif": _as_sarif}
"""The output formats that hold all files in a single text."""
