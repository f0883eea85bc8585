"""A kind of measurement, added as CONTRIBUTING.md says by a lab's package: declared in one file,
measured by a sensor, read by an estimator; nothing of kybflow changes."""

import json
from pathlib import Path

import numpy as np
import pytest
from installed_package import installed
from mcap.reader import make_reader
from pages import blocks, page
from toolchain import program

pytestmark = pytest.mark.thorough

TEXT = page("CONTRIBUTING.md").partition("## Add a kind of measurement")[2]
KIND = blocks(TEXT, "python")[0]

SENSOR = '''"""A range finder that looks down, simulated."""

from lab_range.floor_range import FloorRange

from kybflow.core.params import param, params
from kybflow.core.signals import NS
from kybflow.core.units import Length
from kybflow.parts import Sensor, Stream


@params
class RangeFinderParams:
    reach: Length = param("The greatest distance that it measures.", default=4.0, above=0.0)


class RangeFinder(Sensor[RangeFinderParams]):
    provides = frozenset({FloorRange})
    simulated = True

    @classmethod
    def open(cls, params, context, link, generator):
        return Ranges(params, link)


class Ranges(Stream):
    """50 a second; one of each ten is stamped a second ahead, and so can't be true."""

    def __init__(self, params, link):
        self.params, self.link, self.count = params, link, 0

    def read(self, now):
        if now % (NS // 50):
            return ()
        self.count += 1
        stamp = now + NS if self.count % 10 == 0 else now
        z = self.link.truth().position[2]
        return (FloorRange(stamp, z, z <= self.params.reach),)

    def close(self):
        pass
'''

ESTIMATOR = '''"""Height over the floor alone; the vehicle stands at the origin for it."""

from lab_range.floor_range import FloorRange

from kybflow.core.geometry import LEVEL, ZERO
from kybflow.core.params import params
from kybflow.core.signals import NS, Estimate
from kybflow.parts import Estimator


@params
class RangeHeightParams:
    pass


class RangeHeight(Estimator[RangeHeightParams]):
    needs = frozenset({FloorRange})
    newest = None

    def update(self, measurements, now):
        for m in measurements:
            if isinstance(m, FloorRange):
                self.newest = m
        if self.newest is None:
            return None
        time, height, _ = self.newest
        place = (0.0, 0.0, height)
        return Estimate(now, place, ZERO, LEVEL, ZERO, "range_height", (now - time) / NS, 0.01)
'''

MISSION = """
kybflow: 1
mission: ranges
summary: A range finder and an estimator of a lab's own.
import: {std: kybflow/airframes}
world: {fence: {from: [-2, -2, 0], to: [2, 2, 2.5]}}
vehicles:
  nano:
    like: std.nano_plus
    start: {at: [0, 0, 0]}
    estimators: [{use: mocap, healthy: age < 250 ms}, {use: range_height}]
    behaviors:
      up: {do: take_off, height: 1 m, then: down, within: 15 s}
      down: {do: land}
expect: [finally nano in landed, finished within 30 s]
"""
TARGET = "targets: {sim: {nano: {sensors: {range_height: range_finder}}}}\n"


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The package, its mission, and the run folder of a flight that the target's sensor is in."""
    home = tmp_path_factory.mktemp("lab")
    files = {
        "lab_range/__init__.py": "",
        "lab_range/floor_range.py": KIND,
        "lab_range/sensors/__init__.py": "",
        "lab_range/sensors/range_finder.py": SENSOR,
        "lab_range/estimators/__init__.py": "",
        "lab_range/estimators/range_height.py": ESTIMATOR,
        "without.yaml": MISSION,
        "mission.yaml": MISSION + TARGET,
    }
    installed(home, "lab_range", "parts lab_range", files)
    words = ("--seed", "0", "--out", "run", "--plain", "--no-report")
    flown = program("run", "mission.yaml", *words, cwd=home, path=[home])
    assert flown.returncode == 0, flown.stdout + flown.stderr
    return home


def messages(lab: Path, topic: str) -> list:
    with (lab / "run" / "log.mcap").open("rb") as file:
        return list(make_reader(file).iter_messages(topics=[topic]))


def test_the_compiler_says_who_lacks_it(lab: Path) -> None:
    judged = program("validate", "without.yaml", cwd=lab, path=[lab])
    assert "`range_height` needs floor_range measurements" in judged.stderr + judged.stdout
    assert "range_finder" in judged.stderr + judged.stdout, "a sensor that would do"
    assert program("validate", "mission.yaml", cwd=lab, path=[lab]).returncode == 0


def test_it_is_recorded_by_its_name_with_its_units(lab: Path) -> None:
    ranges = messages(lab, "/nano/floor_range")
    schema, _, newest = ranges[-1]
    assert schema.name == "kybflow/FloorRange"
    assert schema.data.decode() == (
        "int64 time  # ns; the time of measurement. It arrived at the message's log time.\n"
        "float64 distance  # m, along body -z\n"
        "bool is_valid  # false: nothing in reach\n"
    )
    layout = np.dtype([("time", "<i8"), ("distance", "<f8"), ("is_valid", "?")])
    read = [np.frombuffer(m.data, layout)[0] for _, _, m in ranges]
    assert max(r["distance"] for r in read) == pytest.approx(1.0, abs=0.1)
    assert read[-1]["time"] == newest.log_time
    assert all(r["is_valid"] for r in read)


def test_what_can_not_be_true_is_refused(lab: Path) -> None:
    lines = (lab / "run" / "events.jsonl").read_text(encoding="utf-8").splitlines()
    told = [e for e in map(json.loads, lines) if e["event"] == "measurement_refused"]
    (refused,) = told
    assert refused["fields"]["kind"] == "floor_range"
    assert all(
        m.log_time >= int.from_bytes(m.data[:8], "little")
        for _, _, m in messages(lab, "/nano/floor_range")
    )


def test_the_estimator_reads_it(lab: Path) -> None:
    assert len(messages(lab, "/nano/estimator/range_height")) > 50
    finished = [m for _, _, m in messages(lab, "/nano/tick")][-1]
    said = messages(lab, "/nano/estimator/range_height")[-1][2]
    assert said.data[0] == 1, "it has an estimate"
    assert finished.log_time - said.log_time < 20_000_000, "to the end"
