"""A hand that feels: forces are bounded, and the device gives out no more energy than it got."""

from __future__ import annotations

import random
import sys
from math import nan, sin

import pytest
import waiting
from fake_force_dimension import FakeForceDimension

from kybflow.core.errors import DriverError
from kybflow.core.files import File
from kybflow.core.geometry import ZERO, Vec3, norm
from kybflow.core.signals import NS, InputReading
from kybflow.inputs.haptic import Haptic, HapticLink, HapticParams
from kybflow.inputs.haptics import (
    FADE_TIME_S,
    HOLD_TIME_S,
    INITIAL_ENERGY,
    EnergyTank,
    HapticState,
    SimulatedHand,
)
from kybflow.inputs.rows import parse


def hand_of(*moves: tuple[float, float, float, float]) -> str:
    """The script of a hand: where it wants to be from each time on."""
    return "t, x, y, z\n" + "\n".join(", ".join(map(repr, move)) for move in moves)


def opened(text: str, **own: float) -> tuple[HapticLink, SimulatedHand]:
    params = HapticParams(device="simulated", hand=File("hand.csv", text, text), **own)  # type: ignore[arg-type]
    device = SimulatedHand(parse(text).rows, params.reach)
    return HapticLink(params, device, threaded=False), device


def read(link: HapticLink, now: int) -> InputReading:
    reading = link.read(now)
    assert reading is not None
    return reading


def test_the_position_of_the_hand_is_the_axes() -> None:
    link, _ = opened(hand_of((0.0, 1.0, -0.5, 0.05)), dead_zone=0.1)
    said = read(link, NS)
    assert pytest.approx(1.0, abs=0.02) == said.axes["x"]
    assert pytest.approx(-(0.5 - 0.1) / 0.9, abs=0.02) == said.axes["y"]
    assert (said.axes["z"], said.axes["turn"]) == (0.0, 0.0)


