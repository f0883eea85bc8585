"""The MuJoCo model that the simulator had in November 2026, kept as the measure of all later ones.

Each vehicle `mk` has six actuators on sites (four rotors with lag, two for rotor drag) and a
gyroscope and an accelerometer. The simulator may compute these more cheaply; this model stays, so
that a cheaper one counts as a gain.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt

import mujoco

MASS, INERTIA, ARM = 1.05, (0.011, 0.011, 0.02), 0.25
THRUST, TORQUE_RATIO, ROTOR_TIME, DRAG = 6.0, 0.016, 0.05, 0.25
LEGS, TIMESTEP = 0.05, 0.002
ROTORS = ((1, 1, 1), (-1, 1, -1), (-1, -1, 1), (1, -1, -1))
"""Side along body x and y, and the sign of the drag torque about body z."""
HOVER = MASS * 9.81 / (4 * THRUST)


def frozen_model(starts: Sequence[tuple[float, float, float]]) -> mujoco.MjModel:
    """One vehicle at each of `starts`, metres, above a floor."""
    bodies = "".join(_body(index, *start) for index, start in enumerate(starts))
    actuators = "".join(_actuators(index) for index in range(len(starts)))
    sensors = "".join(
        f'<gyro site="v{i}"/><accelerometer site="v{i}"/>' for i in range(len(starts))
    )
    return mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="{TIMESTEP}" gravity="0 0 -9.81" integrator="Euler"/>
<worldbody><geom name="floor" type="plane" size="0 0 1" pos="0 0 {-LEGS}"/>{bodies}</worldbody>
<actuator>{actuators}</actuator><sensor>{sensors}</sensor></mujoco>"""
    )


def hovering(model: mujoco.MjModel) -> mujoco.MjData:
    """The model's data with every rotor at hover thrust."""
    data = mujoco.MjData(model)
    data.ctrl.reshape(-1, 6)[:, :4] = HOVER
    data.act[:] = HOVER
    return data


def _body(index: int, x: float, y: float, z: float) -> str:
    half = ARM / sqrt(2)
    jx, jy, jz = INERTIA
    sites = "".join(
        f'<site name="v{index}r{n}" pos="{sx * half} {sy * half} 0"/>'
        for n, (sx, sy, _) in enumerate(ROTORS)
    )
    return f"""<body pos="{x} {y} {z}"><freejoint/>
<inertial pos="0 0 0" mass="{MASS}" diaginertia="{jx} {jy} {jz}"/>
<geom type="box" size="{half} {half} {LEGS / 2}" pos="0 0 {-LEGS / 2}" conaffinity="1"/>
<site name="v{index}"/>{sites}</body>"""


def _actuators(index: int) -> str:
    rotors = "".join(
        f'<general site="v{index}r{n}" gear="0 0 1 0 0 {sign * TORQUE_RATIO}" gainprm="{THRUST}"'
        f' dyntype="filterexact" dynprm="{ROTOR_TIME}" ctrllimited="true" ctrlrange="0 1"/>'
        for n, (_, _, sign) in enumerate(ROTORS)
    )
    drag = DRAG * MASS
    return rotors + "".join(
        f'<general site="v{index}" gear="{gear}" gainprm="{drag}" biastype="affine"'
        f' biasprm="0 0 {-drag}"/>'
        for gear in ("1 0 0 0 0 0", "0 1 0 0 0 0")
    )
