"""The computer of an emulated drone: AT commands, configuration, watchdogs and emergencies.

The first sender owns the drone until it is silent for `com_watchdog`; commands of other senders are
counted and ignored, as if the drone were paired. A command is dropped unless its sequence number is
larger than the last or restarts the sequence. After 50 ms without a command the drone sets the
watchdog bit and hovers until commands arrive; COMWDG clears the bit. After `com_watchdog` without a
command the communication is lost: the drone lands, and clients must connect again.

A configuration value that belongs to a session, user or application can be written only with the
current ids, which the `custom:` values set. Common values need no ids. Read-only values can't be
written.
"""

from __future__ import annotations

import random
from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Mapping
from dataclasses import dataclass
from math import cos, degrees, isfinite, pi, sin
from types import MappingProxyType

from kybflow.core.geometry import to_euler
from kybflow.core.signals import NS, Battery, Imu, Measurement, Time
from kybflow.drivers.ardrone import at
from kybflow.drivers.ardrone.at import AtCommand, Ids, Move
from kybflow.drivers.ardrone.navdata import Demo, DroneState, Phase
from kybflow.drivers.emulated_ardrone.flight import (
    LEVEL_ENOUGH,
    REST,
    DroneEstimator,
    DroneFlight,
    animation,
    calibration,
    tilt_of_drone,
)
from kybflow.drivers.emulation.body import BatteryMonitor, SimulatedBody
from kybflow.drivers.emulation.breaking import Failures
from kybflow.world.vehicle_context import VehicleContext

NO_ID = "00000000"
DEFAULTS: Mapping[str, str] = MappingProxyType(
    {
        "general:num_version_config": "1", "general:num_version_mb": "33",
        "general:num_version_soft": "2.4.8", "general:drone_serial": "XXXXXXXXXX",
        "general:ardrone_name": "kybflow", "general:flying_time": "0",
        "general:navdata_demo": "TRUE", "general:navdata_options": "65537",
        "general:com_watchdog": "2", "general:video_enable": "TRUE",
        "general:vision_enable": "TRUE", "general:vbat_min": "9000",
        "control:accs_offset": "{ 0 0 0 }", "control:control_level": "0",
        "control:euler_angle_max": "2.0943952e-01", "control:altitude_max": "3000",
        "control:altitude_min": "50", "control:control_trim_z": "0.0000000e+00",
        "control:control_iphone_tilt": "3.4906584e-01", "control:control_vz_max": "700",
        "control:control_yaw": "1.7453293e+00", "control:outdoor": "FALSE",
        "control:flight_without_shell": "FALSE", "control:autonomous_flight": "FALSE",
        "control:manual_trim": "FALSE", "control:flying_mode": "0",
        "control:hovering_range": "1000", "control:flight_anim": "0,0",
        "network:ssid_single_player": "ardrone2_emulated",
        "network:wifi_mode": "0", "network:owner_mac": "00:00:00:00:00:00",
        "pic:ultrasound_freq": "8", "pic:ultrasound_watchdog": "3", "pic:pic_version": "184877090",
        "video:video_codec": "129", "video:video_channel": "0", "video:bitrate": "1000",
        "leds:leds_anim": "0,0,0", "detect:enemy_colors": "1", "detect:detect_type": "3",
        "syslog:output": "7", "userbox:userbox_cmd": "0", "custom:application_id": NO_ID,
        "custom:application_desc": "Default application configuration",
        "custom:profile_id": NO_ID, "custom:profile_desc": ".Primary Profile",
        "custom:session_id": NO_ID, "custom:session_desc": "Session 00000000",
        "gps:latitude": "5.0000000000000000e+02", "gps:longitude": "5.0000000000000000e+02",
        "gps:altitude": "0.0000000000000000e+00",
    }
)  # fmt: skip
FIXED = ("general:num_version", "general:drone_serial", "general:vbat_min", "pic:pic_version")
"""Prefixes of read-only keys."""
SESSION = frozenset(
    {
        "general:navdata_options", "video:video_codec", "video:video_channel", "leds:leds_anim",
        "detect:detect_type", "control:flying_mode",
        "gps:latitude", "gps:longitude", "gps:altitude",
    }
)  # fmt: skip
IDS = ("custom:session_id", "custom:profile_id", "custom:application_id")


