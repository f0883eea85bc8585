"""Watches a rehearsal and makes findings from its events and from the vehicles' positions.

For each vehicle and state it keeps the first error and the first warning. Once a vehicle has a
finding, its built-in states add none, so that one mistake is reported once. A finding also names
the lines of the mission that have changed options or processors of its vehicles by then.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import combinations
from math import dist, inf
from typing import NamedTuple

from kybflow.api.rehearsal import findings
from kybflow.api.rehearsal.findings import Arrival, Arrivals, Doing, Texts, Waiting, span_at
from kybflow.core.geometry import Vec3, distance, least_distance, sub
from kybflow.core.params import named_in
from kybflow.core.signals import Event
from kybflow.core.units import DURATION, format_quantity
from kybflow.dsl.diagnostics import Diagnostic, Related
from kybflow.dsl.expressions.tree import describe
from kybflow.dsl.plan import Plan, StatePlan, TransitionPlan
from kybflow.parts import GROUND
from kybflow.runtime.engine import Engine
from kybflow.runtime.vehicle.vehicle import Vehicle

TIME_LIMIT_MARGIN_S = 0.3
"""How long before the time limit the unfinished flows and vehicles are noted, s."""
FENCE_TOLERANCE = 0.01
"""Distance outside the fence above which a position counts as outside, m; less is rounding error.
"""


class LeastSeparation(NamedTuple):
    """The least distance between two vehicles of which at least one was flying, and when it
    occurred."""

    metres: float
    seconds: float
    pair: tuple[str, str]


class LeastCharge(NamedTuple):
    """The least battery charge, from 0 to 1, and its vehicle."""

    remaining: float
    vehicle: str


class Watch:
    """Receives the events of a rehearsal, and observes its engine after every tick. separation,
    charge: the least values so far, None before the first."""

    def __init__(self, plan: Plan, texts: Texts) -> None:
        self.separation: LeastSeparation | None = None
        self.charge: LeastCharge | None = None
        self._plan, self._texts = plan, texts
        self._found: dict[tuple[str, ...], Diagnostic] = {}
        self._engine: Engine | None = None
        self._arrivals: Arrivals | None = None
        self._vehicles: dict[str, Vehicle] = {}
        self._wrong: set[str] = set()
        self._changes: defaultdict[str, dict[str, Related]] = defaultdict(dict)
        self._flown: defaultdict[str, list[StatePlan]] = defaultdict(list)
        self._ended_flows: list[Related] = []
        self._before: dict[str, Vec3] = {}
        self._widest = 0.0
        self._unfinished: tuple[Waiting | None, tuple[str, ...]] = (None, ())
        self._handlers = {
            "collided": self._collided,
            "landed_hard": self._landed_hard,
            "clamp_started": self._clamped,
            "failsafe_started": self._failsafe,
            "behavior_failed": self._failed,
            "behavior_started": self._started,
            "behavior_ended": self._ended,
            "behavior_waits": self._behavior_waits,
            "switch_refused": self._switch_refused,
            "part_failed": self._part_failed,
            "phase_ended": self._phase_ended,
            "flow_ended": self._flow_ended,
            "preflight_failed": self._preflight_failed,
            "option_changed": self._option_changed,
            "processor_disabled": self._processor_disabled,
            "processor_enabled": self._processor_enabled,
        }

    def begin(self, engine: Engine) -> None:
        """Attach to an engine. Called before the engine runs."""
        self._engine, self._arrivals = engine, Arrivals(engine)
        self._vehicles = {vehicle.name: vehicle for vehicle in engine.vehicles}
        self._widest = 2.0 * max(map(_half_needed, engine.vehicles))

    @property
    def diagnostics(self) -> tuple[Diagnostic, ...]:
        """The findings so far. If two vehicles collide, only the collision is reported for this
        pair."""
        hit = {key[1:] for key in self._found if key[0] == "KYB470"}
        return tuple(
            d for key, d in self._found.items() if key[0] == "KYB470" or key[1:] not in hit
        )

    def on_event(self, event: Event) -> None:
        handler = self._handlers.get(event.name)
        if handler is not None:
            handler(event)

    def on_tick(self, engine: Engine) -> None:
        """Check the vehicles' batteries, and their positions against the fence and against each
        other."""
        left = self._plan.time_limit - engine.mission_seconds()
        if 0.0 < left < TIME_LIMIT_MARGIN_S:  # before the engine lands the vehicles that still fly
            self._unfinished = (next(_unfinished(engine), None), self._states())
        places = {v.name: v.truth.position for v in engine.vehicles if v.truth is not None}
        before, self._before = self._before, places
        for vehicle in engine.vehicles:
            battery = vehicle.battery
            if battery is not None:
                if self.charge is None or battery.remaining < self.charge.remaining:
                    self.charge = LeastCharge(battery.remaining, vehicle.name)
                if battery.remaining <= 0.0 and vehicle.airborne:
                    empty = findings.battery_ended(self._doing(vehicle))
                    self._add(empty, vehicle.name)
            if vehicle.name in places and vehicle.airborne:
                self._check_fence(vehicle, places[vehicle.name])
        self._check_pairs(engine, before, places)

    def _check_pairs(
        self, engine: Engine, before: dict[str, Vec3], places: dict[str, Vec3]
    ) -> None:
        """Check each pair whose distance since the last tick may be too small or the least so
        far."""
        known = [
            (vehicle, vehicle.airborne, places[vehicle.name], before[vehicle.name])
            for vehicle in self._vehicles.values()
            if vehicle.name in before and vehicle.name in places
        ]
        moved = 2.0 * max((distance(now, then) for *_, now, then in known), default=0.0)
        for (one, flies, here, was), (other, other_flies, there, went) in combinations(known, 2):
            least = inf if self.separation is None else self.separation.metres
            near = distance(here, there) < max(least, self._widest) + moved
            if not near or not (flies or other_flies):
                continue
            gap, pair = least_distance(sub(was, went), sub(here, there)), (one.name, other.name)
            if gap < least:
                self.separation = LeastSeparation(gap, engine.seconds(), pair)
            needed = _needed(one, other)
            collides = gap < one.context.airframe.arm + other.context.airframe.arm
            if gap < needed and not collides and flies and other_flies:
                own, beside = self._doing(one), self._doing(other)
                mend = self._apart(one, other, needed)
                self._add(findings.too_close(own, beside, gap, needed, mend), *sorted(pair))

    def end(self, engine: Engine) -> None:
        """Make the findings about the end. Called after the engine has stopped."""
        waiting, notes = self._unfinished
        if waiting is not None and engine.mission_seconds() >= self._plan.time_limit:
            limit = self._plan.time_limit
            self._add(findings.not_finished(waiting, limit, notes, self._texts))
        for one, other in combinations(engine.vehicles, 2):
            pair = sorted((one.name, other.name))
            if _rest_together(one, other) and ("KYB470", *pair) not in self._found:
                own, beside = self._doing(one), self._doing(other)
                found = findings.common_place(own, beside, rests=True)
                self._add(found, *pair)

    def _check_fence(self, vehicle: Vehicle, place: Vec3) -> None:
        fence = vehicle.context.fence
        if fence is None:
            return
        x, y, z = place
        floor = min(fence.low[2], vehicle.context.start[2])
        beyond = fence.outside_by((x, y, max(z, fence.low[2]) if z >= floor else z))
        if beyond > FENCE_TOLERANCE and not _is_steered(vehicle):
            why = f"{beyond:.2f} m outside the fence"
            found = findings.left_the_fence(self._doing(vehicle), why, "", is_vertical=False)
            self._add_in(vehicle.runner.state, vehicle, found)

    def _collided(self, event: Event) -> None:
        vehicle, into = self._vehicles[event.vehicle], str(event.fields["into"])
        other = self._vehicles.get(into)
        own = self._doing(vehicle)
        if other is None:
            self._add(findings.ran_into(own, into), vehicle.name, into)
        else:
            mend = self._apart(vehicle, other, _needed(vehicle, other))
            found = findings.collided(own, self._doing(other), mend)
            self._add(found, *sorted((vehicle.name, into)))

    def _landed_hard(self, event: Event) -> None:
        vehicle, speed = self._vehicles[event.vehicle], event.fields["speed"]
        assert isinstance(speed, float)
        found = findings.landed_hard(self._doing(vehicle), speed)
        self._add_in(vehicle.runner.state, vehicle, found)

    def _clamped(self, event: Event) -> None:
        vehicle = self._vehicles[event.vehicle]
        if _is_steered(vehicle):
            return
        own, why = self._doing(vehicle), str(event.fields["reason"])
        found = findings.left_the_fence(
            own, why, event.at, is_vertical=GROUND in vehicle.runner.leg
        )
        self._add_in(vehicle.runner.state, vehicle, found)

    def _failsafe(self, event: Event) -> None:
        vehicle, why = self._vehicles[event.vehicle], str(event.fields["reason"])
        if vehicle.requests.retired == why:
            return  # the engine lands it at the time limit, which has a finding of its own
        own, reaction = self._doing(vehicle), str(event.fields["reaction"])
        named = [o for o in self._vehicles.values() if f"`{o.name}`" in why]
        others, bound = tuple(self._doing(other).note for other in named), event.fields.get("bound")
        mend = None
        if named and isinstance(bound, float):
            mend = self._apart(vehicle, named[0], bound)
        found = findings.failsafe_acted(own, reaction, why, event.at, others, mend)
        self._add_in(vehicle.runner.state, vehicle, found)

    def _failed(self, event: Event) -> None:
        vehicle, why = self._vehicles[event.vehicle], str(event.fields["reason"])
        state = vehicle.plan.states[str(event.fields["behavior"])]
        if not _steers(state):
            self._add_in(state, vehicle, findings.failed(self._doing_in(vehicle, state), why))

    def _part_failed(self, event: Event) -> None:
        vehicle = self._vehicles[event.vehicle]
        why = f"`{event.fields['part']}` failed: {event.fields['reason']}"
        found = findings.failed(self._doing(vehicle), why)
        self._add_in(vehicle.runner.state, vehicle, found)

    def _switch_refused(self, event: Event) -> None:
        """Handle a state, requested by a flow or a callback, that can't be entered."""
        vehicle, wanted = self._vehicles[event.vehicle], str(event.fields["state"])
        if event.fields["by"] == "mission" or vehicle.name in self._wrong:
            return
        own, why = self._doing(vehicle), str(event.fields["reason"])
        found = findings.refused(own, wanted, why, event.at or own.span.at, self._texts)
        self._add(found, vehicle.name, wanted)

    def _started(self, event: Event) -> None:
        assert self._arrivals is not None
        self._arrivals.started(event)
        vehicle = self._vehicles[event.vehicle]
        name, flown = vehicle.name, self._flown[vehicle.name]
        flown.append(vehicle.plan.states[str(event.fields["behavior"])])
        own = next((state for state in reversed(flown) if not state.built_in), None)
        is_left = [state.name for state in flown[-2:]] == ["hover", "auto_land"]
        is_ending = name in self._wrong or vehicle.requests.retired is not None
        if own is not None and is_left and not is_ending:
            doing, limit = self._doing_in(vehicle, own), self._plan.hover_limit
            self._add(findings.left_hovering(doing, limit, tuple(self._ended_flows)), name)

    def _flow_ended(self, event: Event) -> None:
        flow = self._plan.flows_by_name[str(event.fields["flow"])]
        phase = flow.phases.get(str(event.fields["phase"]))
        if phase is not None:
            span = span_at(phase.at, self._texts)
            self._ended_flows.append(Related(span, f"`{flow.name}` ends with this phase"))

    def _ended(self, event: Event) -> None:
        vehicle, how = self._vehicles[event.vehicle], event.fields["how"]
        state = vehicle.plan.states[str(event.fields["behavior"])]
        footprint = state.behavior.cls.footprint(state.behavior.params, vehicle.context.start)
        if how == "within" and (footprint is None or not footprint.is_endless):
            own = self._doing_in(vehicle, state)
            limit = next((t.after for t in state.transitions if t.cause == "within"), None)
            self._add_in(state, vehicle, findings.timed_out(own, limit))

    def _behavior_waits(self, event: Event) -> None:
        """Handle a landing that waits because another vehicle, presumably the nearest, is below."""
        vehicle = self._vehicles[event.vehicle]
        truths = {name: v.truth for name, v in self._vehicles.items()}
        places = {name: t.position[:2] for name, t in truths.items() if t is not None}
        place = places.pop(vehicle.name, None)
        lands = vehicle.runner.leg.end is GROUND and vehicle.airborne
        if lands and place is not None and places:
            other = self._vehicles[min(places, key=lambda name: dist(places[name], place))]
            own, beside = self._doing(vehicle), self._doing(other)
            found = findings.common_place(own, beside, rests=False)
            self._add(found, vehicle.name, other.name)

    def _phase_ended(self, event: Event) -> None:
        if event.fields["how"] != "within":
            return
        assert self._engine is not None
        flow = self._plan.flows_by_name[str(event.fields["flow"])]
        phase = flow.phases[str(event.fields["phase"])]
        seconds = self._engine.seconds()
        found = findings.phase_timed_out(flow.name, phase, seconds, self._states(), self._texts)
        self._add(found, flow.name, phase.name)

    def _preflight_failed(self, event: Event) -> None:
        check, why = str(event.fields["check"]), str(event.fields["reason"])
        at = event.at or self._plan.vehicles[0].at
        self._add(findings.stays_down(event.vehicle, check, why, at, self._texts), event.vehicle)

    def _option_changed(self, event: Event) -> None:
        option, value = event.fields["option"], event.fields["value"]
        self._change(event, str(option), f"`{option}` is {value} by then")

    def _processor_disabled(self, event: Event) -> None:
        label = f"{event.vehicle}.{event.fields['processor']}"
        self._change(event, label, f"`{label}` is off by then")

    def _processor_enabled(self, event: Event) -> None:
        self._changes[event.vehicle].pop(f"{event.vehicle}.{event.fields['processor']}", None)

    def _change(self, event: Event, what: str, label: str) -> None:
        if event.at:
            self._changes[event.vehicle][what] = Related(span_at(event.at, self._texts), label)

    def _apart(self, one: Vehicle, other: Vehicle, needed: float) -> Arrival | None:
        assert self._arrivals is not None
        return self._arrivals.apart(one, other, needed)

    def _states(self) -> tuple[str, ...]:
        return tuple(self._doing(vehicle).note for vehicle in self._vehicles.values())

    def _doing(self, vehicle: Vehicle) -> Doing:
        plan, runner = vehicle.plan, vehicle.runner
        return self._doing_in(vehicle, runner.state if runner.begun else plan.states[plan.begin])

    def _doing_in(self, vehicle: Vehicle, state: StatePlan) -> Doing:
        assert self._engine is not None
        truth = vehicle.truth
        place = vehicle.context.start if truth is None else truth.position
        at, seconds = state.at or vehicle.plan.at, self._engine.seconds()
        part, runner, waits_for = state.behavior.name, vehicle.runner, ""
        if runner.begun and state is runner.state:
            waits_for = runner.behavior.waits_for or ""
        span = span_at(at, self._texts)
        return Doing(vehicle.name, state.name, part, span, seconds, place, waits_for)

    def _add(self, found: Diagnostic, *about: str) -> None:
        """Keep a finding unless there is one with its code and the names `about`."""
        self._found.setdefault((found.code, *about), self._with_changes(found, about))

    def _add_in(self, state: StatePlan, vehicle: Vehicle, found: Diagnostic) -> None:
        """Keep a finding unless the vehicle has one of its severity in this state."""
        if state.built_in and vehicle.name in self._wrong:
            return
        self._wrong.add(vehicle.name)
        found = self._with_changes(found, (vehicle.name,))
        self._found.setdefault((vehicle.name, state.name, found.severity.value), found)

    def _with_changes(self, found: Diagnostic, about: Iterable[str]) -> Diagnostic:
        changes = [one for name in about for one in self._changes.get(name, {}).values()]
        return replace(found, related=(*found.related, *changes))


