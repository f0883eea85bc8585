"""What looks like a slip and is none: nothing is said of it."""

from __future__ import annotations

from pathlib import Path

import pytest
from toolchain import result_of

from kybflow.runtime.faults.gust import Gust, GustParams
from kybflow.runtime.faults.imu_bias_step import ImuBiasStep, ImuBiasStepParams
from kybflow.runtime.faults.mass_change import MassChange, MassChangeParams
from kybflow.runtime.faults.mocap_dropout import MocapDropout, MocapDropoutParams
from kybflow.runtime.faults.mocap_noise import MocapNoise, MocapNoiseParams

MISSION = """\
kybflow: 1
mission: sensible
import: {std: kybflow/airframes}
world:
  fence: {from: [-3, -3, 0], to: [3, 3, 2.5]}
  obstacles: {table: {box: {from: [1.5, -0.5, 0], to: [2.5, 0.5, 1]}}}
groups: {both: [a, b]}
vehicles:
  a:
    like: std.nano_plus
    start: {at: [0, 0, 0]}
    behaviors:
      up:   {do: take_off, height: 1.5 m, then: hold, within: 15 s}
      hold: {do: hover, for_time: 3 s, then: down}
      down: {do: land}
  b: {like: a, start: {at: [-2, 0, 0]}}
"""
UNUSED = "KYB112"
"""Only some of the missions use the group."""
HOLD = "      hold: {do: hover, for_time: 3 s, then: down}\n"
DOWN = "      down: {do: land}\n"
START = "    start: {at: [0, 0, 0]}\n"


def hold(way: str) -> tuple[str, str]:
    return HOLD, HOLD.replace("then", f"next: [{{{way}, go: down}}], then")


def at_the_end(text: str) -> tuple[str, str]:
    return "  b: {like: a, start: {at: [-2, 0, 0]}}\n", (
        f"  b: {{like: a, start: {{at: [-2, 0, 0]}}}}\n{text}\n"
    )


def only_warns(way: str) -> tuple[str, str]:
    warns = START + "    supervisors: [{use: battery, reaction: warn}]\n"
    return MISSION, MISSION.replace(START, warns).replace(*hold(way))


@pytest.mark.parametrize(
    "change",
    [
        hold("when: a in down"),  # b is like a, and waits for a
        hold("when: any both in down"),
        hold("when: not a in hold"),
        hold("when: elapsed > 2 s"),
        hold("event: any.landed"),
        hold("event: b.landed"),
        hold("after: 5 s"),
        (HOLD, HOLD.replace("then", "within: 20 s, then")),
        only_warns("event: battery_low"),
        only_warns("when: battery.remaining < 20 %"),
        (
            f"{HOLD}{DOWN}  b: {{like: a, start: {{at: [-2, 0, 0]}}}}",
            "      hold: {do: fly_to, position: [2, 0, 1.5], then: down}\n"
            "      down: {do: land, position: [2, 0, 1]}\n"
            "  b: {like: a, start: {at: [-2, 0, 0]}, behaviors: {\n"
            "    hold: {position: [-2, 1, 1.5]}, down: {position: [-2, 1, 0]}}}",
        ),
        (START, "    start: {at: [0, 0, 0], heading: -350 deg}\n"),
        at_the_end("expect: [finally a in landed, finally not a in fault, eventually a in hold]"),
        at_the_end("on: [{event: a.landed, do: [{switch: {both: down}}]}]"),
        at_the_end(
            "on: [{event: a.behavior_ended, behavior: hold, how: failed,"
            " do: [{switch: {a: hold}}]}]"
        ),
        at_the_end("on: [{event: any.took_off, when: b in up, do: [{stop: enough}]}]"),
        at_the_end("on: [{event: a.behavior_started, behavior: up, do: [{switch: {a: down}}]}]"),
        at_the_end("faults: [{at: 5 s, on: a, inject: mass_change, added: 20 g}]"),
        at_the_end("targets: {sim: {all: {driver: {use: sim, battery: 20 %}}}}"),
    ],
    ids=lambda change: change[1].strip()[:60],
)
def test_nothing_is_said(change: tuple[str, str], tmp_path: Path) -> None:
    assert change[0] in MISSION
    found = result_of(tmp_path / "mission.yaml", MISSION.replace(*change)).diagnostics
    assert [(d.code, d.message) for d in found if d.code != UNUSED] == []


def test_a_fault_says_whether_it_is_one() -> None:
    assert Gust.is_nothing(GustParams(velocity=(0.0, 0.0, 0.0)))
    assert not Gust.is_nothing(GustParams(velocity=(0.0, 1.0, 0.0)))
    assert ImuBiasStep.is_nothing(ImuBiasStepParams())
    assert not ImuBiasStep.is_nothing(ImuBiasStepParams(gyro=(0.0, 0.0, 0.1)))
    assert MassChange.is_nothing(MassChangeParams())
    assert not MassChange.is_nothing(MassChangeParams(factor=1.2))
    assert not MocapNoise.is_nothing(MocapNoiseParams())
    assert not MocapDropout.is_nothing(MocapDropoutParams())
