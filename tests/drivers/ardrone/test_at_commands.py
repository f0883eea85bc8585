"""AT commands and the configuration: what a drone takes, and what any bytes are read as."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from kybflow.drivers.ardrone import at

KNOWN = [
    (-0.8, -1085485875), (0.1, 1036831949), (-0.1, -1110651699), (0.05, 1028443341),
    (0.5, 1056964608), (1.0, 1065353216), (-1.0, -1082130432), (0.0, 0),
]  # fmt: skip
LINES = [
    (at.ref(True), b"AT*REF=7,290718208\r"),
    (at.ref(False), b"AT*REF=7,290717696\r"),
    (at.ref(False, emergency=True), b"AT*REF=7,290717952\r"),
    (at.pcmd(at.HOVER), b"AT*PCMD=7,0,0,0,0,0\r"),
    (at.pcmd(at.Move(0.5, -0.1, 1.0, -0.8)),
     b"AT*PCMD=7,1,1056964608,-1110651699,1065353216,-1085485875\r"),
    (at.pcmd_mag(at.Move(), 0.5, 0.05), b"AT*PCMD_MAG=7,5,0,0,0,0,1056964608,1028443341\r"),
    (at.ftrim(), b"AT*FTRIM=7\r"),
    (at.calib(), b"AT*CALIB=7,0\r"),
    (at.config("general:navdata_demo", "TRUE"), b'AT*CONFIG=7,"general:navdata_demo","TRUE"\r'),
    (at.config_ids(at.Ids("aaaaaaaa", "bbbbbbbb", "cccccccc")),
     b'AT*CONFIG_IDS=7,"aaaaaaaa","bbbbbbbb","cccccccc"\r'),
    (at.ctrl(at.RESET_ACKNOWLEDGE), b"AT*CTRL=7,5,0\r"),
    (at.comwdg(), b"AT*COMWDG=7\r"),
]  # fmt: skip


@pytest.mark.parametrize(("value", "bits"), KNOWN)
def test_a_float_is_sent_as_the_integer_of_its_bits(value, bits):
    assert at.bits_of(value) == bits
    assert at.float_of(bits) == pytest.approx(value)


@pytest.mark.parametrize(("line", "sent"), LINES, ids=[str(line.name) for line, _ in LINES])
def test_each_command_is_written_and_read(line, sent):
    assert line.numbered(7) == sent
    (read,) = at.read_commands(sent)
    assert (read.name, read.sequence, len(read.arguments)) == (line.name, 7, len(line.arguments))


def test_a_datagram_has_several_commands_and_any_line_end():
    read = at.read_commands(b"AT*REF=0,512\rAT*PCMD=1,0,0,0,0,0\r\nAT*COMWDG=2\r")
    assert [(c.name, c.sequence) for c in read] == [("REF", 0), ("PCMD", 1), ("COMWDG", 2)]


@pytest.mark.parametrize(
    "data",
    [
        b"", b"\r", b"AT*REF=1", b"AT*REF\r", b"AT*REF=x,1\r", b"XX*REF=1,2\r", b"\xff\xfe\r",
        b'AT*CONFIG=1,"open\r', b"AT*REF=1,2," + b"1" * 1100 + b"\r",
    ],
)  # fmt: skip
def test_what_is_no_command_is_left_out(data):
    assert at.read_commands(data) == []


def test_a_command_never_spans_datagrams_and_a_group_stays_together():
    groups = [[at.config_ids(at.Ids(*["00000000"] * 3)), at.config("a:b", "x" * 60)]] * 12
    packed, following = at.datagrams(groups, 1)
    assert following == 25
    assert all(len(data) <= at.MAX_DATAGRAM for data in packed)
    assert len(packed) > 1
    for data in packed:
        names = [command.name for command in at.read_commands(data)]
        assert names == ["CONFIG_IDS", "CONFIG"] * (len(names) // 2)


@given(st.floats(width=32, allow_nan=False))
def test_every_float_comes_back(value):
    assert at.float_of(at.bits_of(value)) == value


@given(st.integers())
def test_bits_of_nothing_are_not_a_number(bits):
    value = at.float_of(bits)
    assert -(1 << 31) <= bits < 1 << 31 or math.isnan(value)


@given(st.binary(max_size=1200))
def test_no_bytes_raise(data):
    at.read_commands(data)


def test_a_configuration_comes_back():
    values = {"general:num_version_soft": "2.4.8", "control:euler_angle_max": "2.0943952e-01"}
    assert at.read_configuration(at.write_configuration(values)) == values


@pytest.mark.parametrize(
    ("asked", "found", "same"),
    [
        ("TRUE", "TRUE", True), ("TRUE", "true", True), ("TRUE", "FALSE", False),
        ("3000", "3000", True), ("0.21", "2.1000001e-01", True), ("0.21", "2.2e-01", False),
        ("x", "3", False),
    ],
)  # fmt: skip
def test_a_value_that_is_read_back(asked, found, same):
    assert at.agrees(asked, found) is same


def test_an_identity_is_eight_digits():
    assert len(at.identity("kybflow")) == 8