class EmulatedConfiguration:
    """The configuration values of one drone. refused: number of rejected writes."""

    def __init__(self) -> None:
        self.values = dict(DEFAULTS)
        self.refused = 0

    def write(self, key: str, value: str, ids: Ids | None) -> bool:
        """Set a value unless the write is rejected. Return whether the drone acknowledges the
        write."""
        key = key.lower()
        known = key in self.values and not key.startswith(FIXED)
        current = Ids(*(self.values[name] for name in IDS))
        is_owner = current in (ids, (NO_ID, NO_ID, NO_ID))
        if not known or (key in SESSION and not is_owner):
            self.refused += 1
            return known
        self.values[key] = value
        return True

    def number(self, key: str) -> float:
        """Return a value as a number; if it isn't one, return the default."""
        try:
            return float(self.values[key])
        except ValueError:
            return float(DEFAULTS[key])

    def truth(self, key: str) -> bool:
        return self.values[key].strip().upper() == "TRUE"


WATCHDOG: Time = NS // 20
COMMANDS = frozenset(
    {
        "REF", "PCMD", "PCMD_MAG", "CONFIG", "CONFIG_IDS", "CTRL", "COMWDG", "FTRIM", "CALIB",
        "ANIM", "LED", "PMODE", "MISC",
    }
)  # fmt: skip
FIRST_SEQUENCES = frozenset({0, 1})
"""The sequence numbers that restart the sequence."""
LOW_CHARGE, EMPTY_CHARGE = 0.2, 0.05
"""The charges below which the drone refuses to take off, and lands, as fractions."""
HEALTHY = (
    DroneState.VIDEO_THREAD | DroneState.NAVDATA_THREAD | DroneState.AT_THREAD
    | DroneState.ACQUISITION_THREAD | DroneState.PIC_VERSION_OK | DroneState.ALTITUDE_CONTROL
)  # fmt: skip


@dataclass
class DroneFailures(Failures):
    """The failures of a drone. cutout: a rotor is blocked, which causes an emergency."""

    cutout: bool = False


