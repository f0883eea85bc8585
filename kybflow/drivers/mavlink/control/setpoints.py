"""The setpoints sent to an autopilot: which command is sent, when, and with what changes.

`SetpointStream` sends the newest command at its own rate and repeats it until the command is 250 ms
old. Then it stops, and the vehicle's own watchdog acts.

`compensated` extrapolates a setpoint by the vehicle's `Latency`, that of its attitude loop and
rotors, using the setpoint's own velocity, acceleration and jerk.

An autopilot ends its own take-off on the ground if it is commanded down, and the mission's first
setpoints are at ground level. So `LiftOff` holds back positions until they are above the vehicle,
and accelerations until they no longer point down, for at most five seconds.

A vehicle that takes off by setpoints gets `raised` ones until it has lifted off: a higher position,
or a growing upward acceleration, since the autopilot's hover throttle may be set too low.
Horizontally it follows the command, against the wind."""

from __future__ import annotations

from collections.abc import Callable

from kybflow.core.geometry import ZERO, Vec3, add, scale
from kybflow.core.signals import NS, Command, CommandKind, SetpointKind, Time
from kybflow.drivers.mavlink.firmware import Latency

MAX_AGE_NS: Time = NS // 4
"""A command older than this is no longer sent."""


class SetpointStream:
    """The stream of one vehicle's setpoints. rate: in Hz."""

    def __init__(self, rate: float) -> None:
        self._period: Time = round(NS / rate)
        self._command: Command | None = None
        self._fed: Time = 0
        self._begun: Time | None = None
        self._due: Time = 0

    @property
    def kind(self) -> CommandKind | None:
        """The kind of the newest command, None while the stream is stopped."""
        return None if self._command is None else self._command.kind

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
        if now - self._fed > MAX_AGE_NS:
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


LIFT_OFF_TIMEOUT_NS: Time = 5 * NS
"""How long downward commands are held back at most."""
LOW_HEIGHT = 0.3
"""Height above the ground, metres, below which the vehicle may be landing."""
INITIAL_PUSH, PUSH_GROWTH, MAX_PUSH = 1.5, 0.5, 4.0
"""An upward acceleration: its initial value, m/s^2, its growth, m/s^3, and its maximum, m/s^2."""


class LiftOff:
    """Lets one vehicle lift off: withholds commands that would keep it on the ground, for at most
    `LIFT_OFF_TIMEOUT_NS`. hold: returns the command to stay at the vehicle's present
    position, None while the position is unknown."""

    def __init__(self, hold: Callable[[], Command | None]) -> None:
        self._hold = hold
        self._until: Time | None = None
        self._floor: float | None = None
        self._stood: Time = 0

    @property
    def height(self) -> float | None:
        """The vehicle's own height, metres; None while unknown."""
        holding = self._hold()
        position = None if holding is None else _position(holding)
        return None if position is None else position[2]

    @property
    def is_low(self) -> bool:
        """Whether the vehicle is near the height at which it last stood disarmed, and so may be
        landing."""
        height = self.height
        return height is not None and self._floor is not None and height - self._floor < LOW_HEIGHT

    def stand(self, now: Time) -> None:
        """Record that the vehicle is disarmed; called once a tick while it is."""
        self._stood = now
        height = self.height
        self._floor = self._floor if height is None else height

    def armed_for(self, now: Time) -> float:
        """Return for how many seconds the vehicle has been armed."""
        return (now - self._stood) / NS

    def begin(self, now: Time) -> None:
        """Begin to hold commands back, because the vehicle is taking off."""
        self._until = now + LIFT_OFF_TIMEOUT_NS

    def end(self) -> None:
        self._until = None

    def holds_back(self, command: Command, now: Time) -> bool:
        """Return whether a command must wait until the vehicle has lifted off."""
        if self._until is None:
            return False
        if (push := _acceleration(command)) is not None:
            is_downward = push[2] < 0.0
        else:
            target, height = _position(command), self.height
            is_downward = target is not None and height is not None and target[2] < height
        if now >= self._until or not is_downward:
            self._until = None
        return self._until is not None


def raised(command: Command, height: float, seconds: float) -> Command:
    """Return the command that lifts the vehicle. A position command becomes a hover `height` metres
    higher. An acceleration command keeps its horizontal part and gets an upward acceleration that
    grows with `seconds`. Other commands are returned unchanged."""
    setpoint, position = command.setpoint, _position(command)
    if setpoint is None:
        return command
    if position is not None:
        x, y, z = position
        place = (x, y, z + height)
        higher = setpoint._replace(position=place, velocity=ZERO, acceleration=ZERO, jerk=ZERO)
        return command._replace(setpoint=higher)
    if (asked := _acceleration(command)) is not None:
        push = (asked[0], asked[1], min(INITIAL_PUSH + PUSH_GROWTH * seconds, MAX_PUSH))
        return command._replace(setpoint=setpoint._replace(acceleration=push, jerk=ZERO))
    return command


def _position(command: Command) -> Vec3 | None:
    if command.kind is not CommandKind.POSITION or command.setpoint is None:
        return None
    return command.setpoint.position


def _acceleration(command: Command) -> Vec3 | None:
    if command.kind is not CommandKind.ACCELERATION or command.setpoint is None:
        return None
    return command.setpoint.acceleration
