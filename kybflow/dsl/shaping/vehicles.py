"""One vehicle of the tree to one of the document: its airframe, its chain of parts, its states."""

from __future__ import annotations

from typing import Any

from kybflow.core.geometry import ZERO
from kybflow.core.units import ANGLE, LENGTH
from kybflow.dsl.diagnostics.diagnostic import Diagnostic
from kybflow.dsl.document import EstimatorUse, PartUse, Vehicle
from kybflow.dsl.reading.nodes import Entry, Mapping, Scalar, entries_of
from kybflow.dsl.reading.source import Span, Text
from kybflow.dsl.reading.values import decode, quantity_field
from kybflow.dsl.schema.skeleton import ESTIMATOR_KEYS
from kybflow.dsl.shaping.arrows import duration
from kybflow.dsl.shaping.states import States
from kybflow.dsl.shaping.uses import Uses
from kybflow.dsl.shaping.world.cameras import cameras_of, without_cameras
from kybflow.world.vehicle_context import Airframe, Parcel


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
        processors = self._uses.many("processors", body.get("processors"))
        tracker = self._tracker(name, body)
        states = self._states(name, body)
        supervisors = self._supervisors(body, name.span)
        begin = _begin(body, states)
        home = body.get("home")
        home_at = quantity_field("home", LENGTH, "vector")
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
            states=states.states,
            span=name.span,
            airframe_spans={
                key: e.value.span for key, e in entries_of(body.get("airframe")).items()
            },
            home=None if home is None else decode(home, home_at, self._found),
            home_span=None if home is None else home.span,
            spans={key: e.key.span for key, e in body.entries.items()},
            chains=states.chains,
            cameras=tuple(cameras_of(body.get("airframe"), self._found)),
            payload=self._payload(body),
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
        own = without_cameras(node)
        airframe: Airframe | None = self._uses.params(Airframe, own, "airframe", head)
        return airframe

    def _payload(self, body: Mapping) -> Parcel | None:
        node = body.get("payload")
        if not isinstance(node, Mapping):
            return None
        head = body.entries["payload"].key.span
        payload: Parcel | None = self._uses.params(Parcel, node, "payload", head)
        return payload

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

    def _tracker(self, name: Scalar, body: Mapping) -> PartUse | None:
        node = body.get("tracker")
        if node is None:
            self._missing(name, "tracker", "name one: `tracker: cascade`")
            return None
        return self._uses.one("trackers", node)

    def _estimators(self, body: Mapping) -> tuple[EstimatorUse, ...]:
        keys_of = frozenset(ESTIMATOR_KEYS)
        uses = self._uses.many("estimators", body.get("estimators"), keys_of)
        decoded = []
        for use, node in uses:
            keys = node if isinstance(node, Mapping) else Mapping({}, node.span)
            healthy = keys.get("healthy")
            recover = duration(keys, "recover_after", self._found)
            limit = duration(keys, "for_at_most", self._found, above=0.0)
            text = healthy.as_text if isinstance(healthy, Scalar) else None
            decoded.append(EstimatorUse(use, text, recover or 0.0, limit))
        return tuple(decoded)

    def _supervisors(self, body: Mapping, span: Span) -> tuple[PartUse, ...]:
        """Those written, then those that every vehicle has."""
        uses = self._uses.many("supervisors", body.get("supervisors"))
        written = [use for use, _ in uses]
        names = {use.name.text for use in written}
        always = [
            self._uses.one("supervisors", Scalar(spec.name, span))
            for spec in self._uses.catalog.always("supervisors")
            if spec.name not in names
        ]
        return (*written, *(use for use in always if use is not None))

    def _states(self, name: Scalar, body: Mapping) -> States:
        behaviors = body.get("behaviors")
        if not isinstance(behaviors, Mapping) or not behaviors.entries:
            self._missing(name, "behaviors", "a vehicle does one thing at least")
            behaviors = Mapping({}, name.span)
        elif body.entries["behaviors"].inherited:
            own = {k: e._replace(inherited=True) for k, e in behaviors.entries.items()}
            behaviors = Mapping(own, behaviors.span)
        return States(behaviors, self._uses)


def _begin(body: Mapping, states: States) -> Text | None:
    """The first state: the one that is named, else the topmost."""
    begin = body.get("begin")
    if isinstance(begin, Scalar):
        return states.goal(begin.as_text)[0]
    return next((state.name for state in states.states.values()), None)
