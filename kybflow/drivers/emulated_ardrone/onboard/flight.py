"""How an emulated drone flies: up to its hovering height, as it is told, and down.

Told to move, it keeps the tilt, climbs at the rate and turns at the rate that are asked for; it
follows a climb rate within `EASES` and what its velocity loop takes, together as slowly
as `kybflow.drivers.ardrone.CLIMB_TIME` says of a real one. Told to hover, it stops by its optical
flow and holds its height. Radians, metres, body FLU.
"""

from __future__ import annotations

from math import hypot, pi, sin
from typing import NamedTuple

from kybflow.core.geometry import ZERO, conjugate, from_euler, multiply, to_euler, wrap
from kybflow.core.signals import NS, Command, Time
from kybflow.drivers.ardrone.control.acts import FLIGHTS
from kybflow.drivers.ardrone.protocol.at import Move
from kybflow.drivers.ardrone.protocol.navdata.state import Phase
from kybflow.drivers.emulated_ardrone.onboard.estimator import DroneEstimator
from kybflow.drivers.emulation.body import SimulatedBody
from kybflow.drivers.emulation.control import PositionControl, PositionTarget, Speeds
from kybflow.world.vehicle_context import Airframe

HEIGHT, RISES, SINKS = 0.8, 0.6, 0.4
"""The height of its take-off, m, and its speeds up and down, m/s."""
REACHED = 0.1
SPOOLS: Time = NS // 2
EASES = 0.5
"""Time constant by which a climb rate is eased in, s."""
LEASH = 0.3
"""How far the height that is held may be from the one that it has, m."""
BRAKES, BRAKES_MOST = 0.25, 0.2
"""Hovering: tilt per speed, rad per m/s, and at most, rad."""
STILL: Time = 3 * NS // 10
LOW, SLOW = 0.06, 0.08
"""A height, m, and a climb rate, m/s, at which it has landed when they last for `STILL`."""
TURN_LEASH = 0.5
"""How far the heading that is held may be from the one that it has, rad."""
ROCKS, TURNS = 0.15, 1.0
"""The tilt, rad, once a second to either side, and the heading rate, rad/s, clockwise."""
SHORTEST: Time = NS
"""What takes as long as it does, as a flip."""


class Performance(NamedTuple):
    """roll, pitch: amplitudes, rad. turn: heading rate, rad/s."""

    begins: Time
    ends: Time
    roll: float
    pitch: float
    turn: float

    def tilts(self, now: Time) -> tuple[float, float]:
        """The roll and pitch of this time, rad."""
        phase = sin(2.0 * pi * (now - self.begins) / NS)
        return self.roll * phase, self.pitch * phase


