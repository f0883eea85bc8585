"""What is lost in flight, on a real autopilot in its own simulator: motion capture, the link, the
mission itself, the say. Measured figures are printed: `-rP` shows them."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

import pytest
from real_flights import Room, Wires, first, full_flight, level_drift, plan_of, shown
from short_flights import named, path
from toolchain import MISSIONS
from witness import Witness

from kybflow.api.flight import Flown
from kybflow.core.geometry import Vec3, norm
from kybflow.core.signals import NS, Event, Time
from kybflow.drivers.mavlink.telemetry.received_status import LandedState
from kybflow.runtime.engine import Engine
from kybflow.world.vehicle_context import VehicleContext

pytestmark = pytest.mark.firmware
Beside = Callable[[Mapping[int, str]], Witness]
NAMES = {"mk": 1, "nano": 2}
REACTS = 0.3
"""Seconds from the last pose to the reaction, asked of kybflow."""
SPEED = 1.5
"""Metres a second with which it may touch down blindly."""
SWITCH = {"px4": ("land", 1.2), "ardupilot": ("hold", 5.0)}
"""The mode that a pilot asks for, and after how many seconds the vehicle is given back. PX4 refuses
its hold without a place on earth, and modes by hand without a transmitter."""
FAR = 3.0
"""Metres that it may come down from where it was when its mission died."""
COMES_DOWN = 45.0
"""Seconds in which a vehicle without a mission must be disarmed on the ground."""


def flies(engine: Engine, seconds: float, vehicle: str = "mk") -> bool:
    """Whether it has flown its eight for so long."""
    one = next(v for v in engine.vehicles if v.name == vehicle)
    return engine.flying and one.state == "eight" and one.now - one.runner.entered > seconds * NS


def shown_since(begun: list[Time], flight: Flown, told: list[Event]) -> None:
    """Show what was told since then, if it began at all, and how the flight ended."""
    for event in told:
        if begun and event.time >= begun[0]:
            shown(f"{(event.time - begun[0]) / NS:.2f} {event.vehicle} {event.name} {event.fields}")
    shown(flight.summary["outcome"], flight.summary["reason"])


def test_motion_capture_lost_for_good(two: str, tmp_path: Path):
    room, at, down = Room(), dict[str, Vec3](), dict[str, tuple[Time, Vec3, Vec3]]()

    def look(engine: Engine) -> None:
        for v in engine.vehicles:
            if v.truth is None:
                continue
            if flies(engine, 5.0, v.name) and v.name not in at:
                room.silent.add(v.name)
                at[v.name] = v.truth.position
            if v.name in at and v.name not in down and v.truth.position[2] < 0.03:
                down[v.name] = (v.now, v.truth.position, v.truth.velocity)

    plan = room.into(plan_of(MISSIONS / "figure_eight.yaml", two))
    _, told, engine = full_flight(plan, tmp_path, look)
    for v in engine.vehicles:
        began, last = first(told, "failsafe_started", v.name), room.last[v.name]
        assert began is not None
        reacted = (began.time - last) / NS
        time, place, speed = down[v.name]
        drift = level_drift(place, at[v.name])
        shown(f"{two} {v.name}: {began.name} {began.fields['reaction']} after {reacted:.3f} s,")
        shown(f"  down after {(time - last) / NS:.1f} s, {drift:.2f} m off, at {-speed[2]:.2f} m/s")
        assert reacted <= REACTS
        assert -speed[2] < SPEED
        assert v.link_out.armed is False


def test_an_estimate_that_jumps_by_a_metre(two: str, tmp_path: Path):
    room, at, down = Room(), dict[str, Vec3](), dict[str, float]()

    def look(engine: Engine) -> None:
        for v in engine.vehicles:
            if v.truth is not None and flies(engine, 5.0, v.name) and v.name not in at:
                room.mistaken.add(v.name)
                at[v.name] = v.truth.position
            if v.truth is not None and v.name in at:
                down[v.name] = level_drift(v.truth.position, at[v.name])

    plan = room.into(plan_of(MISSIONS / "figure_eight.yaml", two))
    _, told, engine = full_flight(plan, tmp_path, look)
    for v in engine.vehicles:
        began = first(told, "failsafe_started", v.name)
        assert began is not None
        shown(f"{two} {v.name}: {began.fields['reason']}, down {down[v.name]:.2f} m off")
        assert down[v.name] < FAR
        assert v.link_out.armed is False


def test_set_points_that_stall(two: str, tmp_path: Path, beside: Beside):
    """The engine hangs for two seconds, in which it can do nothing."""
    witness, hung = beside({1: two, 2: two}), list[Time]()

    def look(engine: Engine) -> None:
        if not hung and flies(engine, 5.0):
            hung.append(engine.clock.now)
            witness.wait(lambda: False, 2.0)

    plan = plan_of(MISSIONS / "figure_eight.yaml", two)
    flight, told, engine = full_flight(plan, tmp_path, look)
    shown_since(hung, flight, told)
    assert hung
    for v in engine.vehicles:
        assert v.link_out.armed is False


@pytest.mark.parametrize("seconds", [0.3, 1.0, 5.0])
def test_a_link_that_is_cut(two: str, seconds: float, tmp_path: Path, monkeypatch, beside: Beside):
    witness = beside({1: two, 2: two})
    room = Room({name: witness.of[system] for name, system in NAMES.items()}, witness)
    wires, cut = Wires(monkeypatch), list[Time]()

    def look(engine: Engine) -> None:
        if not cut and flies(engine, 5.0):
            cut.append(engine.clock.now)
        wires.is_cut = bool(cut) and engine.clock.now - cut[0] < seconds * NS

    plan = room.into(plan_of(MISSIONS / "figure_eight.yaml", two))
    flight, told, engine = full_flight(plan, tmp_path, look)
    shown_since(cut, flight, told)
    assert cut, flight.summary["reason"]
    assert witness.wait(lambda: all(w.rests for w in witness.of.values()), 5.0)
    for v in engine.vehicles:
        assert v.link_out.armed is False
        if seconds < 1.0:
            assert path(told, v.name) == ["up", "steady", "eight", "down", "landed"]


def test_a_pilot_takes_one_and_gives_it_back(two: str, tmp_path: Path, beside: Beside):
    witness, taken, back = beside({1: two, 2: two}), list[Time](), list[Time]()
    mode, seconds = SWITCH[two]

    def look(engine: Engine) -> None:
        now = engine.clock.now
        witness.look(now)
        if not taken and flies(engine, 4.0):
            taken.append(now)
            witness.of[1].fly_in(mode, now)
        if taken and not back and now - taken[0] > seconds * NS:
            back.append(now)
            engine.vehicles[0].requests.resume("operator")

    plan = plan_of(MISSIONS / "figure_eight.yaml", two)
    flight, told, engine = full_flight(plan, tmp_path, look)
    shown_since(taken, flight, told)
    lost, returned = first(told, "control_taken", "mk"), first(told, "control_returned", "mk")
    assert lost is not None
    assert returned is not None
    assert not named(told, "failsafe_started")
    for v in engine.vehicles:
        assert path(told, v.name) == ["up", "steady", "eight", "down", "landed"]
        assert v.link_out.armed is False


def test_a_mission_that_is_killed(two: str, tmp_path: Path, beside: Beside):
    witness = beside({1: two, 2: two})
    mission = MISSIONS / "figure_eight.yaml"
    for v in plan_of(mission, two).vehicles:
        witness.of[NAMES[v.name]].behold(
            VehicleContext(v.name, v.airframe, v.start, v.heading, None, 0.01)
        )
    command = [sys.executable, "-m", "kybflow", "run", str(mission), "--target", two, "--plain"]
    process = subprocess.Popen(
        [*command, "--out", str(tmp_path / "run")], stdout=subprocess.DEVNULL
    )
    try:
        every = witness.of.values()
        assert witness.wait(lambda: all(w.heard.landed is LandedState.AIR for w in every), 60.0)
        witness.wait(lambda: False, 12.0)
        assert process.poll() is None
        assert not any(w.rests for w in every)
    finally:
        os.kill(process.pid, signal.SIGKILL)
        process.wait()
    killed, modes = witness.now, [w.heard.mode for w in every]
    left, fastest = [w.here() for w in every], 0.0

    def acts() -> bool:
        nonlocal fastest
        fastest = max(fastest, *(norm(w.here().velocity) for w in every))
        return modes != [w.heard.mode for w in every]

    assert witness.wait(acts, COMES_DOWN)
    shown(f"{two}: {(witness.now - killed) / NS:.1f} s until it acts, at most {fastest:.2f} m/s")
    assert witness.wait(lambda: all(w.rests for w in every), COMES_DOWN)
    shown(f"{two}: {(witness.now - killed) / NS:.1f} s until both are disarmed on the ground")
    for w, began in zip(every, left, strict=True):
        drift = level_drift(w.here().position, began.position)
        shown(f"  {drift:.2f} m from where it was")
        assert drift < FAR
