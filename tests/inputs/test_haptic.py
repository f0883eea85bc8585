"""A hand that feels: forces are bounded, and the device gives out no more energy than it got."""

from __future__ import annotations

import random
from math import sin

import pytest

from kybflow.core.errors import DriverError
from kybflow.core.files import File
from kybflow.core.geometry import ZERO, Vec3, norm
from kybflow.core.signals import NS, InputReading
from kybflow.inputs.haptic import Haptic, HapticLink, HapticParams
from kybflow.inputs.haptics import RESERVE, SimulatedHand
from kybflow.inputs.rows import parse


def hand_of(*moves: tuple[float, float, float, float]) -> str:
    """The script of a hand: where it wants to be from each time on."""
    return "t, x, y, z\n" + "\n".join(", ".join(map(repr, move)) for move in moves)


def opened(text: str, **own: float) -> tuple[HapticLink, SimulatedHand]:
    params = HapticParams(device="simulated", hand=File("hand.csv", text, text), **own)  # type: ignore[arg-type]
    device = SimulatedHand(parse(text).rows, params.reach)
    return HapticLink(params, device), device


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
        link.feel((-2.0, 0.0, 0.0))
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


@pytest.mark.parametrize("rate", [100, 250])
@pytest.mark.parametrize("kind", ["random", "shaking", "along", "wall"])
def test_it_is_passive_whatever_it_is_told_to_feel(kind: str, rate: int) -> None:
    draw = random.Random(rate)
    moves = [(0.4 * i, *(draw.uniform(-1, 1) for _ in range(3))) for i in range(25)]
    link, device = opened(hand_of(*moves), spring=6.0, damping=8.0, most=12.0, force=8.0)
    push, most, strongest = pushes(kind, rate), 0.0, 0.0
    said: list[InputReading] = []
    for tick in range(10 * rate):
        said.append(read(link, tick * NS // rate))
        link.feel(push(tick / rate, said[-1], said[max(0, len(said) - 25)]))
        most = max(most, device.given)
        strongest = max(strongest, norm(tuple(said[-1].axes[f"force_{a}"] for a in "xyz")))  # type: ignore[arg-type]
    assert most <= RESERVE + 1e-9
    assert 0.05 < strongest <= 1.0 + 1e-9


def test_a_spring_gives_back_what_was_put_in() -> None:
    link, device = opened(hand_of((0.0, 1.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)), damping=0.0)
    for tick in range(500):
        read(link, tick * NS // 250)
        link.feel(ZERO)
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
