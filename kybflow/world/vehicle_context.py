"""The context of a vehicle's parts: the world, the airframe with its inner loop and battery, the
payload and the start.

The inner loop follows a tracker's commands. With e the attitude error, the on-board attitude loop
about body x and y is (`kybflow.drivers.sim.steps.onboard`)

    angular acceleration = P e + I integral(e) + D (rates - gyro).

An airframe without gains has a loop as fast as its rotors and the gyroscope's filter allow, with
lead compensation of the rotors. An airframe with a gain has PX4's cascade without compensation: the
attitude loop commands rates of K e, and the rate loop an angular acceleration of D (K e + rates -
gyro), so that P = K D. K is `MC_ROLL_P`, 6.5 1/s by default. D is `MC_ROLLRATE_P` times the angular
acceleration at full torque, which depends on the vehicle (PX4 guide, "Controller Diagrams").
"""

from __future__ import annotations

from collections.abc import Mapping
from math import sqrt
from types import MappingProxyType
from typing import NamedTuple

from kybflow.core.geometry import GRAVITY, Vec3
from kybflow.core.params import param, params, record
from kybflow.core.units import Angle, Damping, Duration, Force, Inertias, Length, Mass, Ratio, Speed
from kybflow.world.cameras import Camera
from kybflow.world.objects import WorldObject
from kybflow.world.shapes import Box, MovingSphere, Shape
from kybflow.world.tags import TagMap

STIFFNESS = 1.15
"""Natural frequency of roll and pitch times the rotors' time constant."""
FASTEST = 35.0
"""The highest natural frequency of roll and pitch, rad/s, because a gyroscope's filter of 50 Hz and
a dead time of 4 ms leave a faster loop a phase margin below 33 degrees."""
DAMPING, MOST_DAMPING = 0.85, 1.4
LEAST_RATE_GAIN = 48.0
"""The lowest D of a loop without declared gains, 1/s, which loops with slow rotors reach by more
damping, up to `MOST_DAMPING`. Around less, a position loop swings ever more if the thrust over the
inertia is 40 % lower than believed and the rotors are slower by 30 %: the worst of a vehicle whose
mass, thrust, inertia and rotors may differ by 20 %, on gains that may be wrong by 10 %."""
INTEGRAL = 8.0
"""The frequency of the loop divided by that of its integral; 8.1 for PX4's cascade with I 0.2 and P
0.15."""
LEAD = 4.0
"""By which factor lead compensation speeds up a rotor's response."""
ATTITUDE_GAIN, RATE_GAIN = 6.5, 18.0
"""Default gains of the cascade, 1/s."""


class AttitudeLoop(NamedTuple):
    """The gains of an on-board attitude loop: P, 1/s^2; D, 1/s; I, 1/s^3. lead: the rotors' time
    constant divided by their response time, 1 without lead compensation."""

    proportional: float
    derivative: float
    integral: float
    lead: float


class InnerLoop(NamedTuple):
    """The inner loop that a driver declares for a vehicle; seconds unless stated otherwise.

    rotor_time: time constant of the rotors. cut_off: cut-off frequency of the gyroscope's
    second-order low-pass filter, Hz; 0 for none. dead_time: from the gyroscope's sample to the
    rotors' control. command_latency: from the sending of a command to its use on board.
    pose_latency: age of a pose on arrival. pose_period: time between two poses. imu_delay: delay of
    IMU measurements relative to their time stamps. climb_time: time constant of the response to a
    commanded climb rate.
    """

    attitude: AttitudeLoop
    rotor_time: float
    cut_off: float = 0.0
    dead_time: float = 0.0
    command_latency: float = 0.0
    pose_latency: float = 0.01
    pose_period: float = 1.0 / 120.0
    imu_delay: float = 0.0
    climb_time: float = 0.0