class OnboardDrone:
    """The computer of one drone.

    accepted: number of accepted commands that have no effect in the emulation, by name.
    ignored: number of ignored commands, by reason.
    is_in_bootstrap: whether `general:navdata_demo` has not been written yet.
    is_lost: whether no client owns the drone.
    times_lost: how often the communication was lost.
    on_configuration: called when a client requests the configuration.
    """

    def __init__(
        self, context: VehicleContext, body: SimulatedBody, generator: random.Random
    ) -> None:
        self.failures = DroneFailures()
        self.configuration = EmulatedConfiguration()
        self.battery = BatteryMonitor(self.failures)
        self.estimator = DroneEstimator(body.look, generator)
        self.flight = DroneFlight(context.airframe, self.estimator, body)
        self.accepted: Counter[str] = Counter()
        self.ignored: Counter[str] = Counter()
        self.on_configuration: Callable[[], None] = lambda: None
        self.is_lost, self.times_lost = True, 0
        self._body = body
        self._owner: Hashable = None
        self._sequence = -1
        self._last_received: Time | None = None
        self._warned = self._acknowledges = False
        self.is_in_bootstrap = True
        self._emergency = self._toggle = False
        self._causes = DroneState(0)
        self._ids: Ids | None = None
        self._now: Time = 0
        self._stepped: Time = 0

    def add_measurement(self, measured: Measurement, now: Time) -> None:
        if isinstance(measured, Imu):
            self.estimator.add_imu(measured)
        elif isinstance(measured, Battery):
            self.battery.measure(measured)

    def receive(self, datagram: bytes, sender: Hashable, now: Time) -> None:
        """Execute the commands of a datagram."""
        self._now = now
        commands = at.read_commands(datagram)
        if not commands:
            self.ignored["no command"] += 1
            return
        if self._owner is None:
            self._owner = sender
        if sender != self._owner:
            self.ignored["from elsewhere"] += len(commands)
            return
        for command in commands:
            if command.sequence <= self._sequence and command.sequence not in FIRST_SEQUENCES:
                self.ignored["not newer"] += 1
            elif command.name not in COMMANDS:
                self.ignored["unknown"] += 1
            else:
                self._sequence, self._last_received, self.is_lost = command.sequence, now, False
                try:
                    self._execute(command)
                except (ValueError, TypeError, IndexError):
                    self.ignored["wrong arguments"] += 1

    def step(self, now: Time) -> None:
        """Make one step: estimate, check watchdogs and emergencies, and fly."""
        self._now = now
        dt, self._stepped = (now - self._stepped) / NS, now
        self.estimator.correct(now)
        self._check_watchdogs(now)
        self._check_emergencies(now)
        flight, number = self.flight, self.configuration.number
        if flight.flies:
            flight.tilt_most = number("control:euler_angle_max")
            flight.climb_most = number("control:control_vz_max") / 1000.0
            flight.turn_most = number("control:control_yaw")
            flight.highest = number("control:altitude_max") / 1000.0
            self._body.drive(flight.step(now, dt), now)
        else:
            self._body.drive(REST, now)

    def state(self) -> DroneState:
        """Return the state mask."""
        bits = {
            DroneState.FLYING: self.flight.flies,
            DroneState.ANGULAR_SPEED_CONTROL: self.flight.flies,
            DroneState.COMMAND_ACKNOWLEDGED: self._acknowledges,
            DroneState.DEMO: self.configuration.truth("general:navdata_demo"),
            DroneState.BOOTSTRAP: self.is_in_bootstrap,
            DroneState.COMMUNICATION_LOST: self.is_lost and not self.is_in_bootstrap,
            DroneState.BATTERY_LOW: self.battery.remaining < LOW_CHARGE,
            DroneState.COMMUNICATION_WATCHDOG: self._warned,
            DroneState.EMERGENCY: self._emergency,
        }
        state = HEALTHY | self._causes
        for bit, is_set in bits.items():
            state |= bit if is_set else DroneState(0)
        return state

    def demo(self) -> Demo:
        """Return the demo option."""
        attitude, velocity = self.estimator.attitude, self.estimator.velocity
        roll, pitch, heading = to_euler(attitude.value)
        forward, left, _ = (1000.0 * v for v in velocity)
        return Demo(
            self.flight.phase, round(100.0 * self.battery.remaining),
            -1000.0 * degrees(pitch), 1000.0 * degrees(roll), -1000.0 * degrees(heading),
            max(0, round(1000.0 * self.estimator.height)),
            (forward, -left, -1000.0 * self.estimator.climb),
        )  # fmt: skip

    def _execute(self, command: AtCommand) -> None:
        """Execute a command. Raises ValueError, TypeError or IndexError if its arguments are
        wrong."""
        name, arguments = command.name, command.arguments
        match name:
            case "REF":
                self._ref(*_integers(arguments, 1))
            case "PCMD":
                self._move(*_integers(arguments, 5))
            case "PCMD_MAG":
                self._move(*_integers(arguments, 7))
            case "CONFIG":
                self._config(*_words(arguments, 2))
            case "CONFIG_IDS":
                self._ids = Ids(*_words(arguments, 3))
            case "CTRL":
                self._ctrl(_integers(arguments, 0)[0])
            case "COMWDG":
                self._warned = False
            case "CALIB":
                if _integers(arguments, 1) == [0]:
                    self.flight.perform(calibration(self._now), self._now)
            case _:
                self.accepted[name] += 1

    def _ref(self, bits: int) -> None:
        is_set = bool(bits & at.EMERGENCY)
        if is_set and not self._toggle:
            if not self._emergency:
                self._stop(DroneState.USER_EMERGENCY)
            elif tilt_of_drone(self.estimator) < LEVEL_ENOUGH and not self.failures.cutout:
                self._emergency, self._causes = False, DroneState(0)
        self._toggle = is_set
        may_fly = self.battery.remaining >= LOW_CHARGE and not self.is_in_bootstrap
        if not bits & at.FLY:
            self.flight.land(self._now)
        elif not self._emergency and self.flight.phase is Phase.LANDED and may_fly:
            self.flight.take_off(self._now)

    def _move(self, flag: int, *bits: int) -> None:
        """Follow the arguments of PCMD, or those of PCMD_MAG, which has two more."""
        values = [at.float_of(value) for value in bits[:4]]
        if not all(map(isfinite, values)):
            raise ValueError("not a number")
        right, backward, up, clockwise = (max(-1.0, min(1.0, value)) for value in values)
        if len(bits) > 4 and flag & at.ABSOLUTE:
            right, backward = self._by_compass(right, backward, at.float_of(bits[4]))
        if self.flight.phase in (Phase.HOVERING, Phase.FLYING):
            self.flight.moves = (
                Move(right, backward, up, clockwise) if flag & at.PROGRESSIVE else None
            )

    def _by_compass(self, right: float, backward: float, client: float) -> tuple[float, float]:
        """Return a client's tilt (right, backward) in the drone's directions. client: the client's
        bearing, as a fraction of 180 degrees. Raises ValueError if it is not finite."""
        if not isfinite(client):
            raise ValueError("not a number")
        own = pi / 2 - self.estimator.attitude.heading
        c, s = cos(client * pi - own), sin(client * pi - own)
        return right * c - backward * s, backward * c + right * s

    def _config(self, key: str, value: str) -> None:
        ids, self._ids = self._ids, None
        self._acknowledges = self.configuration.write(key, value, ids) or self._acknowledges
        if key.lower() == "general:navdata_demo":
            self.is_in_bootstrap = False
        if key.lower() == "control:flight_anim":
            self.flight.perform(animation(value, self._now), self._now)

    def _ctrl(self, mode: int) -> None:
        if mode in (0, at.RESET_ACKNOWLEDGE):
            self._acknowledges = False
        elif mode == at.SEND_CONFIGURATION:
            self._acknowledges = True
            self.on_configuration()

    def _stop(self, cause: DroneState) -> None:
        self._emergency, self._causes = True, self._causes | cause
        self.flight.stop(self._now)

    def _check_watchdogs(self, now: Time) -> None:
        silence = now if self._last_received is None else now - self._last_received
        if self._owner is None:
            return
        if silence > WATCHDOG:
            self._warned = True
            self.flight.moves = None
        if silence > self.configuration.number("general:com_watchdog") * NS and not self.is_lost:
            self.is_lost, self._owner, self._sequence = True, None, -1
            self.times_lost += 1
            self.flight.land(now)

    def _check_emergencies(self, now: Time) -> None:
        if self.failures.cutout and not self._emergency:
            self._stop(DroneState.CUT_OUT)
        if self.flight.flies and tilt_of_drone(self.estimator) > LEVEL_ENOUGH:
            self._stop(DroneState.ANGLES_OUT_OF_RANGE)
        if self.battery.remaining < EMPTY_CHARGE:
            self.flight.land(now)


def _integers(arguments: Iterable[int | str], count: int) -> list[int]:
    """Return the arguments as integers. Raises ValueError unless they are exactly `count` integers;
    a count of 0 allows any number of them."""
    found = [value for value in arguments if isinstance(value, int)]
    if len(found) != len(tuple(arguments)) or (count and len(found) != count):
        raise ValueError("other arguments are expected")
    return found


def _words(arguments: Iterable[int | str], count: int) -> list[str]:
    """Return the arguments that are strings. Raises ValueError if their number is not `count`."""
    found = [value for value in arguments if isinstance(value, str)]
    if len(found) != count:
        raise ValueError("other arguments are expected")
    return found
