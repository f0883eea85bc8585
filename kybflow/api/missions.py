"""A mission as scripts see it: its findings, or its plan.

Mistakes are returned by `validate`, and raised by what needs a valid mission, with the text of the
command line.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import overload

from kybflow.api.validation import findings
from kybflow.core.errors import KybflowError
from kybflow.dsl.compiler import Result, check_mission, compile_mission
from kybflow.dsl.diagnostics import Diagnostic, has_errors, render_all
from kybflow.dsl.plan import Plan
from kybflow.parts.catalog import load_catalog

Values = Mapping[str, object]
"""Values by name, as text with a unit or as numbers in SI: `{"lap": "8 s"}`."""


class Findings(Sequence[Diagnostic]):
    """The findings about a mission in the order of its text. `str(findings)` is what the command
    line prints. `valid`: whether none of them is an error."""

    def __init__(self, found: Sequence[Diagnostic], texts: Mapping[str, str]) -> None:
        self._found, self._texts = tuple(found), dict(texts)

    @property
    def valid(self) -> bool:
        return not has_errors(self._found)

    @overload
    def __getitem__(self, index: int) -> Diagnostic: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[Diagnostic, ...]: ...
    def __getitem__(self, index: int | slice) -> Diagnostic | tuple[Diagnostic, ...]:
        return self._found[index]

    def __len__(self) -> int:
        return len(self._found)

    def __str__(self) -> str:
        return "\n".join(render_all(self._found, self._texts)) or "no findings"

    def __repr__(self) -> str:
        return f"<Findings: {len(self)}, {'valid' if self.valid else 'not valid'}>"


class MissionInvalid(KybflowError):
    """A mission has mistakes, or its rehearsal failed, so that it isn't flown. findings: what was
    found; the message is their text."""

    def __init__(self, findings: Findings, message: str = "") -> None:
        super().__init__(message or str(findings))
        self.findings = findings


def validate(
    mission: str | Path,
    *,
    target: str | None = None,
    set: Values | None = None,
    parts: Sequence[str | Path] = (),
) -> Findings:
    """Check a mission without flying it. set: parameters of the mission. parts: Python files that
    define a part each, whose code is run. Never raises for what is wrong with the mission; raises
    PartError for a file of `parts`."""
    catalog = load_catalog(*map(Path, parts))
    result = check_mission(mission, catalog=catalog, target=target, sets=settings(set))
    return Findings(result.diagnostics, result.texts)


def compile_plan(
    mission: str | Path, target: str | None, sets: Sequence[str], parts: Sequence[str | Path] = ()
) -> tuple[Plan, Result]:
    """Return the plan of a mission. Raises MissionInvalid, PartError."""
    catalog = load_catalog(*map(Path, parts))
    result = compile_mission(mission, catalog=catalog, target=target, sets=sets)
    if result.plan is None:
        texts = "\n".join(findings(result, Path(mission)))
        raise MissionInvalid(Findings(result.diagnostics, result.texts), texts)
    return result.plan, result


def pairs(values: Values | None) -> tuple[tuple[str, str], ...]:
    return tuple((name, str(value)) for name, value in (values or {}).items())


def settings(values: Values | None) -> tuple[str, ...]:
    return tuple(f"{name}={value}" for name, value in pairs(values))
