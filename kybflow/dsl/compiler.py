"""Text to plan: the passes, in order. One that follows errors is skipped."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from kybflow.dsl.checks import run_checks
from kybflow.dsl.diagnostics.diagnostic import Diagnostic, has_errors, in_order
from kybflow.dsl.document import Document, Parameter
from kybflow.dsl.lowering.lower import lower
from kybflow.dsl.plan import Plan, SourceFile
from kybflow.dsl.reading.attachments import attachments_of
from kybflow.dsl.reading.reader import read
from kybflow.dsl.reading.source import SET, Span
from kybflow.dsl.resolving.loading import Files
from kybflow.dsl.resolving.resolve import resolve, resolve_library
from kybflow.dsl.resolving.settings import parse_settings
from kybflow.dsl.resolving.unused_names import unused_names
from kybflow.dsl.schema.judge import is_library, judge_mission
from kybflow.dsl.shaping import targets
from kybflow.dsl.shaping.library_parts import judge_parts
from kybflow.dsl.shaping.shape import shape
from kybflow.dsl.writing.written import written

if TYPE_CHECKING:
    from kybflow.parts.catalog import Catalog


@dataclass(frozen=True, slots=True)
class Result:
    """The plan, None when there are errors; the findings in order; the text of every file; the
    parameters that the plan was made with."""

    plan: Plan | None
    diagnostics: tuple[Diagnostic, ...]
    texts: dict[str, str] = field(default_factory=dict)
    parameters: dict[str, Parameter] = field(default_factory=dict)

    @property
    def valid(self) -> bool:
        return not has_errors(self.diagnostics)


def compile_mission(
    path: str | Path, *, catalog: Catalog, target: str | None = None, sets: Sequence[str] = ()
) -> Result:
    """What the mission in `path` means on `target`, with its parameters set by `sets`
    (`name=value`). Never raises for what a file or a setting says."""
    document, files, found = _document(Path(path), str(path), catalog, target, sets)
    plan = None
    if document is not None:
        read = (SourceFile(s.file, s.sha256) for s in files.sources.values())
        sources = (*read, *attachments_of(document))
        plan = lower(document, catalog, sources, written(document))
    result = _result(plan, files, target, sets, found)
    return result if document is None else replace(result, parameters=document.parameters)


def check_mission(
    path: str | Path, *, catalog: Catalog, target: str | None = None, sets: Sequence[str] = ()
) -> Result:
    """What `compile_mission` finds, without the plan: `lower` finds nothing. A library is judged
    too."""
    _, files, found = _document(Path(path), str(path), catalog, target, sets)
    return _result(None, files, target, sets, found)


def _document(
    path: Path, file: str, catalog: Catalog, target: str | None, sets: Sequence[str]
) -> tuple[Document | None, Files, list[Diagnostic]]:
    source = read(path, file)
    files = Files(source, path)
    found = list(source.found)
    settings = parse_settings(sets, found)
    if source.root is None or has_errors(found):
        return None, files, found
    if is_library(source.root):
        judge_parts(resolve_library(source, files, found), catalog, found)
        return None, files, found
    mission = judge_mission(source.root, found)
    resolved = None if mission is None else resolve(mission, files, settings, found)
    document = None if resolved is None else shape(resolved, catalog, target, found)
    if document is not None:
        found += run_checks(document, catalog)
    if mission is None or has_errors(found):
        return None, files, found
    found += unused_names(mission, files, (s.node for s in settings.values() if s.node))
    return document, files, found


def _result(
    plan: Plan | None,
    files: Files,
    target: str | None,
    sets: Sequence[str],
    found: list[Diagnostic],
) -> Result:
    valued = (_at_value(d, files) for d in found)
    located = (replace(d, span=_reached(d, files)) for d in valued)
    texts = {s.file: s.text for s in files.sources.values()}
    given = {SET: "\n".join(sets), targets.FILE: target or ""}
    return Result(plan, in_order(located), texts | given)


def _at_value(diagnostic: Diagnostic, files: Files) -> Diagnostic:
    """What is wrong with the value that a user gave for a `$name` of a chain or a library, at that
    value."""
    span, value = diagnostic.span, diagnostic.span.value
    if value is None:
        return diagnostic
    lines = files.sources[span.file].text.split("\n") if span.file in files.sources else []
    name = lines[span.line - 1][span.column - 1 : span.end_column - 1] if lines else "a parameter"
    notes = (f"it takes the place of `{name}` at {span.at}", *diagnostic.notes)
    return replace(diagnostic, span=value, notes=notes)


def _reached(diagnostic: Diagnostic, files: Files) -> Span:
    """The span with the imports through which its file was reached."""
    span = diagnostic.span
    via = files.via.get(span.file, ())
    return replace(span, via=via) if via else span
