"""One vehicle of the tree to one of the document: its airframe, its chain of parts, its states."""

from __future__ import annotations

from typing import Any

from kybflow.dsl.built_in import failure_of
from kybflow.dsl.diagnostics import Diagnostic
from kybflow.dsl.document import EstimatorUse, PartUse, State, Transition, Vehicle
from kybflow.dsl.nodes import Entry, Mapping, Node, Scalar, Sequence, entries_of
from kybflow.dsl.source import Span, Text
from kybflow.dsl.uses import Uses
from kybflow.dsl.values import decode, quantity_field
from kybflow.geometry import ZERO
from kybflow.site import Airframe
from kybflow.units import ANGLE, DURATION, LENGTH

CODES = {
    "KYB143": "A transition that says nothing of when, or how long of nothing.",
}
_ESTIMATOR = frozenset({"healthy", "recover_after", "for_at_most"})
_STATE = frozenset({"then", "next", "failed", "within"})


class Vehicles:
    """Decodes vehicles; what is wrong goes to the findings of `uses`."""

    def __init__(self, uses: Uses) -> None:
        self._uses = uses
        self._found = uses.found

    def one(self, entry: Entry, driver: PartUse | None) -> Vehicle | None:
        """The vehicle, None when it has errors."""
        name, body = entry.key, entry.value
        assert isinstance(body, Mapping)
        airframe = self._airframe(name, body)
        start, heading, start_span = self._start(name, body)
        estimators = self._estimators(body)
        processors = self._uses.many("processors", _items(body, "processors"))
        tracker = self._tracker(name, body)
        states = self._states(name, body)
        supervisors = self._supervisors(body, name.span)
        begin = self._begin(body, states)
        if airframe is None or tracker is None or driver is None or begin is None:
            return None
        return Vehicle(
            name=name.as_text,
            airframe=airframe,
            start=start,
            start_span=start_span,
            heading=heading,
            estimators=estimators,
            processors=tuple(use for use, _ in processors),
            tracker=tracker,
            supervisors=supervisors,
            driver=driver,
            begin=begin,
            states=states,
            span=name.span,
            airframe_spans={
                key: e.value.span for key, e in entries_of(body.get("airframe")).items()
            },
        )

    def _missing(self, name: Scalar, key: str, help: str) -> None:
        message = f"the vehicle `{name.text}` needs `{key}`"
        self._found.append(Diagnostic("KYB102", message, name.span, help=help))

    def _airframe(self, name: Scalar, body: Mapping) -> Airframe | None:
        node = body.get("airframe")
        if not isinstance(node, Mapping):
            self._missing(name, "airframe", "name one: `airframe: std.mk_quadro`")
            return None
        head = body.entries["airframe"].key.span
        airframe: Airframe | None = self._uses.params(Airframe, node, "airframe", head)
        return airframe

    def _start(self, name: Scalar, body: Mapping) -> tuple[Any, float, Span]:
        node = body.get("start")
        if not isinstance(node, Mapping):
            return ZERO, 0.0, name.span
        place, turn = node.get("at"), node.get("heading")
        at = quantity_field("at", LENGTH, "vector")
        start = ZERO if place is None else decode(place, at, self._found)
        angle = quantity_field("heading", ANGLE)
        heading = 0.0 if turn is None else decode(turn, angle, self._found)
        return start, heading or 0.0, node.span if place is None else place.span

    def _duration(self, keys: Mapping, key: str, above: float | None = None) -> float | None:
        node = keys.get(key)
        if node is None:
            return None
        at_least = 0.0 if above is None else None
        field = quantity_field(key, DURATION, above=above, at_least=at_least)
        value: float | None = decode(node, field, self._found)
        return value

    def _tracker(self, name: Scalar, body: Mapping) -> PartUse | None:
        node = body.get("tracker")
        if node is None:
            self._missing(name, "tracker", "name one: `tracker: cascade`")
            return None
        return self._uses.one("trackers", node)

    def _estimators(self, body: Mapping) -> tuple[EstimatorUse, ...]:
        uses = self._uses.many("estimators", _items(body, "estimators"), _ESTIMATOR)
        decoded = []
        for use, node in uses:
            keys = node if isinstance(node, Mapping) else Mapping({}, node.span)
            healthy = keys.get("healthy")
            recover = self._duration(keys, "recover_after")
            limit = self._duration(keys, "for_at_most", above=0.0)
            text = healthy.as_text if isinstance(healthy, Scalar) else None
            decoded.append(EstimatorUse(use, text, recover or 0.0, limit))
        return tuple(decoded)

    def _supervisors(self, body: Mapping, span: Span) -> tuple[PartUse, ...]:
        """Those written, then those that every vehicle has."""
        written = [use for use, _ in self._uses.many("supervisors", _items(body, "supervisors"))]
        names = {use.name.text for use in written}
        always = [
            self._uses.one("supervisors", Scalar(spec.name, span))
            for spec in self._uses.catalog.always("supervisors")
            if spec.name not in names
        ]
        return (*written, *(use for use in always if use is not None))

    def _begin(self, body: Mapping, states: dict[str, State]) -> Text | None:
        begin = body.get("begin")
        if isinstance(begin, Scalar):
            return begin.as_text
        return next((state.name for state in states.values()), None)

    def _states(self, name: Scalar, body: Mapping) -> dict[str, State]:
        behaviors = body.get("behaviors")
        if not isinstance(behaviors, Mapping) or not behaviors.entries:
            self._missing(name, "behaviors", "a vehicle does one thing at least")
            return {}
        states = {}
        for key, entry in behaviors.entries.items():
            state = self._state(entry)
            if state is not None:
                states[key] = state
        return states

    def _state(self, entry: Entry) -> State | None:
        name, node = entry.key, entry.value
        use = self._uses.one("behaviors", node, _STATE, "do")
        if use is None or not isinstance(node, Mapping):
            return None
        part = PartUse(use.name, use.spec, use.params, name.text, use.span, use.spans)
        arrows = self._transitions(node, part)
        return State(name.as_text, part, arrows, name.span, entry.inherited)

    def _transitions(self, node: Mapping, part: PartUse) -> tuple[Transition, ...]:
        arrows = [self._next(item) for item in _items(node, "next") if isinstance(item, Mapping)]
        for cause in ("then", "failed"):
            goal = node.get(cause)
            if isinstance(goal, Scalar):
                arrows.append(Transition(cause, goal.as_text, goal.span))
        limit = node.get("within")
        after = self._duration(node, "within", above=0.0)
        if limit is not None and after is not None:
            failed = node.get("failed")
            implied = Text(failure_of(part.spec.cls.flight), limit.span, verbatim=False)
            target = failed.as_text if isinstance(failed, Scalar) else implied
            arrows.append(Transition("within", target, limit.span, after=after))
        return tuple(arrows)

    def _timeless(self, message: str, span: Span, help: str) -> None:
        self._found.append(Diagnostic("KYB143", message, span, help=help))

    def _next(self, node: Mapping) -> Transition:
        when, event, goal = node.get("when"), node.get("event"), node.get("go")
        assert isinstance(goal, Scalar)
        if when is None and event is None and node.get("after") is None:
            message, hint = f"nothing says when to go to `{goal.text}`", "`event: NAME` or"
            self._timeless(message, goal.span, f"add `when: CONDITION`, {hint} `after: 10 s`")
        elif when is None and node.get("for") is not None:
            message = f"nothing says what must hold before it goes to `{goal.text}`"
            self._timeless(message, node.entries["for"].key.span, "`for` belongs to a `when`")
        return Transition(
            "next",
            goal.as_text,
            node.span,
            when=when.as_text if isinstance(when, Scalar) else None,
            event=event.as_text if isinstance(event, Scalar) else None,
            after=self._duration(node, "after"),
            hold=self._duration(node, "for") or 0.0,
        )


def _items(body: Mapping, key: str) -> tuple[Node, ...]:
    node = body.get(key)
    return node.items if isinstance(node, Sequence) else ()
