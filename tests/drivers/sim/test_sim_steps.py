"""The physics steps: the attitude law, rotors and IMU against MuJoCo's own, and the steps of
Numba."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from importlib.util import find_spec
from math import radians, sin, sqrt

import mujoco
import numpy
import pytest
from sim_worlds import FRAME, PERIOD, QUIET, STOPPED, lift, opened, push, seat, thrust, world

from kybflow.cli.output import notices
from kybflow.core.geometry import from_euler, from_heading
from kybflow.core.signals import NS, Imu
from kybflow.drivers.sim import SimParams
from kybflow.drivers.sim.model import loaded
from kybflow.drivers.sim.steps.onboard import AT_REST, _gains, control
from kybflow.drivers.sim.steps.stepper import Stepper
from kybflow.parts import Effect
from kybflow.world.vehicle_context import Parcel

STEP = 0.002


def rotors(attitude, wanted):
    """The first controls of the four rotors at rest in `attitude`, asked for `wanted` at 40 %."""
    filtered, setpoint = (*attitude, 0.0, 0.0, 0.0, 0.0), (1.0, *wanted, 0.0, 0.0, 0.0, 0.4, 0.0)
    still = (0.0, 0.0, 0.0, 0.4, 0.0, 0.0, 0.0)
    assert len(still) == len(AT_REST)
    return control(still, filtered, (0.0, 0.0, 0.0), setpoint, _gains(FRAME, STEP))[1]


@pytest.mark.parametrize("turned", [0.0, 30.0, 90.0, 150.0, -120.0])
@pytest.mark.parametrize("roll", [2.0, -1.0])
def test_a_heading_that_is_far_off_changes_nothing_about_the_tilt(turned: float, roll: float):
    a, b, c, d = rotors(from_euler(radians(roll), 0.0, 0.0), from_heading(radians(turned)))
    x, y, z, w = rotors(from_euler(radians(roll), 0.0, 0.0), from_heading(0.0))
    assert (a + b - c - d, b + c - a - d) == pytest.approx((x + y - z - w, y + z - x - w))
    assert b + c - a - d == pytest.approx(0.0, abs=1e-9), "a roll needs no pitch"
    assert (a - b + c - d) * turned >= 0.0, "it turns the shorter way"


def test_upside_down_its_controls_stay_in_bounds():
    assert all(0.0 <= part <= 1.0 for part in rotors((0.0, 1.0, 0.0, 0.0), from_heading(0.0)))


def lifted(a, b, c, d):
    """Thrust, roll, pitch and yaw of four rotors, as parts of what one can give."""
    return a + b + c + d, a + b - c - d, b + c - a - d, a - b + c - d


def asked(lift, attitude, spin=0.0, rates=(0.0, 0.0)):
    """The controls that hold `lift`, long asked for, in `attitude` and at these turn rates."""
    filtered, gains = (*attitude, 0.0, 0.0, 0.0, 0.0), _gains(FRAME, STEP)
    setpoint = (1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, lift, 0.0)
    still = (0.0, 0.0, 0.0, lift, 0.0, 0.0, 0.0)
    return control(still, filtered, (*rates, spin), setpoint, gains)[1]


@pytest.mark.parametrize("lift", [0.4, 0.6, 0.75])
def test_what_one_diagonal_cant_lift_the_other_does(lift):
    tilted = from_euler(0.02, 0.02, 0.0)
    thrust, roll, pitch, _ = lifted(*asked(lift, tilted))
    _, roll_asked, pitch_asked, _ = lifted(*asked(0.4, tilted))
    assert max(asked(lift, tilted)) <= 1.0
    assert thrust == pytest.approx(4.0 * lift), "all the thrust that is asked for"
    assert (roll, pitch) == pytest.approx((roll_asked, pitch_asked))


def test_roll_and_pitch_come_before_thrust():
    tilted = from_euler(0.02, 0.02, 0.0)
    thrust, roll, pitch, _ = lifted(*asked(1.0, tilted))
    assert (roll, pitch) == pytest.approx(lifted(*asked(0.4, tilted))[1:3])
    assert thrust == pytest.approx(4.0 - max(abs(roll), abs(pitch))), "all that they leave"


def test_a_spin_is_foreseen_for_as_long_as_the_rotors_need():
    """What is asked of a body that turns is asked in the frame that it will have."""
    spin, gains = 30.0, _gains(FRAME, STEP)
    roll, pitch = lifted(*asked(0.4, from_euler(0.005, 0.0, 0.0)))[1:3]
    turned_roll, turned_pitch = lifted(*asked(0.4, from_euler(0.005, 0.0, 0.0), spin))[1:3]
    assert pitch == pytest.approx(0.0, abs=1e-9)
    assert turned_roll == pytest.approx(roll)
    assert turned_pitch == pytest.approx(-spin * gains.lag * roll, rel=0.01)


def test_a_declared_cascade_leads_no_rotor():
    cascade = replace(FRAME, attitude_gain=6.5, rate_gain=18.0)
    gains = _gains(cascade, STEP)
    assert (gains.lead, gains.lag) == (1.0, 0.0)
    still = (0.0, 0.0, 0.0, 0.4, 0.0, 0.0, 0.0)
    filtered = (*from_euler(0.01, 0.0, 0.0), 0.0, 0.0, 0.0, 0.0)
    setpoint = (1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.4, 0.0)
    lift, roll, *_ = lifted(*control(still, filtered, (0.0, 0.0, 0.0), setpoint, gains)[1])
    assert roll == pytest.approx(-4.0 * gains.roll * 6.5 * 18.0 * sin(0.01), rel=0.01)
    assert lift == pytest.approx(4.0 * 0.4)


needs_numba = pytest.mark.skipif(find_spec("numba") is None, reason="needs the extra `fast`")


@pytest.fixture
def plain(monkeypatch):
    """Makes a world as if Numba were not installed."""

    def build(*seats):
        with monkeypatch.context() as patch:
            patch.setitem(sys.modules, "numba", None)
            return world(*seats)

    return build


def flight(build):
    """Three vehicles: one is listened to and its IMU breaks, one is deserted, one is late."""
    params = SimParams(gust=0.5, mocap_rate=130.0, calm=False)
    session = build(*(seat(name, (3.0 * i, 0.0, 0.0), params) for i, name in enumerate("abc")))
    a, b, c = session.links.values()
    a.subscribe(frozenset({Imu}))
    measured, now = push(session, a, 0.3, STOPPED)
    c.faults.begin(Effect(late=0.013, rotors=(0.9, 1.0, 1.0, 1.0)), now)
    biased = Effect(gyro_bias=(0.01, 0.0, 0.0), accelerometer_bias=(0.0, 0.0, 0.2))
    for tick in range(500):
        if tick == 100:
            a.faults.begin(biased, now)
        if tick == 200:
            a.faults.end(biased)
        for link in (a, b, c) if tick < 250 else (a, c):
            link.send(thrust(12.0), now)
        now += PERIOD
        session.advance(now)
        measured += [*a.read(now), *b.read(now), *c.read(now)]
    return measured, [link.truth() for link in (a, b, c)], session


@needs_numba
def test_the_flight_is_the_same_to_the_bit(plain):
    measured, truths, session = flight(world)
    slow_measured, slow_truths, slow = flight(plain)
    assert isinstance(slow._stepper, Stepper)
    assert not isinstance(session._stepper, Stepper)
    assert (measured, truths) == (slow_measured, slow_truths)


@pytest.fixture
def compiler(monkeypatch, tmp_path):
    """Notes what is compiled, and keeps it in a folder of its own or one that can't be."""
    from kybflow.drivers.sim.steps import compiled, kernel

    asked = []

    def made(name):
        asked.append(name)
        return b"machine code"

    (tmp_path / "a file").touch()
    monkeypatch.setattr(compiled, "PLACES", (tmp_path / "a file" / "in it", tmp_path / "kept"))
    monkeypatch.setattr(kernel, "machine_code", made)
    return asked