def animation(value: str, now: Time) -> Performance:
    """The one that `control:flight_anim` asks for: its number and its milliseconds. Raises
    ValueError."""
    number, milliseconds = map(int, value.split(","))
    if not 0 <= number < len(FLIGHTS):
        raise ValueError("no animation has this number")
    name = [*FLIGHTS][number]
    lasts = max(SHORTEST, milliseconds * NS // 1000)
    roll, pitch = ROCKS * ("roll" in name), ROCKS * ("pitch" in name)
    return Performance(now, now + lasts, roll, pitch, -TURNS * ("turn" in name or "yaw" in name))


def calibration(now: Time) -> Performance:
    """Once around."""
    return Performance(now, now + round(2.0 * pi / TURNS * NS), 0.0, 0.0, -TURNS)


class DroneFlight:
    """The flight of one drone. `phase`: its state of flight. `moves`: what it follows; None to
    hover."""

    def __init__(self, airframe: Airframe, estimator: DroneEstimator, body: SimulatedBody) -> None:
        self.phase = Phase.LANDED
        self.moves: Move | None = None
        self.tilt_most = self.climb_most = self.turn_most = self.highest = 1.0
        self._estimator, self._body = estimator, body
        self._control = PositionControl(airframe, 0.0)
        self._held = self._climb = self._heading = 0.0
        self._since: Time = 0
        self._still: Time | None = None
        self._performs: Performance | None = None

    @property
    def flies(self) -> bool:
        return self.phase is not Phase.LANDED

    def take_off(self, now: Time) -> None:
        """Begin to fly."""
        self._estimator.rest()
        self._heading = self._estimator.attitude.heading
        self._control.begin(self._heading)
        self._held = self._climb = 0.0
        self.moves = None
        self._change(Phase.TAKING_OFF, now)

    def land(self, now: Time) -> None:
        """Begin to come down."""
        if self.phase not in (Phase.LANDED, Phase.LANDING):
            self.moves = None
            self._change(Phase.LANDING, now)

    def stop(self, now: Time) -> None:
        """Stop the rotors, wherever it is."""
        self._change(Phase.LANDED, now)

    def perform(self, performance: Performance, now: Time) -> None:
        """Take no moves, and perform this, in the air."""
        if self.phase in (Phase.HOVERING, Phase.FLYING):
            self.moves, self._performs = None, performance
            self._change(Phase.LOOPING, now)

    def step(self, now: Time, dt: float) -> Command:
        """Go on by `dt`."""
        if self._performs is not None and now >= self._performs.ends:
            self._change(Phase.HOVERING, now)
        climb = self._wanted_climb(now)
        self._climb += (climb - self._climb) * min(1.0, dt / EASES)
        height = self._estimator.height
        held = min(self._held + self._climb * dt, max(self.highest, height - LEASH))
        self._held = max(height - LEASH, min(height + LEASH, held))
        self._learn(dt)
        self._note(now)
        return self._command(now, dt)

    def _wanted_climb(self, now: Time) -> float:
        if self.phase is Phase.TAKING_OFF:
            spooled = now - self._since > SPOOLS
            return RISES if spooled else 0.0
        if self.phase is Phase.LANDING:
            return -SINKS
        return 0.0 if self.moves is None else self.climb_most * self.moves.up

    def _command(self, now: Time, dt: float) -> Command:
        """The attitude and thrust of this step, for the loop that believes in its own attitude."""
        attitude, turn = self._estimator.attitude, self._turn()
        off = wrap(self._heading + turn * dt - attitude.heading)
        self._heading = attitude.heading + max(-TURN_LEASH, min(TURN_LEASH, off))
        roll, pitch = self._tilts(now)
        wanted = from_euler(roll, pitch, self._heading)
        place = (0.0, 0.0, self._estimator.height)
        target = PositionTarget((None, None, self._held), (None, None, self._climb))
        speeds = Speeds(1.0, 2.0, 2.0)
        motion = (0.0, 0.0, self._estimator.climb)
        self._control.follow(target, place, motion, attitude.heading, speeds, dt)
        thrust = self._control.thrust
        level = max(0.7, 1.0 - 0.5 * (roll * roll + pitch * pitch))
        believed = multiply(self._body.attitude(), multiply(conjugate(attitude.value), wanted))
        return Command(believed, thrust / level, (0.0, 0.0, turn), attitude.heading)

    def _turn(self) -> float:
        """The heading rate, counter-clockwise."""
        if self._performs is not None:
            return self._performs.turn
        return 0.0 if self.moves is None else -self.turn_most * self.moves.clockwise

    def _tilts(self, now: Time) -> tuple[float, float]:
        """Roll and pitch."""
        if self.moves is not None:
            return self.tilt_most * self.moves.right, -self.tilt_most * self.moves.backward
        roll, pitch = self._brakes()
        if self._performs is None:
            return roll, pitch
        right, down = self._performs.tilts(now)
        return roll + right, pitch + down

    def _brakes(self) -> tuple[float, float]:
        """Roll and pitch against the speed over the ground."""
        forward, left, _ = self._estimator.velocity
        size = max(1.0, BRAKES * hypot(forward, left) / BRAKES_MOST)
        return BRAKES * left / size, -BRAKES * forward / size

    def _learn(self, dt: float) -> None:
        estimator = self._estimator
        if self.phase in (Phase.FLYING, Phase.HOVERING) and estimator.felt is not None:
            roll, pitch, _ = to_euler(estimator.attitude.value)
            upright = 1.0 - 0.5 * (roll * roll + pitch * pitch)
            self._control.learn(upright, 0.0, True, dt)

    def _note(self, now: Time) -> None:
        """Notice that it is up, or down."""
        height, climb = self._estimator.height, self._estimator.climb
        if self.phase is Phase.TAKING_OFF and height > HEIGHT - REACHED:
            self._change(Phase.HOVERING, now)
        elif self.phase in (Phase.HOVERING, Phase.FLYING):
            self.phase = Phase.HOVERING if self.moves is None else Phase.FLYING
        is_down = self.phase is Phase.LANDING and height < LOW and abs(climb) < SLOW
        if not is_down:
            self._still = None
        elif self._still is None:
            self._still = now
        elif now - self._still > STILL:
            self._change(Phase.LANDED, now)

    def _change(self, phase: Phase, now: Time) -> None:
        self.phase, self._since, self._still = phase, now, None
        self._performs = self._performs if phase is Phase.LOOPING else None
        self._held = self._estimator.height


LEVEL_ENOUGH = 1.0
"""The tilt, rad, beyond which it stops its rotors."""


def tilt_of_drone(estimator: DroneEstimator) -> float:
    """How far it is from level, rad."""
    roll, pitch, _ = to_euler(estimator.attitude.value)
    return hypot(roll, pitch)


REST = Command((1.0, 0.0, 0.0, 0.0), 0.0, ZERO, None, armed=False)