def _half_needed(vehicle: Vehicle) -> float:
    """Return half the distance at which the rotor discs of two equal vehicles don't overlap and
    their bumpers don't touch, m."""
    frame = vehicle.context.airframe
    return max(frame.arm + 0.5 * frame.rotor_radius, frame.bumper or 0.0)


def _needed(one: Vehicle, other: Vehicle) -> float:
    return _half_needed(one) + _half_needed(other)


def _rest_together(one: Vehicle, other: Vehicle) -> bool:
    """Return whether two vehicles that started apart rest on each other."""
    a, b = one.truth, other.truth
    if a is None or b is None or one.airborne or other.airborne:
        return False
    apart = one.context.airframe.arm + other.context.airframe.arm
    began = distance(one.context.start, other.context.start)
    return distance(a.position, b.position) < min(apart, began - FENCE_TOLERANCE)


def _steers(state: StatePlan) -> bool:
    """Return whether an input steers in this state, so that a person decides what the vehicle
    does."""
    return bool(named_in(state.behavior.params, "input"))


def _is_steered(vehicle: Vehicle) -> bool:
    return _steers(vehicle.runner.state)


def _unfinished(engine: Engine) -> Iterator[Waiting]:
    """Yield the flows and vehicles that keep the mission from ending."""
    for plan in engine.plan.flows:
        flow = engine.flows.running(plan.name)
        if flow.active:
            phase = flow.phase
            yield Waiting(plan.name, phase.name, phase.at, _awaits(phase.transitions))
    for vehicle in engine.vehicles:
        state = vehicle.runner.state
        if not vehicle.rests:
            at = state.at or vehicle.plan.at
            yield Waiting(vehicle.name, state.name, at, _awaits(state.transitions))


def _awaits(transitions: Iterable[TransitionPlan]) -> str:
    """Return a description of what ends a state or phase."""
    words = []
    for one in transitions:
        if one.implied:
            continue
        if one.event is not None:
            words.append(f"the event `{one.event}`")
        elif one.when is not None:
            words.append(f"`{describe(one.when)}`")
        elif one.after is not None and one.cause == "next":
            words.append(f"{format_quantity(one.after, DURATION)} to pass")
    return " or ".join(dict.fromkeys(words)) or "the end of its behavior"