def attitude_loop(
    rotor_time: float, attitude_gain: float | None, rate_gain: float | None
) -> AttitudeLoop:
    """Return the attitude loop of an airframe with these rotors and declared gains."""
    if attitude_gain is None and rate_gain is None:
        frequency = min(STIFFNESS / rotor_time, FASTEST)
        damped, most = 2.0 * DAMPING * frequency, 2.0 * MOST_DAMPING * frequency
        derivative, lead = min(most, max(damped, LEAST_RATE_GAIN)), LEAD
    else:
        derivative, lead = rate_gain or RATE_GAIN, 1.0
        frequency = sqrt((attitude_gain or ATTITUDE_GAIN) * derivative)
    return AttitudeLoop(frequency**2, derivative, frequency**3 / INTEGRAL, lead)


NO_TAGS = TagMap(())
LEGS = 0.05
"""Height of the rotor plane above the floor while a simulated vehicle stands, metres."""


def hull_of(diameter: float) -> float:
    """Return the distance from the centre of an airframe of this diameter to the tips of its
    rotors."""
    return 0.75 * diameter


@params
class Airframe:
    """A quadrotor's nominal data. The simulated vehicle may differ from it, like a real one."""

    mass: Mass = param("Mass, ready to fly.", above=0.0)
    diameter: Length = param("Diagonal distance between rotor hubs.", above=0.0)
    inertia: Inertias = param("Moments of inertia about body x, y, z.")
    thrust: Force = param("Largest thrust of one rotor.", above=0.0)
    torque_ratio: Length = param(
        "Drag torque of a rotor per newton of its thrust.", default=0.016, above=0.0
    )
    rotor_time: Duration = param("Time constant of a rotor's first-order lag.", above=0.0)
    drag: Damping = param(
        "Rotor drag on the body, per unit of mass, in the rotor plane.", default=0.0, at_least=0.0
    )
    tilt: Angle = param(
        "Largest tilt that a tracker may command.", default=0.349, above=0.0, below=1.3
    )
    speed: Speed = param("Largest speed that a mission may request.", default=1.0, above=0.0)
    climb: Speed = param(
        "Largest vertical speed that a mission may request.", default=1.0, above=0.0
    )
    endurance: Duration = param("Hovering time on a full battery.", default=900.0, above=0.0)
    voltage_spread: Ratio = param(
        "Voltage lost from full to empty.", default=0.2, at_least=0.0, below=0.5
    )
    bumper: Length | None = param(
        "Radius of a round bumper around the rotors, which may touch objects; without it, only the"
        " body between the rotors is solid.",
        default=None, above=0.0,
    )  # fmt: skip
    bumper_height: Length | None = param(
        "Height of the bumper's middle above the rotors; 0 m by default.", default=None
    )
    attitude_gain: Damping | None = param(
        "Gain of an on-board cascade like PX4's: body rate per angle of the attitude error, about"
        " body x and y; 6.5 1/s by default. An airframe with neither gain has a loop as fast as its"
        " rotors and gyroscope allow.",
        default=None, above=0.0, at_most=50.0,
    )  # fmt: skip
    rate_gain: Damping | None = param(
        "Gain of that cascade: angular acceleration per error of the body rate; 18 1/s by default.",
        default=None, above=0.0, at_most=200.0,
    )  # fmt: skip

    @property
    def arm(self) -> float:
        """The distance from the centre to a rotor hub, metres."""
        return self.diameter / 2.0

    @property
    def rotor_radius(self) -> float:
        """A rotor's radius, metres: a quarter of the diameter, as on the MikroKopter, the X500, the
        F450 and the Crazyflie. Rotors with a radius of 0.35 times the diameter would touch."""
        return self.diameter / 4.0

    @property
    def hull(self) -> float:
        """The distance from the centre to the tips of the rotors, metres."""
        return hull_of(self.diameter)

    @property
    def hover_thrust(self) -> float:
        """The thrust that carries the airframe's weight, newtons."""
        return self.mass * GRAVITY

    @property
    def max_thrust(self) -> float:
        """The largest thrust of all four rotors together, newtons."""
        return 4.0 * self.thrust

    @property
    def attitude_loop(self) -> AttitudeLoop:
        """The airframe's on-board attitude loop."""
        return attitude_loop(self.rotor_time, self.attitude_gain, self.rate_gain)


