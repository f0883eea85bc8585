"""A landing: by the vehicle's own land mode, and whether a vehicle has touched down."""

from __future__ import annotations

from collections.abc import Callable

from kybflow.core.errors import Refused
from kybflow.core.signals import NS, Estimate, Time
from kybflow.runtime.safety import take_off_tolerance
from kybflow.world.ground import height_in_the_air
from kybflow.world.vehicle_context import VehicleContext

TIMEOUT, SLOWEST = 10.0, 0.2
"""Seconds, and m/s: a landing may take `TIMEOUT` plus the height divided by `SLOWEST`."""
UNCHARTED = 1.0
LONG: Time = 5 * NS
STILL = 0.03
BREAK: Time = NS // 10
"""Time without a claim after which the next one begins anew."""


class LandMode:
    """A landing by the vehicle's own land mode, which the failsafe prefers for the reaction `land`,
    and for `land_blind` where the mode needs no position.

    The autopilot lands by its own estimate; the runtime sends no command meanwhile and requests the
    mode in every tick. If the vehicle refuses, leaves the mode, or has not landed in time (10 s
    plus its height at 0.2 m/s), the state `auto_land` or `land_blind` lands it. land: the link's
    method. height: metres above the expected ground.
    """

    def __init__(self, land: Callable[[Time], bool], now: Time, height: float) -> None:
        self._land = land
        self._timeout = TIMEOUT + max(height, 0.0) / SLOWEST
        self._until = now + round(self._timeout * NS)

    def has_landed(self, now: Time) -> bool:
        """Request the land mode; return whether the vehicle has landed. Called once a tick. Raises
        Refused."""
        if now > self._until:
            raise Refused(f"it has not landed within {self._timeout:.0f} s")
        return self._land(now)


class TouchDown:
    """Judges claims of a behavior or of the vehicle's land mode that the vehicle has touched down.

    A claim is refused while a fresh estimate has the vehicle in the air: more than 5 cm, and twice
    the spread, above everything on which it could stand: the floor, an obstacle of the world, what
    it started from, and where the landing expects the ground. If the estimate was above the start
    when the vehicle stood there, it is corrected by as much. Less than `UNCHARTED` above all this
    there may be something that the mission does not name: there a claim counts that is repeated for
    `LONG` without a break while the vehicle is pushed down and its height stays within `STILL`,
    which no vehicle does in the air.

    expected: the heights at which the landing expects the ground (m). off: how far the estimate had
    the vehicle above its start when it stood there (m).
    """

    def __init__(
        self, context: VehicleContext, expected: tuple[float, ...] = (), off: float = 0.0
    ) -> None:
        self._context, self._expected = context, expected
        self._off = min(max(off, 0.0), take_off_tolerance.LEAST)
        self._since: Time = 0
        self._last: Time | None = None
        self._refused: Time | None = None
        self._height = 0.0

    def refused_for(self, now: Time) -> Time:
        """Return how long ago a claim was refused first, zero before that."""
        return 0 if self._refused is None else now - self._refused

    def refusal(self, estimate: Estimate | None, now: Time, *, is_pushed: bool) -> str:
        """Return why a claim that is made now is refused, empty if it counts. is_pushed: whether
        the vehicle is made to come down."""
        if estimate is None:
            return ""
        x, y, z = estimate.position
        estimate = estimate._replace(position=(x, y, z - self._off))
        above = height_in_the_air(self._context, estimate, self._expected)
        if above <= 0.0 or (self._is_still(z, now, is_pushed) and above < UNCHARTED):
            return ""
        if self._refused is None:
            self._refused = now
        return f"its estimate has it {above:.2f} m above the ground"

    def _is_still(self, height: float, now: Time, is_pushed: bool) -> bool:
        """Return whether the claim has lasted at one height although the vehicle is pushed down."""
        last, self._last = self._last, now
        if (
            not is_pushed
            or last is None
            or now - last > BREAK
            or abs(height - self._height) > STILL
        ):
            self._since, self._height = now, height
        return now - self._since >= LONG
