"""`kybflow mavlink`: autopilots that are met outside a mission, and what they need indoors."""

from __future__ import annotations

import struct
from collections.abc import Iterator

import pytest
from typer import BadParameter
from typer.testing import CliRunner

pytest.importorskip("pymavlink")

from pymavlink.dialects.v20 import all as mavlink
from toolchain import invoke

from kybflow.cli.app import app
from kybflow.cli.commands.mavlink.listen import listen_to
from kybflow.cli.commands.mavlink.setup import set_up
from kybflow.core.errors import DriverError
from kybflow.core.signals import NS, Time
from kybflow.drivers.mavlink.discovery import Discovery, ParameterSetup
from kybflow.drivers.mavlink.firmware import profile_of
from kybflow.drivers.mavlink.protocol.framing import Packer, Parser
from kybflow.drivers.mavlink.transport.wire import Wire, memory_wires

PX4, ARDUPILOT = 12, 3
HOLD = 4 << 16 | 3 << 24
STEP = NS // 50
OURS = 245


class Peer:
    """An autopilot with parameters, whole ones where they are ints. `frozen`: those that it keeps
    whatever is written. `ends`: when it falls silent."""

    def __init__(self, system: int = 1, autopilot: int = PX4, **parameters: float) -> None:
        self.system, self.autopilot, self.parameters = system, autopilot, parameters
        self.armed, self.frozen, self.ends = False, set[str](), 1 << 62
        self.writes: list[str] = []
        self.hears_ground = False
        self._packer = Packer(system)

    def step(self, now: Time, heard: list) -> list[bytes]:
        if now >= self.ends:
            return []
        said = [answer for message in heard for answer in self._answer(message)]
        if now % NS == 0:
            mode = HOLD if self.autopilot == PX4 else 4
            base = 128 if self.armed else 0
            said.append(mavlink.MAVLink_heartbeat_message(2, self.autopilot, base, mode, 3, 3))
        return [self._packer.pack(message, 1) for message in said]

    def _answer(self, message) -> Iterator:
        sort = message.get_type()
        self.hears_ground |= sort == "HEARTBEAT" and message.type == 6
        if getattr(message, "target_system", 0) != self.system:
            return
        name = message.param_id
        if name not in self.parameters:
            return
        is_whole = isinstance(self.parameters[name], int)
        if sort == "PARAM_SET" and name not in self.frozen:
            self.writes.append(name)
            value = message.param_value
            if is_whole and self.autopilot == PX4:
                value = struct.unpack("<i", struct.pack("<f", value))[0]
            self.parameters[name] = int(value) if is_whole else value
        value = self.parameters[name]
        if is_whole and self.autopilot == PX4:
            value = struct.unpack("<f", struct.pack("<i", value))[0]
        sort = 6 if is_whole else 9
        yield mavlink.MAVLink_param_value_message(name.encode(), value, sort, 900, 0)


class Table:
    """A discovery and those whom it hears, on one wire."""

    def __init__(self, *peers: Peer, system: int | None = None) -> None:
        self.wire, self._theirs = memory_wires("udpin:127.0.0.1:14540")
        self.discovery = Discovery(self.wire, system, OURS)
        self._peers, self._parser = peers, Parser()

    def ticks(self) -> Iterator[Time]:
        now = 0
        while now < 300 * NS:
            came = self._theirs.receive(now)
            heard = [message for data, _ in came for message in self._parser.parse(data)]
            for peer in self._peers:
                for frame in peer.step(now, heard):
                    self._theirs.send(frame)
            yield now
            now += STEP
        raise AssertionError("it goes on for ever")

    def set_up(self, name: str = "px4", *, write: bool = False, simulator: bool = False) -> bool:
        outfit = ParameterSetup(profile_of(name), OURS, simulator=simulator)
        return set_up(self.discovery, self.ticks(), outfit, write=write)


def right(name: str, simulator: bool = False) -> dict[str, float]:
    """All parameters as they should be."""
    outfit = ParameterSetup(profile_of(name), OURS, simulator=simulator)
    values = {s.name: s.wanted(OURS) for s in outfit.settings}
    return {name: value if value % 1 else int(value) for name, value in values.items()}


class Listener(Peer):
    """Notes which systems send heartbeats."""

    senders: set[int] = set()  # noqa: RUF012

    def step(self, now: Time, heard: list) -> list[bytes]:
        self.senders |= {m.get_srcSystem() for m in heard if m.get_type() == "HEARTBEAT"}
        return super().step(now, heard)


def test_an_autopilot_does_not_take_the_search_for_the_run_that_it_waits_for() -> None:
    peer = Listener(7, ARDUPILOT, **right("ardupilot"))
    assert Table(peer).set_up("ardupilot")
    assert peer.senders
    assert OURS not in peer.senders


