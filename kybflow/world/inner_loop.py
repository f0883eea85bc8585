"""What answers a tracker's commands: the attitude loop on board, and the delays around it.

With the attitude's error e, the loop about body x and y is (`kybflow.drivers.sim.steps.onboard`)

    angular acceleration = P e + I integral(e) + D (rates - gyro).

An airframe that declares nothing has a loop as fast as its rotors allow, with rotors that are led.
One that declares a gain has PX4's cascade: the attitude loop asks for rates of K e, the rate loop
for an angular acceleration of D (K e + rates - gyro), so that P = K D, and nothing is led. K is
`MC_ROLL_P`, 6.5 1/s as PX4 comes. D is `MC_ROLLRATE_P` times the angular acceleration that a whole
unit of torque gives, which depends on the vehicle (PX4 guide, "Controller Diagrams").
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

STIFFNESS = 1.0
"""Natural frequency of roll and pitch times the rotors' time constant."""
DAMPING = 0.8
INTEGRAL = 8.0
"""How many times slower than its loop's frequency an integral is. Of PX4's cascade, whose rate loop
has one of 0.2 beside a P of 0.15, it is 8.1."""
LEAD = 4.0
"""How many times faster a led rotor answers."""
ATTITUDE_GAIN, RATE_GAIN = 6.5, 18.0
"""Of a cascade that declares the other one alone, 1/s."""


class AttitudeLoop(NamedTuple):
    """P, 1/s^2; D, 1/s; I, 1/s^3. lead: how many times faster its rotors answer than their time
    constant says, 1 for rotors that are not led."""

    proportional: float
    derivative: float
    integral: float
    lead: float


class InnerLoop(NamedTuple):
    """What a driver declares of a vehicle, seconds unless it says otherwise.

    rotor_time: time constant of the rotors. cut_off: of the second-order low-pass that the
    gyroscope passes on its way to the loop, Hz; 0 for none. dead_time: from the gyroscope's sample
    to the rotors' control. command_latency: from a command's sending to its use on board.
    pose_latency: the age at which a pose arrives. pose_period: between two poses. imu_delay: by
    which what the IMU measures lies behind its stamp. climb_time: time constant with which a
    vehicle that is commanded climb rates follows them.
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
    """The loop of an airframe with these rotors, which declares these gains."""
    if attitude_gain is None and rate_gain is None:
        frequency = STIFFNESS / rotor_time
        derivative, lead = 2.0 * DAMPING * frequency, LEAD
    else:
        derivative, lead = rate_gain or RATE_GAIN, 1.0
        frequency = sqrt((attitude_gain or ATTITUDE_GAIN) * derivative)
    return AttitudeLoop(frequency**2, derivative, frequency**3 / INTEGRAL, lead)
