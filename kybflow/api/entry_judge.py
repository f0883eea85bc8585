"""Judges in flight what a state is to be entered with, by the compiler's own checks and in its
words: as in a mission whose vehicle begins there in that state, with those values.

The checks are imported when they are needed first: a flight that nobody commands doesn't pay.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from kybflow.core.errors import Refused
from kybflow.core.geometry import Vec3
from kybflow.core.params import fields_of
from kybflow.dsl.plan import PartPlan, Plan, Values, VehiclePlan

if TYPE_CHECKING:
    from kybflow.dsl.diagnostics.diagnostic import Diagnostic
    from kybflow.dsl.document import Document, PartUse, StateEntry
    from kybflow.dsl.reading.nodes import MappingEntry

_WRITTEN = "the command"
"""The file that a person's values are read from, as far as a span is concerned."""


class PlanEntryJudge:
    """The judge (`kybflow.runtime.vehicle.requests.EntryJudge`) of a run."""

    def __init__(self, plan: Plan) -> None:
        self._plan = plan

    def read(self, vehicle: str, state: str, written: Values) -> Values:
        from kybflow.dsl.diagnostics.diagnostic import collect
        from kybflow.dsl.reading.nodes import Mapping
        from kybflow.dsl.shaping.entry_values import entry_values

        plan = self._vehicle(vehicle).states[state]
        if plan.built_in:
            raise Refused(f"`{state}` is built in and takes no values")
        entries = {name: self._entry(name, text) for name, text in written}
        asked = Mapping(entries, _span())
        values, found = collect(entry_values(asked, _use(plan.behavior, plan.behavior.params)))
        if found:
            raise Refused(_said(found[0]))
        return values

    def objection(
        self, vehicle: str, state: str, params: Any, points: Sequence[Vec3]
    ) -> str | None:
        from kybflow.dsl.checks.case import Case
        from kybflow.dsl.checks.entry_values import OF_ENTRIES
        from kybflow.parts.catalog import Catalog

        found = (
            finding
            for point in points
            for check in OF_ENTRIES
            for finding in check(Case(self._document(vehicle, state, params, point), Catalog({})))
        )
        first = next(found, None)
        return None if first is None else _said(first)

    def _vehicle(self, name: str) -> VehiclePlan:
        return next(vehicle for vehicle in self._plan.vehicles if vehicle.name == name)

    def _entry(self, name: str, text: str) -> MappingEntry:
        """One value, as a mission would have it. Raises Refused for what is no YAML."""
        from kybflow.dsl.diagnostics.diagnostic import collect
        from kybflow.dsl.reading.composer import compose
        from kybflow.dsl.reading.nodes import MappingEntry, Scalar
        from kybflow.dsl.shaping.world import Points

        node, found = compose(text, _WRITTEN)
        if node is not None:
            node, more = collect(Points(self._plan.points).apply(node))
            found = [*found, *more]
        if node is None or found:
            raise Refused(f"`{name}`: {_said(found[0])}")
        return MappingEntry(Scalar(name, _span()), node)

    def _document(self, vehicle: str, state: str, params: Any, point: Vec3) -> Document:
        """The mission of one vehicle that begins at `point` in its state."""
        from kybflow.dsl.document import Document, ObstacleEntry, VehicleEntry

        plan, own = self._plan, self._vehicle(vehicle)
        entered = self._state(own.states[state].behavior, state, params)
        beginner = VehicleEntry(
            name=_text(vehicle),
            airframe=own.airframe,
            start=point,
            start_span=_span(),
            heading=own.heading,
            estimators=(),
            processors=tuple(_use(part, part.params) for part in own.processors),
            tracker=_use(own.tracker, own.tracker.params),
            supervisors=(),
            driver=_use(own.driver, own.driver.params),
            begin=_text(state),
            states={state: entered},
            span=_span(),
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
                ObstacleEntry(_text(name), shape, _span()) for name, shape in plan.obstacles.items()
            ),
        )

    @staticmethod
    def _state(behavior: PartPlan, state: str, params: Any) -> StateEntry:
        from kybflow.dsl.document import StateEntry

        return StateEntry(_text(state), _use(behavior, params), (), _span())


def _use(part: PartPlan, params: Any) -> PartUse:
    from kybflow.dsl.document import PartUse
    from kybflow.parts.catalog import PartSpec

    own = params.__class__
    spec = PartSpec(part.cls.kind, part.name, part.cls, own, fields_of(own), "")
    label = part.label.partition(".")[2]
    return PartUse(_text(part.name), spec, params, label, _span())


def _said(finding: Diagnostic) -> str:
    """A finding on one line."""
    label = f": {finding.label}" if finding.label else ""
    hint = f"; {finding.help}" if finding.help else ""
    return f"{finding.message}{label}{hint}"


def _span() -> Any:
    from kybflow.dsl.diagnostics.spans import Span

    return Span(_WRITTEN, 1, 1, 1, 1)


def _text(text: str) -> Any:
    from kybflow.dsl.diagnostics.spans import Text

    return Text(text, _span(), verbatim=False)
