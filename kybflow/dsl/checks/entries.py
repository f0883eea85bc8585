"""From which positions each behavior can be entered, as far as that can be told before the
flight."""

from __future__ import annotations

from dataclasses import dataclass, field

from kybflow.core.geometry import Vec3, distance
from kybflow.dsl.document import State, Transition, Vehicle
from kybflow.parts import GROUND

_MOST = 16
_SAME = 1e-6


@dataclass(slots=True)
class Entries:
    """The entries of one state. `known` is false when it can also be entered from elsewhere."""

    points: list[Vec3] = field(default_factory=list)
    known: bool = True

    def add(self, point: Vec3 | None) -> bool:
        """Note an entry; whether it is a new one. More than a few are as good as any."""
        if point is None or len(self.points) >= _MOST:
            changed, self.known = self.known, False
            return changed
        if any(distance(point, p) < _SAME for p in self.points):
            return False
        self.points.append(point)
        return True

    def asked(self) -> list[Vec3 | None]:
        """The entries to ask a footprint for; None stands for one that is unknown."""
        return [*self.points] if self.known else [*self.points, None]


def entries_of(vehicle: Vehicle) -> dict[str, Entries]:
    """The entries of every state of the vehicle that is reached, from its start on. One that a
    callback or a flow may ask for is also entered from anywhere; where a flow's first wish finds
    it, it waits at its start."""
    if "entries" not in vehicle.known:
        vehicle.known["entries"] = _walked(vehicle)
    found: dict[str, Entries] = vehicle.known["entries"]
    return found


def _walked(vehicle: Vehicle) -> dict[str, Entries]:
    found = {vehicle.begin.text: Entries([vehicle.start])}
    waiting: list[tuple[str, Vec3 | None]] = [(vehicle.begin.text, vehicle.start)]
    for name in sorted(vehicle.asked):
        found.setdefault(name, Entries()).add(None)
        waiting.append((name, None))
    for name in sorted(vehicle.asked_first):
        found[name].add(vehicle.start)
        waiting.append((name, vehicle.start))
    while waiting:
        name, entry = waiting.pop()
        state = vehicle.states.get(name)
        if state is None:
            found.pop(name, None)
            continue
        for transition in state.transitions:
            left = _left_at(state, transition, entry)
            target = transition.target.text
            if target in vehicle.states and found.setdefault(target, Entries()).add(left):
                waiting.append((target, left))
    return found


def endless_states(vehicle: Vehicle) -> frozenset[str]:
    """The states whose behavior has no normal end, as its parameters are."""
    found = set()
    for name, entries in entries_of(vehicle).items():
        state = vehicle.states[name]
        footprints = (state.footprint(entry) for entry in entries.asked())
        if any(footprint is not None and footprint.is_endless for footprint in footprints):
            found.add(name)
    return frozenset(found)


def _left_at(state: State, transition: Transition, entry: Vec3 | None) -> Vec3 | None:
    """Where an arrow leaves the vehicle; None when that can't be told."""
    cls = state.part.spec.cls
    if all(leg.start is GROUND and leg.end is GROUND for leg in cls.flight):
        return entry
    footprint = state.footprint(entry)
    if footprint is None:
        return None
    if transition.cause == "then":
        return footprint.exit
    stays = footprint.points and all(
        distance(p, footprint.points[0]) < _SAME for p in footprint.points
    )
    return footprint.points[0] if stays else None