@needs_numba
def test_a_kernel_that_does_not_compile_is_done_without(plain, compiler, monkeypatch):
    from kybflow.drivers.sim.steps import kernel

    def refuses(name):
        raise RuntimeError("no such type")

    monkeypatch.setattr(kernel, "machine_code", refuses)
    with pytest.warns(UserWarning, match="no such type; Python computes them"):
        session = world(seat(params=replace(QUIET, gust=0.3)))
    assert isinstance(session._stepper, Stepper)
    lift(session, session.links["a"], seconds=1.0)
    other = plain(seat(params=replace(QUIET, gust=0.3)))
    lift(other, other.links["a"], seconds=1.0)
    assert session.links["a"].truth() == other.links["a"].truth()
    assert session.now == NS


@needs_numba
def test_machine_code_that_cannot_be_kept_is_done_without(compiler, monkeypatch):
    from kybflow.drivers.sim.steps import compiled

    monkeypatch.setattr(compiled, "PLACES", compiled.PLACES[:1])
    with pytest.warns(UserWarning, match="Not a directory"):
        session = world(seat())
    assert isinstance(session._stepper, Stepper)


@needs_numba
def test_machine_code_is_kept_where_it_can_be_written(compiler, tmp_path):
    from kybflow.drivers.sim.steps.compiled import _kept

    assert [_kept("a law"), _kept("a law")] == [b"machine code", b"machine code"]
    assert len(compiler) == 1
    _kept("another law")
    assert len(compiler) == 2
    assert len(list((tmp_path / "kept").iterdir())) == 2


