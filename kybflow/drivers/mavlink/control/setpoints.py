"""The setpoints sent to an autopilot: their rate, their latency compensation, and their throttle.

`SetpointStream` sends the newest command at its own rate and repeats it until the command is 250 ms
old. Then it stops, and the vehicle's own watchdog acts.

`compensated` extrapolates a setpoint by the vehicle's `Latency`, that of its attitude loop and
rotors, using the setpoint's own velocity, acceleration and jerk.

`HoverThrottle` learns the hover throttle, which converts newtons to throttle: at first it is the
autopilot's own parameter; then, while the vehicle hovers under position or acceleration setpoints,
the slowly averaged throttle of its attitude controller."""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite
from types import MappingProxyType

from kybflow.core.geometry import ZERO, add, norm, scale
from kybflow.core.signals import NS, Command, CommandKind, Odometry, SetpointKind, Time
from kybflow.drivers.mavlink.firmware import Latency
from kybflow.drivers.mavlink.protocol.codec import Throttle

OLDEST: Time = NS // 4
"""A command older than this is no longer sent."""


class SetpointStream:
    """The stream of one vehicle's setpoints. rate: in Hz."""

    def __init__(self, rate: float) -> None:
        self._period: Time = round(NS / rate)
        self._command: Command | None = None
        self._fed: Time = 0
        self._begun: Time | None = None
        self._due: Time = 0

    def feed(self, command: Command, now: Time) -> None:
        """Set the newest command; the first one begins the stream."""
        if self._begun is None:
            self._begun = self._due = now
        self._command, self._fed = command, now

    def stop(self) -> None:
        self._command = self._begun = None

    def due(self, now: Time) -> Command | None:
        """Return the command to send now, or None if none is due. Missed ones are skipped, not sent
        in a burst."""
        command = self._command
        if command is None or now < self._due:
            return None
        if now - self._fed > OLDEST:
            self.stop()
            return None
        self._due += self._period
        if self._due <= now:
            self._due = now + self._period
        return command

    def flows(self, now: Time) -> float:
        """Return the seconds since the stream began; zero while it is stopped."""
        return 0.0 if self._begun is None else (now - self._begun) / NS


def compensated(command: Command, latency: Latency) -> Command:
    """Return the command extrapolated by the vehicle's latency; unchanged if its setpoint has no
    acceleration."""
    setpoint = command.setpoint
    if setpoint is None or (acceleration := setpoint.acceleration) is None:
        return command
    position, velocity = setpoint.position, setpoint.velocity
    jerk, time = setpoint.jerk or ZERO, latency.position
    if setpoint.kind is SetpointKind.ACCELERATION:
        acceleration = add(acceleration, scale(jerk, latency.acceleration))
        return command._replace(setpoint=setpoint._replace(acceleration=acceleration))
    if velocity is None:
        return command
    if position is not None:
        position = add(position, scale(velocity, time))
        position = add(position, scale(acceleration, 0.5 * time * time))
        position = add(position, scale(jerk, time**3 / 6.0))
    velocity = add(velocity, add(scale(acceleration, time), scale(jerk, 0.5 * time * time)))
    acceleration = add(acceleration, scale(jerk, time))
    ahead = setpoint._replace(position=position, velocity=velocity, acceleration=acceleration)
    return command._replace(setpoint=ahead)


STREAMS = MappingProxyType({"ATTITUDE_TARGET": 10.0})
"""The stream from which `HoverThrottle` learns, Hz."""
USUAL = 0.5
LEAST, MOST = 0.1, 0.9
SLOW = 5.0
"""The time constant of the average, seconds."""
STILL = 0.3
"""Below this speed, m/s, the vehicle counts as hovering."""

THRUST_BY_AUTOPILOT = frozenset({CommandKind.POSITION, CommandKind.ACCELERATION})
"""Kinds of commands under which the autopilot itself sets the thrust."""


class HoverThrottle:
    """The hover throttle of one vehicle.

    parameter: the autopilot's parameter that holds it.
    newtons: the vehicle's weight, N.
    raised: whether the autopilot itself raises the thrust with the tilt."""

    def __init__(self, parameter: str, newtons: float, raised: bool) -> None:
        self._parameter, self._newtons, self._raised = parameter, newtons, raised
        self._share: float | None = None
        self._last: Time | None = None

    def throttle(self, values: Mapping[str, float]) -> Throttle:
        """Return the conversion from thrust to throttle. values: the parameters that were read."""
        share = self._share or values.get(self._parameter, USUAL)
        share = share if isfinite(share) else USUAL
        return Throttle(min(max(share, LEAST), MOST), self._newtons, self._raised)

    def learn(
        self, asked: float | None, command: Command, odometry: Odometry | None,
        values: Mapping[str, float], now: Time,
    ) -> None:  # fmt: skip
        """Learn from one tick of hovering. asked: the throttle that the attitude controller
        commands, 0 to 1; None while the vehicle is not in the air."""
        still = odometry is not None and norm(odometry.velocity) < STILL
        if asked is None or not still or command.kind not in THRUST_BY_AUTOPILOT:
            self._last = None
            return
        if self._last is not None:
            dt = (now - self._last) / NS
            share = self.throttle(values).hover
            self._share = share + (asked - share) * dt / (SLOW + dt)
        self._last = now
