"""Physics steps that Numba has compiled, where it is installed, are those of the plain install."""

from __future__ import annotations

import sys
from dataclasses import replace
from importlib.util import find_spec

import pytest
from sim_worlds import PERIOD, QUIET, STOPPED, lift, push, seat, thrust, world

from kybflow.core.signals import NS, Imu
from kybflow.drivers.sim import SimParams
from kybflow.drivers.sim.stepping import Stepper
from kybflow.parts import Effect

needs_numba = pytest.mark.skipif(find_spec("numba") is None, reason="needs the extra `fast`")


@pytest.fixture
def plain(monkeypatch):
    """Makes a world as if Numba were not installed."""

    def build(*seats):
        with monkeypatch.context() as patch:
            patch.setitem(sys.modules, "kybflow.drivers.sim.compiled", None)
            return world(*seats)

    return build


def flight(build):
    """Three vehicles: one is listened to and its IMU breaks, one is deserted, one is late."""
    params = SimParams(gust=0.5, mocap_rate=130.0)
    session = build(*(seat(name, (3.0 * i, 0.0, 0.0), params) for i, name in enumerate("abc")))
    a, b, c = session.links.values()
    a.subscribe(frozenset({Imu}))
    measured, now = push(session, a, 0.3, STOPPED)
    c.rig.begin(Effect(late=0.013, rotors=(0.9, 1.0, 1.0, 1.0)), now)
    biased = Effect(gyro_bias=(0.01, 0.0, 0.0), accelerometer_bias=(0.0, 0.0, 0.2))
    for tick in range(500):
        if tick == 100:
            a.rig.begin(biased, now)
        if tick == 200:
            a.rig.end(biased)
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


@needs_numba
def test_a_kernel_that_does_not_compile_is_done_without(plain, monkeypatch):
    from kybflow.drivers.sim import compiled

    def refuses(fingerprint):
        raise RuntimeError("no place to keep what is compiled")

    monkeypatch.setattr(compiled, "_kernel", refuses)
    with pytest.warns(UserWarning, match="no place to keep what is compiled; Python makes them"):
        session = world(seat(params=replace(QUIET, gust=0.3)))
    assert isinstance(session._stepper, Stepper)
    lift(session, session.links["a"], seconds=1.0)
    other = plain(seat(params=replace(QUIET, gust=0.3)))
    lift(other, other.links["a"], seconds=1.0)
    assert session.links["a"].truth() == other.links["a"].truth()
    assert session.now == NS


@needs_numba
def test_another_law_is_another_kernel():
    from kybflow.drivers.sim.compiled import _fingerprint

    first, second = (eval(f"lambda x: x * {k}") for k in ("2.0", "3.0"))
    assert _fingerprint([first]) == _fingerprint([first]) != _fingerprint([second])
