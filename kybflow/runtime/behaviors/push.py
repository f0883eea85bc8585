"""Press against a surface of an object, square to it, with a constant or a shared force.

The vehicle leans towards the surface: its tracker is given the acceleration F / m towards it as
feed-forward, the surface's own velocity, and the velocity that leads back to the surface's middle,
and doesn't counter what pushes it back. In contact, the surface then carries about F:

    F = m g tan(tilt)

With 420 g, 5 degrees are 0.36 N. The friction of a surface at the vehicle's rim tilts it by up to
1.5 degrees, so a slow integral of the measured tilt corrects the feed-forward. If the object moves
at `speed`, the force has fallen to zero, so that a free object isn't chased. The force rises within
half a second.

It is done when the object is at the stop of its joint towards which it is pushed. It no longer
presses and fails within 0.2 s when contact is broken, the object isn't seen, or the coordinator no
longer gives it a force, and with a `force` after `patience` if the surface doesn't move. Enter it
in contact, after `approach_contact`, whose touch peaks at about 0.7 N; it also fails if contact
isn't seen within a second. World frame, SI.

Sources: static contact by feed-forward of force on a vehicle with a fast attitude loop, "Static
equilibrium of unidirectional-thrust multirotors in contact", arXiv 2306.12167.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import tan

from kybflow.core.geometry import GRAVITY, Vec3, body_z, distance, dot, scale
from kybflow.core.signals import Done, Failed, Setpoint, SetpointKind, Tick
from kybflow.core.units import FORCE, Duration, Force, Speed, format_quantity
from kybflow.flight.manipulation.contact import TouchSense
from kybflow.parts import AIR, Behavior, Entry, Objection, param, params
from kybflow.runtime.behaviors import _surface
from kybflow.world.freedoms import freedoms_of
from kybflow.world.objects import Face, Placement
from kybflow.world.vehicle_context import VehicleContext

_RISE_S = 0.5
_TRIM_S, _MOST_TRIM = 1.0, 0.4
"""The time, s, and the bound, m/s^2, of the integral that corrects the feed-forward."""
_ENTRY_S = 1.0
"""The time in which contact must be seen after the entry, s."""
_MOVED = 0.01
"""How far a surface has moved that moves, m."""
_AT_STOP, _AT_TURNED_STOP = 0.01, 0.02
"""How near a stop of a slide, m, and of a turn, rad, counts as there."""
_LEVER = 0.1
"""The least part of a push along a joint, or its least arm, m, that moves the joint."""
_UNGIVEN_S = 0.1
"""How long after the entry the coordinator may give no force yet, s."""


@params
class PushBehaviorParams:
    surface: str = _surface.surface_param()
    force: Force | None = param(
        "Force against the surface; without it, the one that the coordinator of the vehicle's flow "
        "gives it.",
        default=None, above=0.0,
    )  # fmt: skip
    speed: Speed = param(
        "Speed of the object at which the vehicle no longer presses.", default=0.2, above=0.02
    )
    patience: Duration = param(
        "Time after which the behavior fails if the surface hasn't moved by 1 cm.",
        default=20.0, above=1.0,
    )  # fmt: skip


class PushBehavior(Behavior[PushBehaviorParams], flight=AIR >> AIR, emits=SetpointKind.VELOCITY):
    def __init__(self, params: PushBehaviorParams, entry: Entry) -> None:
        super().__init__(params, entry)
        self._context = entry.context
        self._touch = TouchSense(entry.context.airframe.bumper or 0.0)
        self._freedoms = freedoms_of(entry.context.objects, params.surface.partition(".")[0])
        self._touched = False
        self._place: Vec3 | None = None
        self._moved = self._trim = 0.0

    def update(self, tick: Tick) -> Setpoint | Done | Failed:
        p, known = self.params, tick.known()
        face, trouble = _surface.look(p.surface, self._context, tick)
        if face is None:
            return Failed(Setpoint(SetpointKind.VELOCITY, None, known.velocity), trouble)
        rest = _surface.facing(face, known.position, self._context, 0.0, 0.0)._replace(presses=None)
        touches = self._touch.update(face, known, tick.dt)
        self._touched = self._touched or touches
        if not trouble and not touches and (self._touched or tick.elapsed > _ENTRY_S):
            gap = self._touch.gap(face, known.position)
            verb = "lost contact with" if self._touched else "doesn't touch"
            trouble = f"the vehicle {verb} `{p.surface}`, {gap:.3f} m away"
        force = p.force if p.force is not None else tick.share
        if force is None and tick.elapsed > _UNGIVEN_S:
            trouble = trouble or "no coordinator gives it a force"
        if trouble or (p.force is not None and self._is_stuck(face, tick.elapsed)):
            return Failed(rest, trouble or f"`{p.surface}` has not moved for {p.patience:g} s")
        if self._at_stop(face, tick):
            return Done(rest)
        ahead = -dot(face.velocity, face.outward)
        share = min(1.0, max(0.0, 2.0 - 2.0 * ahead / p.speed)) * min(1.0, tick.elapsed / _RISE_S)
        push = share * (force or 0.0) / self._context.airframe.mass
        if touches:
            up = body_z(known.attitude)
            lean = -GRAVITY * dot(up, face.outward) / up[2]
            trim = self._trim + tick.dt / _TRIM_S * (push - lean)
            self._trim = min(_MOST_TRIM, max(-_MOST_TRIM, trim))
        push = max(0.0, push + share * self._trim)
        return _surface.facing(face, known.position, self._context, 0.0, push)

    def _is_stuck(self, face: Face, elapsed: float) -> bool:
        """Return whether the surface has not moved for `patience`."""
        if self._place is None or distance(self._place, face.centre) > _MOVED:
            self._place, self._moved = face.centre, elapsed
        return elapsed - self._moved > self.params.patience

    def _at_stop(self, face: Face, tick: Tick) -> bool:
        """Return whether the object, or what it is on, is at the stop to which it is pushed."""
        inwards = scale(face.outward, -1.0)
        for free in self._freedoms:
            seen = tick.objects.get(free.object)
            if free.low is None or free.high is None or seen is None:
                continue
            lever = free.lever(Placement(seen.position, seen.attitude), face.centre, inwards)
            left = free.high - seen.q if lever > 0.0 else seen.q - free.low
            if left < (_AT_TURNED_STOP if free.turns else _AT_STOP) and abs(lever) > _LEVER:
                return True
        return False

    @classmethod
    def pushes(cls, params: PushBehaviorParams) -> tuple[str, float | None]:
        return params.surface, params.force

    @classmethod
    def objections(cls, params: PushBehaviorParams, context: VehicleContext) -> Iterator[Objection]:
        found = list(_surface.objections(params.surface, context))
        yield from found
        frame = context.airframe
        most = frame.hover_thrust * tan(frame.tilt)
        if params.force is not None and params.force > most:
            bound = format_quantity(most, FORCE)
            reason = f"is more than the {bound} of the largest tilt, m g tan(tilt)"
            yield Objection("force", reason, f"write at most `force: {bound}`")
