"""The driver's sockets and their thread, against a drone that a test plays on loopback."""

from __future__ import annotations

import random
import socket

import pytest
from served_drones import free_host
from waiting import until

from kybflow.core.errors import DriverError
from kybflow.core.signals import NS
from kybflow.drivers.ardrone.at import HOVER, Move, read_commands
from kybflow.drivers.ardrone.navdata import DroneState, write_packet
from kybflow.drivers.ardrone.udp import MOST_PER_PERIOD, UdpWire, is_address
from kybflow.drivers.ardrone.wire import NAVDATA_REQUEST
from kybflow.drivers.emulated_ardrone.ports import SocketPorts, host_of


@pytest.fixture
def played():
    """A drone's ports, and a wire to them."""
    ports = SocketPorts(free_host())
    wire = UdpWire(ports.host, 200.0)
    yield ports, wire
    wire.close()
    ports.close()


def connect(ports, wire):
    """Let the wire ask for navigation data, and the ports answer it."""
    wire.ask()
    asked = []
    until(lambda: asked.extend(ports.requests()) or asked, "to ask")
    assert asked[0][0] == NAVDATA_REQUEST
    ports.answer(asked[0][1])


def heard(ports):
    return [c for data, _ in ports.commands() for c in read_commands(data)]


def test_the_newest_command_is_sent_until_it_is_too_old(played):
    ports, wire = played
    wire.stream.hold(True, Move(up=0.5))
    found = []
    until(lambda: found.extend(heard(ports)) or wire.stream.ended > 3, "the stream to end")
    found += heard(ports)
    moves = [command.arguments[0] for command in found if command.name == "PCMD"]
    assert moves[0] == 1
    assert moves[-1] == 0  # hovering, before it ended
    assert sorted(moves, reverse=True) == moves
    assert heard(ports) == []
    wire.stream.hold(True, HOVER)
    until(lambda: heard(ports), "the stream to go on")


def test_navigation_data_and_configurations_arrive(played):
    ports, wire = played
    connect(ports, wire)
    ports.send(write_packet(DroneState.DEMO, 1))
    until(lambda: wire.take(0), "a packet")
    wire.listen_for_configuration()
    until(lambda: ports.requests() is not None and ports._clients, "a connection")
    ports.send_configuration(b"a:b = c\n\0a:b = d\n\0a:b")
    found = []
    until(lambda: found.append(wire.configuration()) or found[-1], "the configuration")
    assert found[-1] == b"a:b = d\n"


def test_a_flood_from_elsewhere_is_counted_and_the_drone_is_still_heard(played):
    ports, wire = played
    connect(ports, wire)
    ports.send(write_packet(DroneState.DEMO, 5))
    until(lambda: wire.take(0), "a packet")
    chance, target = random.Random(0), ports._listener
    good = write_packet(DroneState.DEMO | DroneState.EMERGENCY, 99)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        stranger.bind((host_of(1, ports.host), 0))
        for number in range(10_000):
            data = good if number % 3 else chance.randbytes(chance.randrange(200))
            stranger.sendto(data, target)
    ports.send(write_packet(DroneState.DEMO, 4))  # from the drone, and replayed
    sent = 5

    def drone_is_heard():
        nonlocal sent
        sent += 1
        ports.send(write_packet(DroneState.DEMO, sent))
        return wire.take(0)

    arrived = []
    until(lambda: arrived.extend(drone_is_heard()) or arrived, "the drone, after the flood")
    assert all(packet.state == DroneState.DEMO for _, packet in arrived)
    assert wire.gate.refused["from elsewhere"] > 0
    assert wire._thread.is_alive()


def test_deaf_and_mute_it_hears_and_says_nothing(played):
    ports, wire = played
    wire.deaf = wire.mute = True
    wire.stream.hold(False)
    wire.ask()
    ports.answer(wire._data.getsockname())
    ports.send(write_packet(DroneState.DEMO, 1))
    until(lambda: wire.stream.ended, "the stream to end")
    assert (heard(ports), wire.take(0), ports.requests()) == ([], [], [])


def test_a_drone_is_emulated_on_loopback_alone():
    assert host_of(3) == "127.0.0.5"
    for host in ("192.168.1.1", "nowhere"):
        with pytest.raises(DriverError):
            host_of(0, host)
    assert is_address("192.168.1.1")
    assert not is_address("drone.local")


def test_ports_that_are_taken_are_told(played):
    ports, _ = played
    with pytest.raises(DriverError, match="address already in use"):
        SocketPorts(ports.host)


def test_a_closed_wire_has_no_thread_left(played):
    _, wire = played
    wire.close()
    assert not wire._thread.is_alive()


def test_of_a_flood_no_more_than_its_share_is_taken_in_a_period(played):
    _, wire = played
    wire._over = True
    wire._thread.join()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        for _ in range(2 * MOST_PER_PERIOD):
            stranger.sendto(b"noise", wire._data.getsockname())
    wire._receive(wire._clock() + wire._period)
    assert wire.gate.refused == {"from elsewhere": MOST_PER_PERIOD}


def test_stamps_rise_however_late_a_tick_is(played):
    ports, wire = played
    connect(ports, wire)
    stamps, sent = [], 0
    for now in (NS, NS, NS - 8_000_000):  # the last one is late: its time is behind the clock
        ports.send(write_packet(DroneState.DEMO, sent := sent + 1))
        ports.send(write_packet(DroneState.DEMO, sent := sent + 1))
        until(lambda: len(wire._arrived) > 1, "two packets")
        stamps += [at for at, _ in wire.take(now)]
    assert stamps == sorted({*stamps})
