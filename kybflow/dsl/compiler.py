"""The passes from text to plan, in order. A pass is skipped if an earlier one found errors.

read      text and `--set` to a tree in which every node has a source location
judge     check the shape of the tree against the records of the language
resolve   replace imports, `like`, stacks, chains and parameters by what they stand for
expand    the tree to the plan as written, in SI
check     prove what can be proven of the plan before take-off
bind      replace names by what they mean; the result is the plan that the runtime sees
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from kybflow.dsl.bind import bind
from kybflow.dsl.checks import check
from kybflow.dsl.diagnostics import (
    SET,
    Collector,
    Diagnostic,
    Related,
    Stopped,
    has_errors,
    in_order,
    lines_of,
)
from kybflow.dsl.expanding import targets
from kybflow.dsl.expanding.mission import judge_library, mission_of
from kybflow.dsl.language.judge import is_library, judge_mission
from kybflow.dsl.language.text import to_yaml
from kybflow.dsl.plan import Parameter, Plan, SourceFile
from kybflow.dsl.reading.reader import ParsedFile, read
from kybflow.dsl.resolving.imports import Files
from kybflow.dsl.resolving.parameters import parse_settings
from kybflow.dsl.resolving.resolve import resolve, resolve_library
from kybflow.dsl.resolving.unused import unused_names

if TYPE_CHECKING:
    from kybflow.dsl.diagnostics import Span
    from kybflow.parts.catalog import Catalog


@dataclass(frozen=True, slots=True)
class Result:
    """The result of a compilation. plan: None if there are errors. diagnostics: the findings in
    order. texts: the text of every file, by name. parameters: the mission parameters used for the
    plan."""

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
    """Compile the mission in `path` for `target`, with its parameters set by `sets` (`name=value`).
    Errors in a file or a setting are returned as diagnostics and never raised."""
    plan, files, result = _compiled(Path(path), str(path), catalog, target, sets)
    if plan is None:
        return result
    sources = tuple(SourceFile(s.file, s.sha256) for s in files.sources.values())
    plan = bind(plan, catalog, sources, to_yaml(plan))
    return replace(result, plan=plan, parameters=plan.values)


def check_mission(
    path: str | Path, *, catalog: Catalog, target: str | None = None, sets: Sequence[str] = ()
) -> Result:
    """Check a mission or a library and return what `compile_mission` would find, without a plan."""
    return _compiled(Path(path), str(path), catalog, target, sets)[2]


def _compiled(
    path: Path, file: str, catalog: Catalog, target: str | None, sets: Sequence[str]
) -> tuple[Plan | None, Files, Result]:
    source = read(path, file)
    files, found = Files(source, path), Collector()
    try:
        plan = _passes(source, files, catalog, target, sets, found)
    except Stopped:
        plan = None
    located = (_located(finding, files) for finding in found.all)
    texts = {s.file: s.text for s in files.sources.values()}
    given = {SET: "\n".join(sets), targets.FILE: target or ""}
    return plan, files, Result(None, in_order(located), texts | given)


def _passes(
    source: ParsedFile,
    files: Files,
    catalog: Catalog,
    target: str | None,
    sets: Sequence[str],
    found: Collector,
) -> Plan | None:
    """Run the passes from reading to checking. Return the checked plan, or None for a library.
    Raises Stopped if a pass found errors."""
    found.add(source.found)
    settings, root = parse_settings(sets, found), source.root
    found.stop_if_errors()
    assert root is not None  # a file that can't be read has errors
    if is_library(root):
        judge_library(resolve_library(source, files, found), catalog, found)
        return None
    mission = judge_mission(root, found)
    found.stop_if_errors()
    resolved = resolve(mission, files, settings, found)
    found.stop_if_errors()
    plan = mission_of(resolved, catalog, target, found)
    found.stop_if_errors()
    assert plan is not None  # without errors there is a plan
    found.add(check(plan, catalog))
    found.stop_if_errors()
    found.add(unused_names(mission, files, settings))
    return plan


def _located(diagnostic: Diagnostic, files: Files) -> Diagnostic:
    """Return the finding with the imports through which its file was reached. A finding about the
    `$name` of a chain or a library is moved to the value that a user gave for the name; the
    location of any other value, such as a default, becomes a related location."""
    span, value, given = diagnostic.span, diagnostic.span.value, diagnostic.span.given
    notes, related = diagnostic.notes, diagnostic.related
    if value is not None:
        notes = (f"it takes the place of {_written(span, files)} at {span.at}", *notes)
        related = tuple(other for other in related if other.span != value)
    elif given is not None and all(other.span != given for other in related):
        related = (Related(given, f"what {_written(span, files)} stands for"), *related)
    place = span if value is None else value
    place = place._replace(via=files.via.get(place.file, ()))
    return replace(diagnostic, span=place, notes=notes, related=related)


def _written(span: Span, files: Files) -> str:
    lines = lines_of(files.sources[span.file].text) if span.file in files.sources else []
    name = lines[span.line - 1][span.column - 1 : span.end_column - 1] if lines else ""
    return f"`{name}`" if name else "a parameter"
