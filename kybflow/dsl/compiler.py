"""Text to plan: the passes, in order. One that follows errors is skipped."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from collections.abc import Mapping as MappingOf
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from kybflow.dsl.checks import run_checks
from kybflow.dsl.diagnostics import Diagnostic, has_errors, in_order
from kybflow.dsl.judge import is_library, judge_mission
from kybflow.dsl.lower import lower
from kybflow.dsl.nodes import Node
from kybflow.dsl.plan import Plan, SourceFile
from kybflow.dsl.reader import Source, read
from kybflow.dsl.resolve import Files, resolve, resolve_library
from kybflow.dsl.settings import FILE, parse_settings
from kybflow.dsl.shape import shape
from kybflow.dsl.source import Span
from kybflow.dsl.written import written

if TYPE_CHECKING:
    from kybflow.catalog import Catalog


@dataclass(frozen=True, slots=True)
class Result:
    """The plan, None when there are errors; the findings in order; the text of every file."""

    plan: Plan | None
    diagnostics: tuple[Diagnostic, ...]
    texts: dict[str, str] = field(default_factory=dict)

    @property
    def valid(self) -> bool:
        return not has_errors(self.diagnostics)


def compile_mission(
    path: str | Path, *, catalog: Catalog, target: str | None = None, sets: Sequence[str] = ()
) -> Result:
    """What the mission in `path` means on `target`, with its parameters set by `sets`
    (`name=value`); a library is judged and has no plan. Never raises for what a file or a setting
    says."""
    source = read(Path(path), str(path))
    found = list(source.found)
    settings = parse_settings(sets, found)
    if source.root is None:
        return Result(None, in_order(found), _texts([source], sets))
    files = Files(source, Path(path))
    plan = None
    if not has_errors(found):
        if is_library(source.root):
            resolve_library(source, files, found)
        else:
            plan = _plan(source.root, files, settings, catalog, target, found)
    return _result(plan, files, sets, found)


def _plan(
    root: Node,
    files: Files,
    settings: MappingOf[str, Node],
    catalog: Catalog,
    target: str | None,
    found: list[Diagnostic],
) -> Plan | None:
    mission = judge_mission(root, found)
    if mission is None:
        return None
    resolved = resolve(mission, files, settings, found)
    if resolved is None:
        return None
    document = shape(resolved, catalog, target, found)
    if document is None:
        return None
    found += run_checks(document, catalog)
    if has_errors(found):
        return None
    sources = tuple(SourceFile(s.file, s.sha256) for s in files.sources.values())
    return lower(document, catalog, sources, written(document))


def _result(
    plan: Plan | None, files: Files, sets: Sequence[str], found: list[Diagnostic]
) -> Result:
    located = (replace(d, span=_reached(d, files)) for d in found)
    return Result(plan, in_order(located), _texts(files.sources.values(), sets))


def _texts(sources: Iterable[Source], sets: Sequence[str]) -> dict[str, str]:
    return {s.file: s.text for s in sources} | {FILE: "\n".join(sets)}


def _reached(diagnostic: Diagnostic, files: Files) -> Span:
    """The span with the imports through which its file was reached."""
    span = diagnostic.span
    via = files.via.get(span.file, ())
    return replace(span, via=via) if via else span