@record("payload", is_whole=False)
class Parcel:
    """A payload that a vehicle carries and can release: a box under its rotors, whose lower side is
    level with the legs."""

    mass: Mass = param("Mass, which controllers don't know.", above=0.0)
    size: Length = param("Side of the box, a cube.", above=0.0)
    channel: int = param(
        "Channel of the payload's servo, from 1; the auxiliary output of an autopilot.",
        default=1, at_least=1,
    )  # fmt: skip
    aboard: bool = param("Whether the payload is on board when the mission begins.", default=True)


class VehicleContext(NamedTuple):
    """The data with which a vehicle's parts are created; metres and radians in the world frame.

    vehicle: its name. start, heading: its declared start. dt: seconds per tick. home: the position
    to which `go_home` flies, None for the start. obstacles: the world's obstacles, by name.
    diameters: the airframe diameters of all vehicles, by vehicle. tags: the world's tags. cameras:
    the airframe's cameras, by name. payload: the payload that the vehicle carries, None for none.
    loop: the inner loop that its driver declares, None for none. starts: the declared starts of all
    vehicles, by vehicle. groups: the mission's groups, each with its vehicles. touchable: the names
    of the obstacles that vehicles may touch. moving: the moving obstacles, by name. delay_margin:
    that of the position loop, seconds; None if the tracker closes none around a known inner loop.
    objects: the objects that move, by name.
    """

    vehicle: str
    airframe: Airframe
    start: Vec3
    heading: float
    fence: Box | None
    dt: float
    home: Vec3 | None = None
    obstacles: Mapping[str, Shape] = MappingProxyType({})
    diameters: Mapping[str, float] = MappingProxyType({})
    tags: TagMap = NO_TAGS
    cameras: Mapping[str, Camera] = MappingProxyType({})
    payload: Parcel | None = None
    loop: InnerLoop | None = None
    starts: Mapping[str, Vec3] = MappingProxyType({})
    groups: Mapping[str, tuple[str, ...]] = MappingProxyType({})
    touchable: frozenset[str] = frozenset()
    moving: Mapping[str, MovingSphere] = MappingProxyType({})
    delay_margin: float | None = None
    objects: Mapping[str, WorldObject] = MappingProxyType({})


FULL_VOLTAGE = 4.2 * 4
"""The voltage of a full pack of four cells."""


class BatteryCharge:
    """The charge of a battery that lasts for the airframe's endurance in hover.

    The power is proportional to thrust^1.5 (momentum theory). An empty battery has lost the
    airframe's `voltage_spread`; the load in hover lowers the voltage by a tenth of that. Rotor
    thrust is proportional to the square of the voltage. level: the voltage relative to that of a
    full battery. sag: the missing share of the charge.
    """

    def __init__(self, airframe: Airframe, remaining: float) -> None:
        self.sag = 0.0
        self._spread = airframe.voltage_spread
        self._weight = airframe.hover_thrust
        self._per_second = 1.0 / airframe.endurance
        self._charge = remaining
        self.level = 1.0 - self._spread * (1.0 - remaining)

    @property
    def remaining(self) -> float:
        """The remaining charge, from 0 to 1."""
        return max(0.0, self._charge - self.sag)

    @property
    def voltage(self) -> float:
        return FULL_VOLTAGE * self.level

    def drain(self, thrust: float, seconds: float) -> None:
        """Use the charge that `thrust` (newtons) takes for `seconds`."""
        load = max(0.0, thrust / self._weight) ** 1.5
        self._charge = max(0.0, self._charge - load * seconds * self._per_second)
        self.level = 1.0 - self._spread * (1.0 - self.remaining + 0.1 * load)
