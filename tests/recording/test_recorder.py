"""The recording: what it holds, that it is the same each time, and what is left of it when all goes
wrong."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from mcap.exceptions import EndOfFile
from mcap.reader import make_reader
from mcap.records import Chunk, Message
from mcap.stream_reader import StreamReader
from recorded_run import LEVEL, NO_ESTIMATORS, REST, STARTED, make_plan, write_run

from kybflow.core.signals import (
    NS,
    Battery,
    Command,
    CommandKind,
    Estimate,
    Event,
    Imu,
    Odometry,
    Payload,
    Pose,
    SeenObstacle,
    Setpoint,
    SetpointKind,
    Sticks,
    Time,
    Truth,
)
from kybflow.dsl.resolving.library_files import installed
from kybflow.recording.layout import definition, dtype_spec, event_record, struct_format
from kybflow.recording.messages import read_mission, read_recording
from kybflow.recording.recorder import Recorder
from kybflow.recording.run_folder import RunUnwritten
from kybflow.report.data import read_moving
from kybflow.world.shapes import MovingSphere

TILTED = (0.5, 0.5, 0.5, -0.5)
ESTIMATE = Estimate(
    7, (1.0, 2.0, 3.0), (4.0, 5.0, 6.0), TILTED, (7.0, 8.0, 9.0), "mocap", 0.01, 0.002
)
MOVES = ((0.1, 0.2, 0.3), (0.4, 0.5, 0.6), (0.7, 0.8, 0.9))
WANTED = Setpoint(SetpointKind.POSITION, (1.5, 2.5, 3.5), *MOVES, 0.25, -0.125)
COMMAND = Command((1.0, 0.0, 0.0, 0.0), 10.25, (0.5, 0.25, 0.125), 0.75)
TRUTH = Truth((1.1, 2.1, 3.1), (4.1, 5.1, 6.1), (1.0, 0.0, 0.0, 0.0), (7.1, 8.1, 9.1))
MEASUREMENTS = [
    Pose(10, (1.0, 2.0, 3.0), (0.0, 1.0, 0.0, 0.0)),
    Battery(25, 0.75, 11.5),
    Imu(28, 0.004, (0.1, 0.2, 9.8), (0.5, 0.25, 0.125)),
    Odometry(25, (1.0, 2.0, 3.0), (4.0, 5.0, 6.0), LEVEL, (7.0, 8.0, 9.0), 0.5),
    Payload(25, True, None),
    Sticks(25, 0.1, -0.2, 0.3, 0.4, (1.0, -1.0)),
]


def fly(channel, now: Time) -> None:
    channel.tick(now, ESTIMATE, WANTED, WANTED, COMMAND, TRUTH, NO_ESTIMATORS)


def messages(path: Path, topic: str) -> list[Message]:
    with path.open("rb") as file:
        return [m for _, _, m in make_reader(file).iter_messages(topics=[topic])]


def decoded(message: Message, kind: Any) -> Any:
    """A message as it is read back."""
    return np.frombuffer(message.data, np.dtype(dtype_spec(kind)))[0]


def one_tick(
    path: Path, *, estimate=ESTIMATE, wanted=WANTED, setpoint=WANTED, command=COMMAND, truth=TRUTH
):
    """The tick that was recorded, as it is read back."""
    recorder = Recorder(path, make_plan("mk"))
    recorder.vehicle("mk").tick(
        4_000_000, estimate, wanted, setpoint, command, truth, NO_ESTIMATORS
    )
    recorder.close()
    (message,) = messages(path, "/mk/tick")
    assert (message.log_time, message.publish_time) == (4_000_000, 4_000_000)
    return decoded(message, "Tick")


def one_setpoint(path: Path, topic: str):
    """The only setpoint of a topic, as it is read back."""
    (message,) = messages(path, topic)
    assert message.log_time == 4_000_000
    return decoded(message, "Setpoint")


def one_measurement(path: Path, measurement: Any) -> Any:
    """A measurement as it is read back."""
    recorder = Recorder(path, make_plan("mk", "nano"))
    recorder.vehicle("nano").measurement(30, measurement)
    recorder.close()
    (message,) = messages(path, f"/nano/{type(measurement).__name__.lower()}")
    assert message.log_time == 30
    return decoded(message, type(measurement))


def float32(values) -> tuple[float, ...]:
    return tuple(np.array(values, np.float32).tolist())


def test_moving_obstacles_are_recorded_where_they_were_seen(tmp_path):
    ball = MovingSphere(((0.0, 0.0, 1.0), (1.0, 0.0, 1.0)), 0.2, 0.5)
    plan = replace(make_plan("mk"), moving={"ball": ball})
    recorder = Recorder(tmp_path / "log.mcap", plan)
    seen = SeenObstacle(NS, (0.5, 0.0, 1.0), (0.5, 0.0, 0.0), 0.2, 0.5)
    recorder.obstacles(2 * NS, {"ball": seen})
    recorder.close()
    (message,) = messages(tmp_path / "log.mcap", "/obstacles")
    assert message.log_time == 2 * NS
    told = json.loads(message.data)
    assert told == {"ball": {"seen_s": 1.0, "position": [0.5, 0.0, 1.0], "radius": 0.2}}
    [(name, track)] = read_moving(read_recording(tmp_path / "log.mcap")).items()
    assert (name, track.time.tolist(), track.radius) == ("ball", [1.0], 0.2)


def test_a_tick_holds_every_value(tmp_path):
    setpoint = WANTED._replace(position=(9.1, 2.1, 3.1))
    tick = one_tick(tmp_path / "log.mcap", setpoint=setpoint)

    estimate = tick["estimate"]
    assert estimate["present"]
    assert tuple(estimate["position"]) == ESTIMATE.position
    assert tuple(estimate["velocity"]) == ESTIMATE.velocity
    assert tuple(estimate["attitude"]) == ESTIMATE.attitude
    assert tuple(estimate["angular_velocity"]) == ESTIMATE.angular_velocity
    assert (estimate["age"], estimate["spread"]) == (0.01, 0.002)
    wanted = one_setpoint(tmp_path / "log.mcap", "/mk/wanted")
    for recorded, meant in ((wanted, WANTED), (tick["setpoint"], setpoint)):
        assert (recorded["kind"], recorded["present"]) == (2, 31)
        assert tuple(recorded["position"]) == meant.position
        for name in ("velocity", "acceleration", "jerk"):
            assert tuple(recorded[name]) == float32(getattr(meant, name))
        assert (recorded["heading"], recorded["heading_rate"]) == (0.25, -0.125)
    command = tick["command"]
    assert command["armed"]
    assert command["kind"] == 4
    assert command["heading_present"]
    assert tuple(command["attitude"]) == COMMAND.attitude
    assert tuple(command["rates"]) == COMMAND.rates
    assert (command["thrust"], command["heading"]) == (10.25, 0.75)
    assert tick["truth"]["present"]
    for name in ("position", "velocity", "attitude", "angular_velocity"):
        assert tuple(tick["truth"][name]) == getattr(TRUTH, name)


def test_what_is_not_there_has_a_flag_and_zeros(tmp_path):
    command = Command(LEVEL, 0.0, REST, None, armed=False)
    nothing = dict.fromkeys(("estimate", "wanted", "setpoint", "truth"))
    tick = one_tick(tmp_path / "log.mcap", command=command, **nothing)

    assert not tick["estimate"]["present"]
    assert not tick["truth"]["present"]
    assert tick["setpoint"]["kind"] == 0
    assert messages(tmp_path / "log.mcap", "/mk/wanted") == []
    assert not tick["command"]["armed"]
    assert not tick["command"]["heading_present"]
    assert tuple(tick["estimate"]["position"]) == REST
    assert tick["command"]["heading"] == 0.0


@pytest.mark.parametrize(
    ("setpoint", "kind", "present"),
    [
        (Setpoint(SetpointKind.IDLE), 1, 0),
        (Setpoint(SetpointKind.POSITION, REST, REST, REST, None, 0.0), 2, 1 + 2 + 4 + 16),
        (Setpoint(SetpointKind.POSITION, REST, REST, REST), 2, 1 + 2 + 4),
        (Setpoint(SetpointKind.VELOCITY, None, (1.0, 0.0, 0.0), heading=0.5), 3, 2 + 16),
        (Setpoint(SetpointKind.ACCELERATION, None, None, (1.0, 0.0, 0.0), REST), 4, 4 + 8),
    ],
)
def test_a_setpoint_says_what_it_has(tmp_path, setpoint, kind, present):
    followed = one_tick(tmp_path / "log.mcap", wanted=setpoint, setpoint=None)["setpoint"]
    assert (followed["kind"], followed["present"]) == (0, 0)
    wanted = one_setpoint(tmp_path / "log.mcap", "/mk/wanted")
    assert (wanted["kind"], wanted["present"]) == (kind, present)
    followed = one_tick(tmp_path / "log.mcap", wanted=None, setpoint=setpoint)["setpoint"]
    assert (followed["kind"], followed["present"]) == (kind, present)
    assert one_setpoint(tmp_path / "log.mcap", "/mk/wanted")["kind"] == 0


def test_what_a_part_asks_for_may_be_absurd(tmp_path):
    path = tmp_path / "log.mcap"
    far = WANTED._replace(velocity=(1e300, -1e300, 0.5))
    command = COMMAND._replace(thrust=1e39, setpoint=far)
    tick = one_tick(path, wanted=far, setpoint=WANTED, command=command)
    largest = float(np.finfo(np.float32).max)
    assert tick["command"]["thrust"] == largest
    assert tuple(tick["estimate"]["position"]) == ESTIMATE.position
    for topic in ("/mk/wanted", "/mk/command"):
        assert tuple(one_setpoint(path, topic)["velocity"]) == (largest, -largest, 0.5)


def test_a_command_that_is_a_setpoint_is_recorded_with_it(tmp_path):
    path = tmp_path / "log.mcap"
    sent = WANTED._replace(kind=SetpointKind.VELOCITY, position=None)
    command = COMMAND._replace(kind=CommandKind.VELOCITY, setpoint=sent)
    assert one_tick(path, command=command)["command"]["kind"] == 2
    decoded = one_setpoint(path, "/mk/command")
    assert (decoded["kind"], decoded["present"]) == (3, 2 + 4 + 8 + 16)
    assert tuple(decoded["velocity"]) == float32(WANTED.velocity)
    assert decoded["heading"] == 0.25
    assert one_tick(tmp_path / "plain.mcap")["command"]["kind"] == 4
    assert messages(tmp_path / "plain.mcap", "/mk/command") == []


@pytest.mark.parametrize("measurement", MEASUREMENTS[:4], ids=lambda one: type(one).__name__)
def test_a_measurement_is_recorded_as_it_arrives(tmp_path, measurement):
    found = one_measurement(tmp_path / "log.mcap", measurement)
    assert numbers(found) == numbers([value for value in measurement if value is not None])


@pytest.mark.parametrize("switches", [(), (1.0, -1.0, 0.5), tuple(i / 64 for i in range(40))])
def test_what_a_pilot_holds_is_recorded(tmp_path, switches):
    decoder = pytest.importorskip("mcap_ros1.decoder")
    path = tmp_path / "log.mcap"
    recorder = Recorder(path, make_plan("mk"))
    recorder.vehicle("mk").measurement(30, Sticks(25, 0.1, -0.2, 0.3, 0.4, switches))
    recorder.close()
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[decoder.DecoderFactory()])
        ((_, _, message, said),) = reader.iter_decoded_messages(topics=["/mk/sticks"])
    assert (message.log_time, said.time) == (30, 25)
    assert (said.roll, said.pitch, said.yaw, said.throttle) == (0.1, -0.2, 0.3, 0.4)
    assert said.count == min(len(switches), 32)
    assert tuple(said.switches) == (*switches[:32], *([0.0] * (32 - said.count)))


def test_an_event_is_recorded_as_it_arrives(tmp_path):
    path = tmp_path / "log.mcap"
    recorder = Recorder(path, make_plan("mk", "nano"))
    recorder.event(Event(NS, "option_changed", "mk", {"option": "speed", "value": 0.5}, "m.yaml:3"))
    recorder.close()
    (event,) = messages(path, "/events")
    assert event.log_time == NS
    assert json.loads(event.data) == {
        "t_s": 1.0,
        "event": "option_changed",
        "vehicle": "mk",
        "at": "m.yaml:3",
        "fields": {"option": "speed", "value": 0.5},
    }


@pytest.mark.parametrize(
    ("aboard", "known", "there"), [(True, True, True), (False, True, False), (None, False, False)]
)
def test_what_a_vehicle_says_of_its_payload_is_recorded(tmp_path, aboard, known, there):
    found = one_measurement(tmp_path / "log.mcap", Payload(25, True, aboard))
    assert found.tolist() == (25, True, known, there)


def test_each_estimator_is_recorded_fifty_times_a_second(tmp_path):
    flown = SimpleNamespace(name="mocap", estimate=ESTIMATE, is_usable=True)
    blind = SimpleNamespace(name="inertial", estimate=None, is_usable=False)
    estimation = SimpleNamespace(candidates=[flown, blind], source="mocap")
    recorder = Recorder(tmp_path / "log.mcap", make_plan("mk", rate=250))
    for tick in range(11):
        recorder.vehicle("mk").tick(
            tick * 4_000_000, ESTIMATE, WANTED, WANTED, COMMAND, TRUTH, estimation
        )
    recorder.close()

    first, *others = messages(tmp_path / "log.mcap", "/mk/estimator/mocap")
    assert [m.log_time for m in others] == [20_000_000, 40_000_000]
    said = decoded(first, "Candidate")
    assert (said["present"], said["usable"], said["used"]) == (True, True, True)
    assert tuple(said["position"]) == ESTIMATE.position
    assert tuple(said["attitude"]) == ESTIMATE.attitude
    assert (said["age"], said["spread"]) == (0.01, 0.002)
    none = messages(tmp_path / "log.mcap", "/mk/estimator/inertial")[0]
    said = decoded(none, "Candidate")
    assert (said["present"], said["usable"], said["used"]) == (False, False, False)


def test_the_definition_in_the_file_is_the_layout():
    text = definition(Battery).decode()
    assert [line.split("  #")[0] for line in text.splitlines()] == [
        "int64 time",
        "float64 remaining",
        "float64 voltage",
    ]
    assert definition("Tick").count(b"MSG: kybflow/") == 8
    assert struct_format(Battery) == "<qdd"


def numbers(value: Any) -> list[float]:
    """The numbers of a decoded message in their order, whichever tool decoded it."""
    if isinstance(value, np.ndarray | list | tuple):
        return [number for part in value for number in numbers(part)]
    if isinstance(value, np.void):
        return [number for part in value.item() for number in numbers(part)]
    if hasattr(value, "__slots__"):
        return [number for name in value.__slots__ for number in numbers(getattr(value, name))]
    return [float(value)]


@pytest.mark.thorough
def test_a_ros_1_reader_decodes_every_message_by_the_schema_in_the_file(tmp_path):
    decoder = pytest.importorskip("mcap_ros1.decoder")
    path = tmp_path / "log.mcap"
    recorder = Recorder(path, make_plan("mk"))
    channel = recorder.vehicle("mk")
    known = SimpleNamespace(name="mocap", estimate=ESTIMATE, is_usable=True)
    estimation = SimpleNamespace(candidates=[known], source="mocap")
    for now in range(0, 2 * NS, 4_000_000):
        for measurement in MEASUREMENTS:
            channel.measurement(now, measurement)
        command = COMMAND._replace(thrust=10.25 + now / NS, setpoint=WANTED)
        channel.tick(now, ESTIMATE, WANTED, None, command, TRUTH, estimation)
    recorder.close()
    kinds = {type(one).__name__: type(one) for one in MEASUREMENTS}
    expected = {
        **dict.fromkeys(("/mk/tick", "/mk/wanted", "/mk/command"), 500),
        **{f"/mk/{name.lower()}": 500 for name in kinds},
        "/mk/estimator/mocap": 100,
    }
    seen: dict[str, int] = {}
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[decoder.DecoderFactory()])
        for schema, found, message, said in reader.iter_decoded_messages(topics=[*expected]):
            name = schema.name.removeprefix("kybflow/")
            assert numbers(said) == numbers(decoded(message, kinds.get(name, name)))
            seen[found.topic] = seen.get(found.topic, 0) + 1
    assert seen == expected


@pytest.mark.parametrize("simulated", [True, False])
def test_the_date_is_in_the_recording_of_hardware_only(tmp_path, simulated):
    plan = replace(make_plan("mk"), simulated=simulated)
    Recorder(tmp_path / "log.mcap", plan, STARTED).close()
    mission = read_mission(tmp_path / "log.mcap")
    assert mission["simulated"] == simulated
    assert mission.get("started") == (None if simulated else "2026-01-02T03:04:05+00:00")


def test_what_viewers_draw_is_not_read_back(tmp_path):
    recorder = Recorder(tmp_path / "log.mcap", make_plan("mk"))
    fly(recorder.vehicle("mk"), 0)
    recorder.event(Event(0, "landed", "mk", {}))
    recorder.close()
    assert {*read_recording(tmp_path / "log.mcap").topics} == {"/mk/tick", "/events"}


def test_the_same_run_gives_the_same_bytes(tmp_path):
    first = write_run(tmp_path / "first", 6.0, seed=3) / "log.mcap"
    again = write_run(tmp_path / "again", 6.0, seed=3) / "log.mcap"
    other = write_run(tmp_path / "other", 6.0, seed=4) / "log.mcap"
    assert first.read_bytes() == again.read_bytes()
    assert first.read_bytes() != other.read_bytes()


def test_closing_twice_is_harmless(tmp_path):
    recorder = Recorder(tmp_path / "log.mcap", make_plan("mk"))
    recorder.close()
    recorder.close()
    assert recorder.failed is None


FULL = Path("/dev/full")


@pytest.mark.skipif(not FULL.exists(), reason="needs a device that is always full")
def test_a_full_disk_stops_the_recording_and_nothing_else(capfd):
    recorder = Recorder(FULL, make_plan("mk"))
    channel = recorder.vehicle("mk")
    for tick in range(1000):
        fly(channel, tick * 4_000_000)
    recorder.event(Event(0, "landed", "mk", {}))
    recorder.close()
    assert recorder.failed == "the recording stopped: No space left on device"
    assert capfd.readouterr().err == ""


def test_a_file_that_cannot_be_opened_is_an_error_before_the_flight(tmp_path):
    with pytest.raises(RunUnwritten, match="No such file"):
        Recorder(tmp_path / "missing" / "log.mcap", make_plan("mk"))


CHILD = """
import sys
from pathlib import Path
sys.path.insert(0, str(Path.cwd().parent / "support"))
from recorded_run import make_plan
from test_recorder import fly
from kybflow.recording.recorder import Recorder

