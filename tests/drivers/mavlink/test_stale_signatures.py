"""An autopilot that starts anew may sign with a time that is long past: it is told ours, and
nothing that it says counts until it goes by that. Without a key, what is signed is told as such."""

from __future__ import annotations

import pytest
from framing import SET_MODE
from pymavlink.dialects.v20 import all as mavlink
from scripted_autopilot import Bench
from test_preflight_checks import looked
from test_router import Datagrams
from test_signing import KEY, OTHER, Wall, signing

from kybflow.core.signals import NS, Time
from kybflow.drivers.mavlink.discovery import Discovery
from kybflow.drivers.mavlink.protocol.framing import Packer, Parser
from kybflow.drivers.mavlink.protocol.signing import Signing
from kybflow.drivers.mavlink.transport.router import ADDRESS_TIMEOUT_NS, Router, heartbeat

HOUR = 3600.0
TODAY = 360_000_000.0
HERE, ELSEWHERE = ("10.0.0.2", 14550), ("10.0.0.9", 14550)
BEAT = heartbeat(mavlink.MAV_TYPE_GCS)


class Restarted:
    """An autopilot whose clock stands, an hour behind, until it hears a later time."""

    def __init__(self, key: bytes = KEY, system: int = 1, at: float = TODAY - HOUR) -> None:
        self.signing: Signing = signing(key, Wall(at))
        self.packer, self.parser = Packer(system, self.signing), Parser(self.signing)

    def says(self) -> bytes:
        return self.packer.pack(BEAT, 1)


@pytest.fixture
def wire() -> Datagrams:
    return Datagrams()


def hub(wire: Datagrams) -> Router:
    return Router({wire.address: wire}, 245, signing=signing(wall=Wall(TODAY)))


def test_one_whose_time_is_behind_is_told_ours_and_then_heard(wire: Datagrams):
    ours, theirs = hub(wire), Restarted()
    port = ours.port(wire.address, 1)
    wire.coming.append((theirs.says(), HERE))
    ours.poll(NS)
    assert (port.take(), port.last_heard) == ([], None)
    assert "is signed with an old time" in (port.trouble() or "")
    [(to, data)] = wire.sent
    assert to == HERE
    assert len(theirs.parser.parse(data)) == 1
    wire.coming.append((theirs.says(), HERE))
    ours.poll(2 * NS)
    assert len(port.take()) == 1
    port.send(BEAT)
    assert len(theirs.parser.parse(wire.sent[-1][1])) == 1


@pytest.mark.parametrize("key", [OTHER, None], ids=["another key", "unsigned"])
def test_who_has_not_the_secret_is_answered_nothing(wire: Datagrams, key: bytes | None):
    ours = hub(wire)
    port = ours.port(wire.address, 1)
    said = Packer(1).pack(BEAT, 1) if key is None else Restarted(key).says()
    wire.coming.append((said, HERE))
    ours.poll(NS)
    port.send(BEAT)
    assert wire.sent == []


@pytest.mark.parametrize(
    "silent", [NS, 2 * ADDRESS_TIMEOUT_NS], ids=["while it is heard", "after it fell silent"]
)
def test_an_old_frame_played_again_elsewhere_draws_nothing_away(wire: Datagrams, silent: Time):
    """Whoever plays it again is told the time, no more than once a second, and nothing else."""
    ours, theirs = hub(wire), Packer(1, signing(wall=Wall(TODAY)))
    port = ours.port(wire.address, 1)
    wire.coming.append((theirs.pack(BEAT, 1), HERE))
    ours.poll(0)
    for _ in range(3):
        wire.coming.append((Restarted().says(), ELSEWHERE))
        ours.poll(silent)
    port.send(BEAT)
    assert [to for to, _ in wire.sent] == [ELSEWHERE, HERE]
    wire.coming.append((Restarted().says(), ELSEWHERE))
    ours.poll(silent + NS)
    assert [to for to, _ in wire.sent] == [ELSEWHERE, HERE, ELSEWHERE]


def test_an_old_frame_played_again_before_it_is_heard_draws_nothing_away(wire: Datagrams):
    ours = hub(wire)
    port = ours.port(wire.address, 1)
    wire.coming.append((Restarted().says(), ELSEWHERE))
    ours.poll(0)
    for _ in range(3):
        port.send(BEAT)
    assert [to for to, _ in wire.sent] == [ELSEWHERE]


def test_where_it_is_heard_it_is_told_our_time_by_what_it_is_sent_anyway(wire: Datagrams):
    ours, theirs = hub(wire), Packer(1, signing(wall=Wall(TODAY)))
    ours.port(wire.address, 1)
    wire.coming.append((theirs.pack(BEAT, 1), HERE))
    ours.poll(0)
    wire.coming.append((Restarted().says(), HERE))
    ours.poll(2 * ADDRESS_TIMEOUT_NS)
    assert wire.sent == []


def test_who_signs_with_an_old_time_is_not_heard(wire: Datagrams):
    """Not as another system either, whose id a mission may have meant."""
    ours = hub(wire)
    port = ours.port(wire.address, 2)
    wire.coming.append((Restarted().says(), HERE))
    ours.poll(0)
    assert port.heard_from == frozenset()


def test_a_scout_hears_one_whose_time_is_behind_though_it_knows_no_id(wire: Datagrams):
    theirs, discovery = Restarted(system=2, at=0.0), Discovery(wire, None, 245, KEY)
    for now in range(3):
        wire.coming.append((theirs.says(), HERE))
        discovery.step(now)
        for _, data in wire.sent:
            theirs.parser.parse(data)
    assert set(discovery.statuses) == {2}


def test_without_a_key_one_that_signs_and_heeds_nothing_is_told_as_such():
    bench = Bench()
    bench.fake.framing._packer = Packer(1, signing())
    bench.fake.deaf_to, bench.fake.params = {SET_MODE}, {}
    checks = looked(bench, 30.0)
    for name in ("command mode", "watchdog"):
        assert not checks[name].green
        assert "what it sends is signed: give the driver its `key`" in checks[name].reason