def test_a_push_moves_the_hand_and_is_told_as_a_share_of_the_largest_force() -> None:
    link, _ = opened(hand_of((0.0, 0.5, 0.0, 0.0)), spring=0.0, damping=0.0, most=4.0, force=4.0)
    before = read(link, NS).axes["x"]
    for tick in range(250):
        link.apply_force((-2.0, 0.0, 0.0))
        said = read(link, NS + tick * NS // 250)
    assert said.axes["x"] < before - 0.1
    assert -1.0 <= said.axes["force_x"] < -0.1


def pushes(kind: str, seed: int):
    """What a vehicle might let the hand feel, however wrong."""
    draw = random.Random(seed)

    def push(time: float, said: InputReading, older: InputReading) -> Vec3:
        match kind:
            case "random":
                return (draw.uniform(-9, 9), draw.uniform(-9, 9), draw.uniform(-9, 9))
            case "shaking":
                return (9.0 * sin(60.0 * time), 9.0 * sin(47.0 * time), 0.0)
            case "along":  # pushes wherever the hand goes, as a delay makes it
                return (9.0 * older.axes["x"], 9.0 * older.axes["y"], 9.0 * older.axes["z"])
            case "wall":
                return (-20.0 if said.axes["x"] > 0.3 else 0.0, 0.0, 0.0)
        return ZERO

    return push


def drawn(
    rate: int, seed: int, seconds: float, jitter: float
) -> tuple[HapticLink, SimulatedHand, list[int]]:
    """A hand that goes anywhere, stiff and strong forces, and the times of the ticks."""
    draw = random.Random(1000 * rate + seed)
    moves = [(0.4 * i, *(draw.uniform(-1, 1) for _ in range(3))) for i in range(int(3 * seconds))]
    link, device = opened(hand_of(*moves), spring=6.0, damping=8.0, most=12.0, force=8.0)
    times, now = list[int](), 0
    while now < seconds * NS:
        times.append(now)
        late = draw.random() < jitter
        now += int(draw.uniform(0.02, 0.2) * NS) if late else NS // rate
    return link, device, times


def energy_given(
    kind: str, rate: int, seed: int, seconds: float = 4.0, jitter: float = 0.05, delay: int = 25
) -> tuple[float, float]:
    """The most energy that the device had given at any time, and its strongest force as a share of
    the largest, where the vehicle answers `delay` ticks late."""
    link, device, times = drawn(rate, seed, seconds, jitter)
    push, most, strongest = pushes(kind, seed), 0.0, 0.0
    said: list[InputReading] = []
    for now in times:
        said.append(read(link, now))
        link.apply_force(push(now / NS, said[-1], said[max(0, len(said) - 1 - delay)]))
        most = max(most, device.given)
        strongest = max(strongest, norm(tuple(said[-1].axes[f"force_{a}"] for a in "xyz")))  # type: ignore[arg-type]
    return most, strongest


@pytest.mark.parametrize("rate", [100, 250])
@pytest.mark.parametrize("kind", ["random", "shaking", "along", "wall"])
def test_it_is_passive_whatever_it_is_told_to_feel(kind: str, rate: int) -> None:
    most, strongest = energy_given(kind, rate, rate)
    assert most <= INITIAL_ENERGY + 1e-9
    assert 0.05 < strongest <= 1.0 + 1e-9


@pytest.mark.thorough
@pytest.mark.parametrize("rate", [100, 250])
@pytest.mark.parametrize(
    "seed", [s if s < 3 else pytest.param(s, marks=pytest.mark.slow) for s in range(10)]
)
def test_it_is_passive_with_any_delay_and_late_ticks(seed: int, rate: int) -> None:
    draw = random.Random(seed)
    for kind in ("random", "shaking", "along", "wall"):
        delay, jitter = draw.randrange(60), draw.uniform(0.0, 0.3)
        most, _ = energy_given(kind, rate, seed, 8.0, jitter, delay)
        assert most <= INITIAL_ENERGY + 1e-9


@pytest.mark.parametrize("rate", [100, 250])
def test_without_its_tank_an_active_law_gives_energy(
    rate: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(EnergyTank, "passed", lambda self, force, state: force)
    most, _ = energy_given("along", rate, rate)
    assert most > 10 * INITIAL_ENERGY


def faded(link: HapticLink, device: SimulatedHand, after: float) -> tuple[float, float]:
    """The force before, and `after` seconds later without a word of the tick, of a hand at rest."""
    for tick in range(250):
        read(link, tick * NS // 250)
        link.apply_force((-1.0, 0.0, 0.0))
    before = norm(device.force)
    read(link, NS + int(after * NS))
    return before, norm(device.force)


def test_a_force_fades_when_the_tick_says_nothing() -> None:
    link, device = opened(hand_of((0.0, 0.5, 0.0, 0.0)), damping=0.0)
    before, after = faded(link, device, HOLD_TIME_S + FADE_TIME_S + 0.002)
    assert HOLD_TIME_S + FADE_TIME_S <= 0.2
    assert before > 1.0
    assert after == 0.0


def test_a_force_fades_when_there_is_nothing_to_feel() -> None:
    link, device = opened(hand_of((0.0, 0.5, 0.0, 0.0)), damping=0.0)
    before, _ = faded(link, device, 0.0)
    link.apply_force(None)
    read(link, NS + NS // 20)
    half = norm(device.force)
    read(link, NS + int((FADE_TIME_S + 0.004) * NS))
    assert 0.2 * before < half < 0.9 * before
    assert norm(device.force) == 0.0


def test_a_device_that_gives_no_number_gets_no_force_and_is_no_full_stick() -> None:
    link, device = opened(hand_of((0.0, 0.5, 0.0, 0.0)))
    faded(link, device, 0.0)
    device.read = lambda now: HapticState((nan, 0.0, 0.0), (nan, 0.0, 0.0))  # type: ignore[method-assign]
    said = read(link, 2 * NS)
    assert said.axes["x"] != said.axes["x"]
    assert device.force == ZERO


def test_a_device_of_force_dimension_is_driven_by_a_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    dhd = FakeForceDimension()
    monkeypatch.setitem(sys.modules, "forcedimension_core", dhd)
    dhd.position, dhd.mask = (-0.05, 0.0, 0.0), 2
    link = Haptic.open(HapticParams(), lambda _: None)
    assert isinstance(link, HapticLink)
    try:
        waiting.until(lambda: link.read(NS) is not None, "a reading")
        said = read(link, NS)
        assert (said.axes["x"], said.held) == (1.0, {"button1"})

        def pushed() -> bool:
            link.read(NS)
            link.apply_force((-1.0, 0.0, 0.0))
            return dhd.force[0] > 2.0

        waiting.until(pushed, "a force")
        waiting.until(lambda: dhd.force == (0.0, 0.0, 0.0), "the force to fade")
        dhd.fails = True
        waiting.until(lambda: link.trouble() is not None, "trouble")
        dhd.fails = False
        waiting.until(lambda: link.trouble() is None, "the end of the trouble")
    finally:
        link.close()
    assert (dhd.force, dhd.forces, dhd.is_open) == ((0.0, 0.0, 0.0), False, False)


def test_no_device_of_force_dimension_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    dhd = FakeForceDimension()
    dhd.is_there = False
    monkeypatch.setitem(sys.modules, "forcedimension_core", dhd)
    with pytest.raises(DriverError, match="no device"):
        Haptic.open(HapticParams(), lambda _: None)


def test_a_spring_gives_back_what_was_put_in() -> None:
    moves = hand_of((0.0, 0.0, 0.0, 0.0), (0.3, 1.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))
    link, device = opened(moves, damping=0.0)
    for tick in range(500):
        read(link, tick * NS // 250)
        link.apply_force(ZERO)
        if tick == 249:
            stored = device.given
    assert stored < -0.01
    assert pytest.approx(0.0, abs=0.01) == device.given


def test_without_the_makers_library_it_says_what_is_needed() -> None:
    with pytest.raises(DriverError, match="need"):
        Haptic.open(HapticParams(), lambda _: None)


def test_a_simulated_hand_needs_a_script() -> None:
    objection = Haptic.objection(HapticParams(device="simulated"))
    assert objection is not None
    assert "needs a script" in objection.reason
