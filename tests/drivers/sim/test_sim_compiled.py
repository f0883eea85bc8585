"""Physics steps that Numba has compiled, where it is installed, are those of the plain install."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from importlib.util import find_spec

import pytest
from sim_worlds import PERIOD, QUIET, STOPPED, lift, push, seat, thrust, world

from kybflow.core.signals import NS, Imu
from kybflow.drivers.sim import SimParams
from kybflow.drivers.sim.steps.stepper import Stepper
from kybflow.parts import Effect

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
    with pytest.warns(UserWarning, match="no such type; Python makes them"):
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
        [sys.executable, "-c", second], check=True, capture_output=True, text=True,
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
