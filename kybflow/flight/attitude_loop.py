"""The on-board attitude loop that an airframe declares, about body x and y.

With the attitude's error e, the law is (`kybflow.drivers.sim.steps.onboard`)

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

from kybflow.world.vehicle_context import Airframe

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


def attitude_loop(airframe: Airframe) -> AttitudeLoop:
    """The loop that `airframe` declares."""
    attitude, rate = airframe.attitude_gain, airframe.rate_gain
    if attitude is None and rate is None:
        frequency = STIFFNESS / airframe.rotor_time
        derivative, lead = 2.0 * DAMPING * frequency, LEAD
    else:
        derivative, lead = rate or RATE_GAIN, 1.0
        frequency = sqrt((attitude or ATTITUDE_GAIN) * derivative)
    return AttitudeLoop(frequency**2, derivative, frequency**3 / INTEGRAL, lead)
