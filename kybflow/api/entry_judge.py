"""Checks the values that a command gives for a state. The compiler's checks run on the mission as
if the vehicle began in that state, with those values, at its present position."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from kybflow.core.errors import Refused
from kybflow.core.geometry import Vec3
from kybflow.dsl.checks.case import Case
from kybflow.dsl.checks.entry_values import OF_ENTRIES
from kybflow.dsl.diagnostics import Diagnostic, Findings, Span
from kybflow.dsl.expanding.entry_values import entry_values
from kybflow.dsl.expanding.world import Points
from kybflow.dsl.language.source import Source
from kybflow.dsl.plan import Plan, Values
from kybflow.dsl.reading.nodes import Mapping, MappingEntry, Scalar
from kybflow.dsl.reading.reader import compose
from kybflow.parts.catalog import Catalog

_HERE = Span("the command", 1, 1, 1, 1)
"""The source location of values that a command gives."""


class PlanEntryJudge:
    """The implementation of `kybflow.runtime.vehicle.requests.EntryJudge` for a run."""

    def __init__(self, plan: Plan) -> None:
        self._plan = plan

    def read(self, vehicle: str, state: str, written: Values) -> Values:
        own = self._plan.fleet[vehicle].states[state]
        if own.built_in:
            raise Refused(f"`{state}` is built in and takes no values")
        asked = Mapping({name: self._entry(name, text) for name, text in written}, _HERE)
        found = Findings()
        values = entry_values(Source(_HERE, asked), own.behavior, found)
        if found.all:
            raise Refused(_in_a_line(found.all[0]))
        return values

    def objection(
        self, vehicle: str, state: str, params: Any, points: Sequence[Vec3]
    ) -> str | None:
        own = self._plan.fleet[vehicle]
        entered = own.states[state]
        entered = entered.but(behavior=entered.behavior.but(params=params))
        for point in points:
            begins = own.but(start=point, begin=state, states={state: entered.but(transitions=())},
                estimators=(), supervisors=(), sensors=(), requested=frozenset(),
                requested_first=frozenset(),
            )  # fmt: skip
            alone = self._plan.but(vehicles=(begins,), flows=(), callbacks=(), faults=(), inputs=(),
                groups={}, moving={},
            )  # fmt: skip
            case = Case(alone, Catalog({}))
            first = next((f for check in OF_ENTRIES for f in check(case)), None)
            if first is not None:
                return _in_a_line(first)
        return None

    def _entry(self, name: str, text: str) -> MappingEntry:
        """Read one value as YAML. Raises Refused."""
        found = Findings()
        node = compose(text, _HERE.file, found)
        if node is not None:
            node = Points(self._plan.points, found).apply(node)
        if node is None or found.all:
            raise Refused(f"`{name}`: {_in_a_line(found.all[0])}")
        return MappingEntry(Scalar(name, _HERE), node)


def _in_a_line(finding: Diagnostic) -> str:
    label = f": {finding.label}" if finding.label else ""
    hint = f"; {finding.help}" if finding.help else ""
    return f"{finding.message}{label}{hint}"
