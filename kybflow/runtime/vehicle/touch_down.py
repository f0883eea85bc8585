"""Checks whether a vehicle may take off at its position, and whether it has touched down."""

from __future__ import annotations

from kybflow.core.signals import NS, Estimate, Time
from kybflow.world.ground import height_in_the_air
from kybflow.world.vehicle_context import VehicleContext

START_TOLERANCE = 0.25
MAX_TOLERANCE = 2.0
TOLERANCE_SIGMAS = 3.0


def allowed_distance(estimate: Estimate) -> float:
    """Return the largest distance (m) of an estimate from the declared start before take-off:

        allowed = max(25 cm, min(3 spread, 2 m))

    It grows with the spread, because GPS alone is less accurate than motion capture.
    """
    return max(START_TOLERANCE, min(TOLERANCE_SIGMAS * estimate.spread, MAX_TOLERANCE))


def said_distance(estimate: Estimate) -> str:
    """Return a description of the allowed distance, for a message."""
    metres = allowed_distance(estimate)
    if metres <= START_TOLERANCE:
        return f"{metres:.2f} m allowed"
    why = "the most" if metres >= MAX_TOLERANCE else f"{TOLERANCE_SIGMAS:g} times its spread"
    return f"{metres:.2f} m allowed, {why}"


UNCHARTED_HEIGHT = 1.0
CLAIM_TIME_NS: Time = 5 * NS
STILL_HEIGHT = 0.03
CLAIM_BREAK_NS: Time = NS // 10
"""Time without a claim after which the next claim starts a new series."""


class TouchDown:
    """Judges claims of a behavior or of the vehicle's land mode that the vehicle has touched down.

    A claim is refused while a fresh estimate shows the vehicle in the air: more than 5 cm plus
    twice the spread above everything on which it could stand. These are the floor, the obstacles of
    the world, the surface it started from, and the ground that the landing expects. If the estimate
    was too high while the vehicle stood at its start, it is corrected by that error.

    The vehicle may have landed on an object that the mission doesn't name. Up to `UNCHARTED_HEIGHT`
    metres above the known surfaces, a claim is therefore accepted if it is repeated for
    `CLAIM_TIME_NS` without a break while the vehicle is pushed down and its height stays within
    `STILL_HEIGHT` metres, which is impossible in the air.

    expected: the heights at which the landing expects the ground (m).
    off: the estimate's height above the start while the vehicle stood there (m).
    """

    def __init__(
        self, context: VehicleContext, expected: tuple[float, ...] = (), off: float = 0.0
    ) -> None:
        self._context, self._expected = context, expected
        self._off = min(max(off, 0.0), START_TOLERANCE)
        self._since: Time = 0
        self._last: Time | None = None
        self._refused: Time | None = None
        self._height = 0.0

    def refused_for(self, now: Time) -> Time:
        """Return the time since a claim was first refused, zero if none has been."""
        return 0 if self._refused is None else now - self._refused

    def refusal(self, estimate: Estimate | None, now: Time, *, is_pushed: bool) -> str:
        """Return why a claim made now is refused, empty if it is accepted. is_pushed: whether the
        vehicle is commanded to descend."""
        if estimate is None:
            return ""
        x, y, z = estimate.position
        estimate = estimate._replace(position=(x, y, z - self._off))
        above = height_in_the_air(self._context, estimate, self._expected)
        if above <= 0.0 or (self._is_still(z, now, is_pushed) and above < UNCHARTED_HEIGHT):
            return ""
        if self._refused is None:
            self._refused = now
        return f"its estimated height above the ground is {above:.2f} m"

    def _is_still(self, height: float, now: Time, is_pushed: bool) -> bool:
        """Return whether the vehicle has claimed for `CLAIM_TIME_NS` to be on the ground, at a
        constant height although it is commanded to descend."""
        last, self._last = self._last, now
        if (
            not is_pushed
            or last is None
            or now - last > CLAIM_BREAK_NS
            or abs(height - self._height) > STILL_HEIGHT
        ):
            self._since, self._height = now, height
        return now - self._since >= CLAIM_TIME_NS