@pytest.mark.parametrize(("name", "autopilot"), [("px4", PX4), ("ardupilot", ARDUPILOT)])
def test_where_all_is_right_nothing_is_written(name: str, autopilot: int, capsys) -> None:
    peer = Peer(7, autopilot, **right(name))
    assert Table(peer).set_up(name, write=True)
    out = capsys.readouterr().out
    assert out.startswith(f"system 7: {name}, ")
    assert out.endswith("\n\nall parameters are right\n")
    assert (peer.writes, peer.hears_ground) == ([], True)


def test_a_parameter_that_newer_versions_renamed_is_found_by_its_new_name(capsys) -> None:
    values = right("ardupilot")
    del values["GPS_TYPE"], values["SYSID_MYGCS"]
    peer = Peer(1, ARDUPILOT, **values, GPS1_TYPE=1, MAV_GCS_SYSID=OURS)
    assert not Table(peer).set_up("ardupilot")
    [row] = [line for line in capsys.readouterr().out.splitlines() if line.startswith("GPS")]
    assert row.split()[:4] == ["GPS1_TYPE", "1", "0", "WRONG"]
    assert Table(peer).set_up("ardupilot", write=True)
    assert (peer.writes, peer.parameters["GPS1_TYPE"]) == (["GPS1_TYPE"], 0)
    assert Table(peer).set_up("ardupilot")


def test_what_is_wrong_is_shown_and_left_alone(capsys) -> None:
    peer = Peer(**right("px4") | {"COM_OBL_RC_ACT": 0, "COM_RCL_EXCEPT": 1})
    assert not Table(peer).set_up()
    out = capsys.readouterr().out
    lines = [line.split() for line in out.splitlines()]
    assert ["COM_OBL_RC_ACT", "0", "4", "or", "5", "WRONG", "it"] in [w[:7] for w in lines]
    assert ["COM_RCL_EXCEPT", "1", "with", "bits", "4", "WRONG"] in [w[:6] for w in lines]
    assert out.endswith("\n2 to write: repeat the command with --write\n")
    assert peer.writes == []


def test_what_is_wrong_is_written_and_read_back(capsys) -> None:
    wrong = {"EKF2_EV_CTRL": 0, "EKF2_HGT_REF": 1, "COM_RCL_EXCEPT": 1, "COM_OF_LOSS_T": 9.5}
    peer = Peer(**right("px4") | wrong)
    assert Table(peer).set_up(write=True)
    assert set(peer.writes) == set(wrong)
    assert peer.parameters["EKF2_EV_CTRL"] == 15
    assert peer.parameters["COM_RCL_EXCEPT"] == 5
    out = capsys.readouterr().out
    assert "restart the autopilot before it flies, for EKF2_HGT_REF\n" in out
    assert out.endswith("all parameters are right\n")


def test_ardupilot_gets_plain_numbers_and_our_system_id() -> None:
    wrong = {"VISO_TYPE": 0, "SYSID_MYGCS": 255}
    peer = Peer(1, ARDUPILOT, **right("ardupilot") | wrong)
    assert Table(peer).set_up("ardupilot", write=True)
    assert (peer.parameters["VISO_TYPE"], peer.parameters["SYSID_MYGCS"]) == (1, OURS)


def test_what_is_missing_is_said_and_the_rest_is_written(capsys) -> None:
    parameters = right("ardupilot") | {"VISO_TYPE": 0}
    del parameters["COMPASS_ENABLE"]
    peer = Peer(1, ARDUPILOT, **parameters)
    assert not Table(peer).set_up("ardupilot", write=True)
    assert peer.writes == ["VISO_TYPE"]
    out = capsys.readouterr().out
    assert "\nmissing: COMPASS_ENABLE. Many parameters appear only after" in out
    assert "all parameters are right" not in out


def test_what_it_keeps_is_refused(capsys) -> None:
    peer = Peer(**right("px4") | {"SYS_HAS_GPS": 1})
    peer.frozen.add("SYS_HAS_GPS")
    assert not Table(peer).set_up(write=True)
    out = capsys.readouterr().out
    assert "(it stays at 1)" in out
    assert "\nrefused: SYS_HAS_GPS. " in out


def test_what_is_dangerous_and_not_ours_to_choose_is_told(capsys) -> None:
    peer = Peer(**right("px4") | {"NAV_DLL_ACT": 2})
    assert not Table(peer).set_up(write=True)
    assert "\nDANGER: NAV_DLL_ACT is 2: " in capsys.readouterr().out
    assert peer.parameters["NAV_DLL_ACT"] == 2


def test_only_a_simulator_is_asked_for_what_only_it_has() -> None:
    assert Table(Peer(**right("px4", simulator=True))).set_up(simulator=True)
    assert not Table(Peer(**right("px4"))).set_up(simulator=True)


def test_nothing_is_written_to_an_armed_vehicle(capsys) -> None:
    peer = Peer(**right("px4") | {"EKF2_EV_CTRL": 0})
    peer.armed = True
    assert not Table(peer).set_up(write=True)
    assert peer.writes == []
    assert "nothing is written to an armed autopilot" in capsys.readouterr().err


