"""How far a vehicle in the air is from what its behavior wants, tick by tick, for the score."""

from __future__ import annotations

from kybflow.core.geometry import distance
from kybflow.core.signals import NS, Estimate, Setpoint, Time, Truth
from kybflow.parts import AIR, GROUND, Flight, Leg
from kybflow.runtime.monitoring.ground_contact import GroundContact
from kybflow.runtime.scores import VehicleScore


class TrackingErrors:
    """Adds the errors of one vehicle to its score, m and m/s, and says there when it flies."""

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
