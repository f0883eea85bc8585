"""Report another vehicle that is too close.

Alarm `too_close` in the air while the distance of two vehicles' centres, by their estimates, is
less than a bound. The bound is half of both diameters plus `margin`, or `distance` if that is more,
plus the distance in which the two come to rest, c (0.15 s + 15/16 c / (2 m/s^2)), where c is the
speed at which they approach each other. Once raised, the alarm stays until they are 5 cm further
apart. A vehicle without an estimate is ignored. As no vehicles approach each other faster than 20
m/s, a vehicle is checked again when the gap could have closed, after 0.1 s at the latest; one that
is more than 5 m away, when it could be nearer. World frame, metres.

The default reaction is `brake`: both vehicles raise the alarm and hold, and each continues when the
other has left. If neither leaves, they land after the mission's `hover_limit`, each where no other
is below it.
"""

from __future__ import annotations

from collections.abc import Iterator

from kybflow.core.geometry import distance
from kybflow.core.signals import NEVER, NS, Alarm, Estimate, Reaction, ReactionName, Tick, Time
from kybflow.core.units import Length
from kybflow.parts import Objection, Supervisor, param, params
from kybflow.world.vehicle_context import VehicleContext

_HYSTERESIS = 0.05
_CLOSING_SPEED = 20.0
_SAFE_GAP = 5.0
"""Gap (m) at which any two vehicles can still stop."""
_MAX_PAUSE_S = 0.1
_BRAKE_DELAY_S, _DECELERATION = 0.15, 2.0
"""Seconds until a brake takes effect, and the deceleration with which a hold comes to rest,
m/s^2."""


@params
class ProximityParams:
    margin: Length = param(
        "Distance that must remain between two airframes.",
        default=0.05,
        at_least=0.0,
        tightens="up",
    )
    distance: Length = param(
        "Smallest distance between two centres, whatever the vehicles' sizes.",
        default=0.0, at_least=0.0, tightens="up",
    )  # fmt: skip
    reaction: ReactionName = param("What the failsafe does.", default="brake", tightens="up")


class Proximity(Supervisor[ProximityParams]):
    always = True
    unhurried = True
    events = ("too_close",)

    @classmethod
    def keeps_apart(cls, params: ProximityParams, own: float, other: float) -> float:
        return _bound(0.5 * (own + other), params)

    @classmethod
    def objections(cls, params: ProximityParams, context: VehicleContext) -> Iterator[Objection]:
        touching = context.airframe.diameter
        for name, start in context.starts.items():
            other, apart = context.diameters.get(name, touching), distance(context.start, start)
            bound = 0.5 * (touching + other) + params.margin
            if name != context.vehicle and max(touching, other) <= apart <= bound:
                reason = f"alarms at its start: `{name}` is {apart:.3g} m away"
                hint = f"{bound:.3g} m are needed: write a smaller `margin`, or start further apart"
                yield Objection("margin", reason, hint, params.reaction == "warn")

    @classmethod
    def can_emit(cls, context: VehicleContext) -> tuple[str, ...]:
        return cls.events if len(context.diameters) > 1 else ()

    def __init__(self, params: ProximityParams, context: VehicleContext) -> None:
        super().__init__(params, context)
        own = context.airframe.diameter
        self._vehicle = context.vehicle
        self._touching = {name: 0.5 * (own + size) for name, size in context.diameters.items()}
        self._own = own
        self._close: frozenset[str] = frozenset()
        self._next: Time = 0
        self._due: dict[str, Time] = {context.vehicle: NEVER}

    def check(self, tick: Tick, off_ground: bool) -> Alarm | None:
        if len(tick.fleet) < 2 or tick.estimate is None or not off_ground:
            self._close, self._next, self._due = frozenset(), 0, {self._vehicle: NEVER}
            return None
        now, due = tick.now, self._due
        if now < self._next:
            return None
        params = self.params
        here, close = tick.estimate.position, []
        for name, other in tick.fleet.items():
            if now < due.get(name, 0) or other is None:
                continue
            bound = _bound(self._touching.get(name, self._own), params)
            apart = distance(here, other.position)
            gap = apart - bound
            if gap >= _SAFE_GAP:
                due[name] = now + round(max((gap - _SAFE_GAP) / _CLOSING_SPEED, _MAX_PAUSE_S) * NS)
                continue
            bound += _stopping(tick.estimate, other, apart)
            if apart < bound + (_HYSTERESIS if name in self._close else 0.0):
                close.append((apart, bound, name))
            else:
                due[name] = now + round(min(gap / _CLOSING_SPEED, _MAX_PAUSE_S) * NS)
        self._close = frozenset(name for *_, name in close)
        if not close:
            self._next = min(now + round(_MAX_PAUSE_S * NS), *due.values())
            return None
        apart, bound, name = min(close)
        reason = f"{apart:.2f} m from `{name}`, {bound:.2f} m needed"
        return Alarm("too_close", Reaction[self.params.reaction.upper()], reason, apart, bound)


def _bound(touching: float, params: ProximityParams) -> float:
    """Return the least allowed distance (m) of two vehicles' centres. touching: the distance at
    which their airframes touch."""
    return max(touching + params.margin, params.distance)


def _stopping(own: Estimate, other: Estimate, apart: float) -> float:
    """Return the distance (m) in which two vehicles that approach each other come to rest if they
    brake as in `kybflow.runtime.vehicle.hold`; zero if they don't. apart: their distance (m)."""
    px, py, pz = own.position
    qx, qy, qz = other.position
    ux, uy, uz = own.velocity
    vx, vy, vz = other.velocity
    nearing = (ux - vx) * (qx - px) + (uy - vy) * (qy - py) + (uz - vz) * (qz - pz)
    if nearing <= 0.0:
        return 0.0
    closing = nearing / max(apart, 1e-6)
    return closing * (_BRAKE_DELAY_S + 0.9375 * closing / _DECELERATION)