def test_one_of_several_is_chosen_by_its_system() -> None:
    one, two = Peer(1, **right("px4")), Peer(2, **right("px4") | {"EKF2_EV_CTRL": 0})
    assert Table(one, two, system=2).set_up(write=True)
    assert (one.writes, two.writes) == ([], ["EKF2_EV_CTRL"])


@pytest.mark.parametrize(
    ("peers", "system", "error", "said"),
    [
        ([(1, PX4), (2, PX4)], None, BadParameter, "there are systems 1, 2"),
        ([(1, ARDUPILOT)], None, BadParameter, "system 1 is no px4: ardupilot, GUIDED, disarmed"),
        ([], None, DriverError, "nothing is heard at udpin:127.0.0.1:14540; does the"),
        ([(1, PX4)], 3, DriverError, "system 3 is not heard at .*, but 1"),
    ],
)
def test_whoever_else_is_there_is_named_and_not_touched(
    peers: list[tuple[int, int]], system: int | None, error: type[Exception], said: str
) -> None:
    there = [Peer(number, autopilot, VISO_TYPE=0) for number, autopilot in peers]
    with pytest.raises(error, match=said):
        Table(*there, system=system).set_up(write=True)
    assert all(peer.writes == [] for peer in there)


def test_one_that_falls_silent_is_told() -> None:
    peer = Peer(**right("px4"))
    peer.ends = 2 * NS
    with pytest.raises(DriverError, match=r"system 1 at .* fell silent"):
        Table(peer, system=1).set_up("px4", write=True)


def test_listening_names_all_and_what_they_say(capsys) -> None:
    one, two, other = Peer(1), Peer(2, ARDUPILOT), Peer(3, 5)
    two.armed = True
    table = Table(one, two, other)
    listen_to(table.discovery, table.ticks(), 3 * NS)
    assert capsys.readouterr().out.splitlines() == [
        "system 1: px4, HOLD, disarmed",
        "system 2: ardupilot, GUIDED, armed",
        "system 3: an unsupported autopilot (MAV_AUTOPILOT 5), disarmed",
    ]


def test_listening_to_nobody_fails() -> None:
    table = Table()
    with pytest.raises(DriverError, match="nothing is heard"):
        listen_to(table.discovery, table.ticks(), NS)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["setup"], "--vehicle"),
        (["setup", "--vehicle", "px4", "--address", "udp:14540"], "could mean two things"),
        (["setup", "--vehicle", "px4", "--key", "/nonexistent"], "no key can be read"),
        (["setup", "--vehicle", "px4", "--system", "0"], "--system"),
        (["listen", "--address", "nowhere"], "is not a MAVLink address"),
        (["listen", "--address", "udpin:14540", "--for", "5 m"], "is a length"),
        (["listen", "--address", "udpin:14540", "--for", "0 s"], "--for"),
    ],
)
def test_a_wrong_command_line_ends_with_2(words: list[str], said: str) -> None:
    result = CliRunner().invoke(app, ["mavlink", *words], terminal_width=200)
    assert result.exit_code == 2
    assert said in result.output


def test_where_a_system_was_looked_for_without_an_address_is_told(monkeypatch) -> None:
    def refused(address: object) -> None:
        raise DriverError(f"{address} refuses")

    monkeypatch.setattr("kybflow.drivers.mavlink.transport.sockets.open_wire", refused)
    words = ["mavlink", "setup", "--vehicle", "ardupilot", "--system", "7"]
    assert invoke(*words).output == (
        "error: tcp:127.0.0.1:5820 refuses; that is the default address of system 7, "
        "see --address\n"
    )
    words += ["--address", "tcp:127.0.0.1:5760"]
    assert invoke(*words).output == "error: tcp:127.0.0.1:5760 refuses\n"


def test_who_is_where_the_first_one_is_looked_for_is_told_to_who_looked_elsewhere(
    monkeypatch,
) -> None:
    table = Table(Peer(1))

    def opened(address: str) -> Wire:
        if address == "udpin:127.0.0.1:14540":
            return table.wire
        raise DriverError(f"nothing is heard at {address}")

    monkeypatch.setattr("kybflow.drivers.mavlink.transport.sockets.open_wire", opened)
    monkeypatch.setattr("kybflow.cli.commands.mavlink.meeting.ticks", table.ticks)
    words = ["mavlink", "setup", "--vehicle", "px4", "--system", "7"]
    assert invoke(*words).output == (
        "error: nothing is heard at udpin:127.0.0.1:14546; that is the default address of"
        " system 7, see --address; at udpin:127.0.0.1:14540 is system 1\n"
    )


def test_a_port_that_cannot_be_had_ends_with_3() -> None:
    words = ["listen", "--address", "udpin:192.0.2.1:14540"]
    result = invoke("mavlink", *words)
    assert result.exit_code == 3
    assert result.output.startswith("error: ")
