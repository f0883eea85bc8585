"""The inner loop that follows a tracker's commands: the on-board attitude loop and its delays.

With e the attitude error, the loop about body x and y is (`kybflow.drivers.sim.steps.onboard`)

    angular acceleration = P e + I integral(e) + D (rates - gyro).

An airframe without gains has a loop as fast as its rotors allow, with lead compensation of the
rotors. An airframe with a gain has PX4's cascade without compensation: the attitude loop commands
rates of K e, and the rate loop an angular acceleration of D (K e + rates - gyro), so that P = K D.
K is `MC_ROLL_P`, 6.5 1/s by default. D is `MC_ROLLRATE_P` times the angular acceleration at full
torque, which depends on the vehicle (PX4 guide, "Controller Diagrams").
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

STIFFNESS = 1.0
"""Natural frequency of roll and pitch times the rotors' time constant."""
DAMPING = 0.8
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
        frequency = STIFFNESS / rotor_time
        derivative, lead = 2.0 * DAMPING * frequency, LEAD
    else:
        derivative, lead = rate_gain or RATE_GAIN, 1.0
        frequency = sqrt((attitude_gain or ATTITUDE_GAIN) * derivative)
    return AttitudeLoop(frequency**2, derivative, frequency**3 / INTEGRAL, lead)
