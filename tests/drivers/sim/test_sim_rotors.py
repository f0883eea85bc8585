"""Rotors and IMU against MuJoCo's own actuators and sensors."""

from __future__ import annotations

from dataclasses import replace
from math import sin, sqrt

import mujoco
import numpy
import pytest
from sim_worlds import FRAME, QUIET, STOPPED, seat, thrust, world

from kybflow.core.geometry import from_euler
from kybflow.core.signals import NS, Imu
from kybflow.drivers.sim.model import loaded
from kybflow.parts import Effect
from kybflow.world.vehicle_context import Parcel

STEP = NS // 500
ROTORS = ((1.0, 1.0, 1.0), (-1.0, 1.0, -1.0), (-1.0, -1.0, 1.0), (1.0, -1.0, -1.0))
"""Each rotor's side along body x and y, and the sign of its drag torque about body z."""


def reference(body, parcel):
    """The vehicle as MuJoCo would have it: four rotors and two forces of the air, which act on
    sites, a gyroscope and an accelerometer."""
    half, drag = FRAME.arm / sqrt(2.0), body.drag * body.mass
    mass, inertia, height = loaded(body.mass, body.inertia, parcel)
    sites = "".join(
        f'<site name="{n}" pos="{x * half!r} {y * half!r} 0"/>'
        for n, (x, y, _) in enumerate(ROTORS)
    )
    rotors = "".join(
        f'<general site="{n}" gear="0 0 1 0 0 {sign * FRAME.torque_ratio!r}" ctrllimited="true"'
        f' ctrlrange="0 1" dyntype="filterexact" dynprm="{body.rotor_time!r}"/>'
        for n, (_, _, sign) in enumerate(ROTORS)
    )
    air = "".join(
        f'<general site="origin" gear="{axis} 0 0 0 0" gainprm="{drag!r}" biastype="affine"'
        f' biasprm="0 0 {-drag!r}"/>'
        for axis in ("1 0", "0 1")
    )
    return mujoco.MjModel.from_xml_string(f"""<mujoco>
<option timestep="0.002" gravity="0 0 -9.81" integrator="Euler"/>
<worldbody><body pos="0 0 50"><freejoint/><site name="origin"/>{sites}
<inertial pos="0 0 {height!r}" mass="{mass!r}" diaginertia="{" ".join(map(repr, inertia))}"/>
</body></worldbody>
<actuator>{rotors}{air}</actuator>
<sensor><gyro site="origin"/><accelerometer site="origin"/></sensor>
</mujoco>""")


@pytest.mark.parametrize("parcel", [None, Parcel(mass=0.2, size=0.06)])
def test_they_are_mujocos_own(parcel):
    params = replace(QUIET, model_error=0.1, wind=(1.0, -2.0, 0.5), gust=0.5)
    bare = seat(params=params)
    session = world(bare._replace(context=bare.context._replace(payload=parcel)))
    link = session.links["a"]
    link.subscribe(frozenset({Imu}))
    session.data.qpos[2] = 50.0
    model = reference(link.body, parcel)
    data = mujoco.MjData(model)
    now, farthest = 0, 0.0
    for step in range(1500):
        if step == 700:
            link.faults.begin(Effect(rotors=(0.9, 1.0, 1.0, 1.0)), now)
        turn = from_euler(0.4 * sin(0.01 * step), 0.3 * sin(0.02 * step), 0.0)
        link.send(STOPPED if step > 1300 else thrust(12.0 + 8.0 * sin(0.03 * step), turn, 1.0), now)
        controls, thrusts = session.onboard.controls[0], session.onboard.thrusts[0]
        now += STEP
        session.advance(now)
        data.ctrl[:] = (*controls, *session.onboard.winds[0][:2])
        model.actuator_gainprm[:4, 0] = thrusts
        mujoco.mj_step(model, data)
        imu = next(m for m in link.read(now) if isinstance(m, Imu))
        felt = (*imu.angular_velocity, *imu.specific_force)
        assert felt == pytest.approx(tuple(data.sensordata), abs=1e-9)
        assert session.onboard.rotors[0] == pytest.approx(tuple(data.act), abs=1e-12)
        farthest = max(farthest, numpy.abs(session.data.qpos[:7] - data.qpos).max())
    assert farthest < 1e-9
    assert abs(data.qpos[0]) > 0.5
