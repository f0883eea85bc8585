"""Measures the distance of a vehicle in the air from its behavior's setpoint in each tick, for the
score.

While the vehicle is carried by the ground, no error is counted. In a take-off this ends when the
vehicle is 2 cm above the height at which it stood. In a landing the setpoint sinks below the
ground: the ground carries the vehicle once it is more than 3 cm above a sinking setpoint and sinks
with less than a quarter of the setpoint's speed. If it then sinks another 2 cm, it flies after all.
The failsafe and the landing use their own criteria.
"""

from __future__ import annotations

from kybflow.core.geometry import distance
from kybflow.core.signals import NS, Estimate, Setpoint, Time, Truth
from kybflow.parts import AIR, GROUND, Flight, Leg
from kybflow.runtime.scores import VehicleScore

_LIFTED_HEIGHT, _LAG = 0.02, 0.03
"""Heights above the ground and above the setpoint, m."""
_SINK_SPEED, _CARRIED_RATIO = -0.05, 0.25
"""The vertical velocity (m/s) below which a setpoint sinks, and the fraction of the setpoint's
velocity that the vehicle stays under while the ground carries it."""


class TrackingErrors:
    """Adds the errors of one vehicle (m, m/s) and its time in the air to its score."""

    def __init__(self, score: VehicleScore) -> None:
        self._score = score
        self._contact: GroundContact | None = None
        self._in_air = False

    def update(
        self,
        now: Time,
        wanted: Setpoint | None,
        state: Truth | Estimate | None,
        flight: Flight,
        leg: Leg,
    ) -> Setpoint | None:
        """Add the errors of a tick; return `wanted`, or None while the ground carries the vehicle.

        wanted: the behavior's setpoint.
        state: the ground truth in simulation, the estimate on hardware.
        flight, leg: the flight phase, and the leg of the active behavior.
        """
        in_air = flight is AIR or self._is_lifted(wanted, state, flight, leg)
        if in_air is not self._in_air:
            self._in_air = in_air
            self._score.in_air(in_air, now / NS)
        if wanted is None or not in_air:
            return None
        if state is not None:
            position, velocity, score = wanted.position, wanted.velocity, self._score
            if position is not None:
                score.position.add(distance(position, state.position))
            if velocity is not None:
                score.velocity.add(distance(velocity, state.velocity))
        return wanted

    def _is_lifted(
        self, wanted: Setpoint | None, state: Truth | Estimate | None, flight: Flight, leg: Leg
    ) -> bool:
        """Return whether a vehicle that takes off or lands is above the ground."""
        if flight is GROUND or state is None:
            self._contact = None
            return False
        if self._contact is None or self._contact.leg is not leg:
            self._contact = GroundContact(leg, state.position[2])
        return not self._contact.carries(wanted, state.position[2], state.velocity[2])


class GroundContact:
    """Judges when the ground carries a vehicle in one take-off or landing. leg: the take-off or
    landing. stood: the height at which it begins (m)."""

    def __init__(self, leg: Leg, stood: float) -> None:
        self.leg, self._stood = leg, stood
        self._met: float | None = None

    def carries(self, wanted: Setpoint | None, height: float, climb: float) -> bool:
        """Return whether the ground carries the vehicle now. Must be called once a tick. wanted:
        the behavior's setpoint. height, climb: the vehicle's height (m) and vertical velocity
        (m/s)."""
        if self.leg.end is not GROUND:
            return self.leg.start is GROUND and height < self._stood + _LIFTED_HEIGHT
        if self._met is not None and height < self._met - _LIFTED_HEIGHT:
            self._met = None
        if self._met is None and wanted is not None and _leaves_behind(wanted, height, climb):
            self._met = height
        return self._met is not None


def _leaves_behind(wanted: Setpoint, height: float, climb: float) -> bool:
    """Return whether the setpoint sinks below the vehicle and the vehicle doesn't follow it."""
    if wanted.position is None or wanted.velocity is None:
        return False
    sinks = wanted.velocity[2]
    return (
        sinks < _SINK_SPEED
        and height > wanted.position[2] + _LAG
        and climb > _CARRIED_RATIO * sinks
    )
