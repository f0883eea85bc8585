"""The emulated autopilots answer as the firmwares did: one script asks both.

`firmware_answers.yaml` is printed by `bench/firmware_answers.py`; the head of the file says where
its answers come from.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml

pytest.importorskip("pymavlink", reason="pymavlink is not installed")

import firmware_answers as asking
from autopilot_bench import PERIOD, Bench
from framing import Framing

from kybflow.core.signals import NS
from kybflow.drivers.mavlink.transport.wire import memory_wires

TABLE = yaml.safe_load(
    (Path(__file__).parent / "firmware_answers.yaml").read_text(encoding="utf-8")
)
TOLERANCE = 0.25
"""Measured times, speeds and heights may differ by this fraction."""


def bench_of(firmware: str) -> Bench:
    bench = Bench(firmware, outside=False, is_prepared=False)
    bench.run(12.0)
    return bench


def client_of(bench: Bench) -> Any:
    def step() -> list[Any]:
        count = len(bench.heard)
        bench.tick()
        return bench.heard[count:]

    return asking.Client(bench.say, step, lambda: bench.now / NS)


@pytest.mark.thorough
@pytest.mark.parametrize("firmware", sorted(TABLE))
def test_it_answers_as_the_firmware_did(firmware: str) -> None:
    expected = dict(TABLE[firmware]["answers"])
    expected.pop("ground station's link has", None)
    found = asking.answers(client_of(bench_of(firmware)), firmware)
    assert found.keys() == expected.keys()
    differs = {
        question: (answer, expected[question])
        for question, answer in found.items()
        if not agrees(answer, expected[question])
    }
    assert differs == {}


def agrees(found: Any, expected: Any) -> bool:
    if isinstance(expected, float):
        return abs(found - expected) <= TOLERANCE * expected
    return bool(found == expected)


def test_px4s_link_for_ground_stations_has_streams_of_its_own() -> None:
    bench = bench_of("px4")
    mine, its = memory_wires("memory:station")
    bench.endpoint.connect(its, is_station=True)
    framing, kinds = Framing(255), set()
    for _ in range(5 * NS // PERIOD):
        bench.tick()
        for data, _ in mine.receive(bench.now):
            kinds |= {m.get_type() for m in framing.parse(data)}
    watched = {"ATTITUDE", "HIGHRES_IMU", "LOCAL_POSITION_NED", "ODOMETRY"}
    assert sorted(kinds & watched) == TABLE["px4"]["answers"]["ground station's link has"]