plan = make_plan(*sys.argv[2:])
recorder = Recorder(Path(sys.argv[1]), plan)
now = 0
while True:
    for name in sys.argv[2:]:
        fly(recorder.vehicle(name), now)
    if now % 100_000_000 == 0:
        print(now, flush=True)
    now += 4_000_000
"""


def last_tick(path: Path) -> Time:
    """The log time of the last message that can be read of a file without an end."""
    newest = -1
    with path.open("rb") as file:
        try:
            for record in StreamReader(file, validate_crcs=True).records:
                if isinstance(record, Message):
                    newest = record.log_time
        except EndOfFile:
            return newest
    raise AssertionError("the file has an end")


def test_chunks_are_compressed_and_no_longer_than_half_a_second(tmp_path):
    """Compressed they are of any size, so that it can't be their size that limits their time."""
    folder, chunks = write_run(tmp_path / "run", 6.0), []
    with (folder / "log.mcap").open("rb") as file:
        for record in StreamReader(file, emit_chunks=True).records:
            if isinstance(record, Chunk):
                chunks.append(record)
    assert {chunk.compression for chunk in chunks} == {"lz4"}
    assert all(c.message_end_time - c.message_start_time <= NS // 2 for c in chunks)
    assert sum(len(c.data) for c in chunks) < 0.8 * sum(c.uncompressed_size for c in chunks)


@pytest.mark.parametrize(
    ("told", "vehicles"),
    [
        (13, ["mk"]),
        pytest.param(41, ["a", "b", "c", "d"], marks=pytest.mark.thorough),
        pytest.param(57, ["mk"], marks=pytest.mark.thorough),
    ],
)
def test_a_killed_run_is_readable_but_for_its_last_second(tmp_path, told, vehicles):
    path = tmp_path / "log.mcap"
    arguments = [sys.executable, "-c", CHILD, str(path), *vehicles]
    here = Path(__file__).parent
    with subprocess.Popen(arguments, stdout=subprocess.PIPE, cwd=here) as child:
        assert child.stdout is not None
        flown = [int(child.stdout.readline()) for _ in range(told)][-1]
        child.kill()
    assert flown == (told - 1) * 100_000_000
    assert last_tick(path) >= flown - NS


def resident() -> int:
    pages = Path("/proc/self/statm").read_text(encoding="ascii").split()[1]
    return int(pages) * 4096


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="needs /proc")
def test_memory_is_flat_over_ten_minutes_of_four_vehicles(tmp_path):
    names = ["a", "b", "c", "d"]
    recorder = Recorder(tmp_path / "log.mcap", make_plan(*names))
    channels = [recorder.vehicle(name) for name in names]
    early = 0
    for tick in range(600 * 250):
        for channel in channels:
            fly(channel, tick * 4_000_000)
        if tick == 30 * 250:
            early = resident()
    grown = resident() - early
    recorder.close()
    assert grown < 4_000_000


def test_an_event_names_the_file_of_an_installed_library_by_its_package():
    def recorded(at: str) -> str:
        return event_record(Event(0, "landed", "a", {}, at))["at"]

    assert recorded(f"{installed('kybflow')}/defaults.yaml:7") == (
        "kybflow/missions/library/defaults.yaml:7"
    )
    assert recorded("mission.yaml:7") == "mission.yaml:7"
