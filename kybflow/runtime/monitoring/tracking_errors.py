"""How far a vehicle in the air is from what its behavior wants, tick by tick, for the score.

While the ground carries the vehicle, what it does is no error. In a take-off that is until it is 2
cm higher than where it stood. In a landing the setpoint goes on below the ground: the ground
carries the vehicle once it stays 3 cm above a sinking setpoint, with less than a quarter of its
vertical speed, unless it sinks another 2 cm. The failsafe and the landing judge this by themselves.
"""

from __future__ import annotations

from kybflow.core.geometry import distance
from kybflow.core.signals import NS, Estimate, Setpoint, Time, Truth
from kybflow.parts import AIR, GROUND, Flight, Leg
from kybflow.runtime.scores import VehicleScore

_LIFTED, _BEHIND = 0.02, 0.03
"""Metres."""
_SINKS, _STAYS = -0.05, 0.25
"""The vertical speed (m/s) of a setpoint that sinks; the share of it that the vehicle has."""


class TrackingErrors:
    """Adds the errors of one vehicle (m, m/s) and its time in the air to its score."""

    def __init__(self, score: VehicleScore) -> None:
        self._score = score
        self._contact: GroundContact | None = None
        self._flies = False

    def update(
        self,
        now: Time,
        wanted: Setpoint | None,
        state: Truth | Estimate | None,
        flight: Flight,
        leg: Leg,
    ) -> Setpoint | None:
        """Add the errors of a tick; return what is wanted, None while the ground carries the
        vehicle. state: the truth, or the estimate on hardware. flight, leg: of its behavior."""
        flies = flight is AIR or self._flies_off(wanted, state, flight, leg)
        if flies is not self._flies:
            self._flies = flies
            self._score.airborne(flies, now / NS)
        if wanted is None or not flies:
            return None
        if state is not None:
            position, velocity, score = wanted.position, wanted.velocity, self._score
            if position is not None:
                score.position.add(distance(position, state.position))
            if velocity is not None:
                score.velocity.add(distance(velocity, state.velocity))
        return wanted

    def _flies_off(
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
    """Judges one take-off or landing, the `leg`, which begins at the height `stood`, metres."""

    def __init__(self, leg: Leg, stood: float) -> None:
        self.leg, self._stood = leg, stood
        self._met: float | None = None

    def carries(self, wanted: Setpoint | None, height: float, climb: float) -> bool:
        """Return whether the ground carries the vehicle now; call it once a tick. wanted: what the
        behavior asks for, height and climb: what the vehicle does, m and m/s."""
        if self.leg.end is not GROUND:
            return self.leg.start is GROUND and height < self._stood + _LIFTED
        if self._met is not None and height < self._met - _LIFTED:
            self._met = None
        if self._met is None and wanted is not None and _leaves_behind(wanted, height, climb):
            self._met = height
        return self._met is not None


def _leaves_behind(wanted: Setpoint, height: float, climb: float) -> bool:
    """Return whether a setpoint sinks away below a vehicle that does not follow it."""
    if wanted.position is None or wanted.velocity is None:
        return False
    sinks = wanted.velocity[2]
    return sinks < _SINKS and height > wanted.position[2] + _BEHIND and climb > _STAYS * sinks