@needs_numba
@pytest.mark.parametrize("is_read", [True, False])
def test_a_person_is_told_once_that_it_compiles(compiler, capsys, monkeypatch, is_read):
    from kybflow.drivers.sim.steps.compiled import _kept

    monkeypatch.setattr(sys.stderr, "isatty", lambda: is_read)
    with notices():
        _kept("a law")
        _kept("a law")
    _kept("another law")
    told = capsys.readouterr().err.splitlines()
    assert [line.split(",")[0] for line in told] == ["compiling the physics steps"] * is_read


@needs_numba
def test_damaged_machine_code_is_compiled_anew(compiler, tmp_path):
    from kybflow.drivers.sim.steps.compiled import _kept

    _kept("a law")
    (file,) = (tmp_path / "kept").iterdir()
    file.write_bytes(file.read_bytes()[:-1])
    assert _kept("a law") == b"machine code"
    assert _kept("a law") == b"machine code"
    assert len(compiler) == 2


@needs_numba
def test_a_kept_kernel_is_loaded_without_numba():
    world(seat())
    second = "from sim_worlds import seat, world; import sys; world(seat()); print(*sys.modules)"
    run = subprocess.run(
        [sys.executable, "-P", "-c", second], check=True, capture_output=True, text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )  # fmt: skip
    loaded = run.stdout.split()
    assert "kybflow.drivers.sim.steps.compiled" in loaded
    assert not {"numba", "scipy", "kybflow.drivers.sim.steps.kernel"} & set(loaded)


@needs_numba
def test_another_law_is_another_kernel():
    from kybflow.drivers.sim.steps.compiled import _fingerprint

    first, second = (eval(f"lambda x: x * {k}") for k in ("2.0", "3.0"))
    assert _fingerprint([first]) == _fingerprint([first]) != _fingerprint([second])


PHYSICS_STEP = NS // 500
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
    session, link = opened(bare._replace(context=bare.context._replace(payload=parcel)))
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
        now += PHYSICS_STEP
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
