"""Judges in flight what a state is to be entered with, by the compiler's own checks and in its
words: as in a mission whose vehicle begins there in that state, with those values."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from kybflow.core.errors import Refused
from kybflow.core.geometry import Vec3
from kybflow.core.params import fields_of
from kybflow.dsl.checks.case import Case
from kybflow.dsl.checks.entry_values import OF_ENTRIES
from kybflow.dsl.diagnostics.diagnostic import Diagnostic, Findings
from kybflow.dsl.diagnostics.spans import Span, Text
from kybflow.dsl.document import Document, ObstacleEntry, PartUse, StateEntry, VehicleEntry
from kybflow.dsl.plan import PartPlan, Plan, Values, VehiclePlan
from kybflow.dsl.reading.composer import compose
from kybflow.dsl.reading.nodes import Mapping, MappingEntry, Scalar
from kybflow.dsl.shaping.entry_values import entry_values
from kybflow.dsl.shaping.world import Points
from kybflow.parts.catalog import Catalog, PartSpec

_HERE = Span("the command", 1, 1, 1, 1)
"""Where a person's values stand."""


class PlanEntryJudge:
    """The judge (`kybflow.runtime.vehicle.requests.EntryJudge`) of a run."""

    def __init__(self, plan: Plan) -> None:
        self._plan = plan

    def read(self, vehicle: str, state: str, written: Values) -> Values:
        plan = self._vehicle(vehicle).states[state]
        if plan.built_in:
            raise Refused(f"`{state}` is built in and takes no values")
        asked = Mapping({name: self._entry(name, text) for name, text in written}, _HERE)
        own, use = Findings(), _use(plan.behavior, plan.behavior.params)
        values = own.take(entry_values(asked, use))
        if own.all:
            raise Refused(_said(own.all[0]))
        return values

    def objection(
        self, vehicle: str, state: str, params: Any, points: Sequence[Vec3]
    ) -> str | None:
        cases = (
            Case(self._document(vehicle, state, params, point), Catalog({})) for point in points
        )
        found = (finding for case in cases for check in OF_ENTRIES for finding in check(case))
        first = next(found, None)
        return None if first is None else _said(first)

    def _vehicle(self, name: str) -> VehiclePlan:
        return next(vehicle for vehicle in self._plan.vehicles if vehicle.name == name)

    def _entry(self, name: str, text: str) -> MappingEntry:
        """One value, as a mission would have it. Raises Refused for what is no YAML."""
        own = Findings()
        node = compose(text, _HERE.file, own)
        if node is not None:
            node = own.take(Points(self._plan.points).apply(node))
        if node is None or own.all:
            raise Refused(f"`{name}`: {_said(own.all[0])}")
        return MappingEntry(Scalar(name, _HERE), node)

    def _document(self, vehicle: str, state: str, params: Any, point: Vec3) -> Document:
        """The mission of one vehicle that begins at `point` in its state."""
        plan, own = self._plan, self._vehicle(vehicle)
        entered = StateEntry(_text(state), _use(own.states[state].behavior, params), (), _HERE)
        beginner = VehicleEntry(
            name=_text(vehicle),
            airframe=own.airframe,
            start=point,
            start_span=_HERE,
            heading=own.heading,
            estimators=(),
            processors=tuple(_use(part, part.params) for part in own.processors),
            tracker=_use(own.tracker, own.tracker.params),
            supervisors=(),
            driver=_use(own.driver, own.driver.params),
            begin=_text(state),
            states={state: entered},
            span=_HERE,
        )
        return Document(
            mission=_text(plan.mission),
            summary="",
            target=_text(plan.target),
            parameters={},
            fence=plan.fence,
            control_rate=plan.control_rate,
            control_span=None,
            hover_limit=plan.hover_limit,
            time_limit=plan.time_limit,
            vehicles={vehicle: beginner},
            expect=(),
            obstacles=tuple(
                ObstacleEntry(_text(name), shape, _HERE, name in plan.touchable)
                for name, shape in plan.obstacles.items()
            ),
        )


def _use(part: PartPlan, params: Any) -> PartUse:
    own = params.__class__
    spec = PartSpec(part.cls.kind, part.name, part.cls, own, fields_of(own), "")
    return PartUse(_text(part.name), spec, params, part.label.partition(".")[2], _HERE)


def _said(finding: Diagnostic) -> str:
    """A finding on one line."""
    label = f": {finding.label}" if finding.label else ""
    hint = f"; {finding.help}" if finding.help else ""
    return f"{finding.message}{label}{hint}"


def _text(text: str) -> Text:
    return Text(text, _HERE, verbatim=False)
