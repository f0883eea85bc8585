"""Parameters: read and written by name, few at a time, each verified."""

from __future__ import annotations

import struct

import pytest

pytest.importorskip("pymavlink")

from pymavlink.dialects.v20 import all as mavlink

from kybflow.core.signals import NS
from kybflow.drivers.mavlink.telemetry.parameters import AT_ONCE, AutopilotParameters, rounded

INT32, REAL32 = 6, 9


def bits(number: int) -> float:
    """The float whose four bytes are those of an int32."""
    return struct.unpack("<f", struct.pack("<i", number))[0]


def told(name: str, value: float, sort: int = REAL32):
    """PARAM_VALUE as it is after a trip over the wire."""
    sender = mavlink.MAVLink(None, 1, 1)
    message = mavlink.MAVLink_param_value_message(name.encode(), value, sort, 900, 3)
    return mavlink.MAVLink(None).parse_buffer(message.pack(sender))[0]


def sent(parameters: AutopilotParameters, now: int) -> list[tuple[str, str]]:
    return [(m.get_type(), m.param_id) for m in parameters.due(now)]


@pytest.fixture
def px4() -> AutopilotParameters:
    return AutopilotParameters(True, target=(1, 1))


@pytest.fixture
def plain() -> AutopilotParameters:
    return AutopilotParameters(False, target=(1, 1))


def test_a_name_is_asked_for_and_told(plain: AutopilotParameters) -> None:
    plain.read(["VISO_TYPE"], 0)
    assert not plain.is_complete(["VISO_TYPE"])
    assert sent(plain, 0) == [("PARAM_REQUEST_READ", "VISO_TYPE")]
    plain.handle(told("VISO_TYPE", 1.0, INT32), 1)
    assert plain.is_complete(["VISO_TYPE"])
    assert plain.values == {"VISO_TYPE": 1.0}
    assert sent(plain, NS) == []


@pytest.mark.parametrize("number", [0, 1, -1, 3, 123_456, -(2**31), 2**31 - 1])
def test_whole_numbers_travel_bytewise_on_px4(px4: AutopilotParameters, number: int) -> None:
    px4.read(["EKF2_EV_CTRL"], 0)
    px4.due(0)
    px4.handle(told("EKF2_EV_CTRL", bits(number), INT32), 1)
    assert px4.values == {"EKF2_EV_CTRL": number}


def test_what_is_known_is_read_again_only_when_that_is_asked(plain: AutopilotParameters) -> None:
    plain.read(["A"], 0)
    plain.due(0)
    plain.handle(told("A", 1.5), 0)
    plain.read(["A"], 1)
    assert plain.is_complete(["A"])
    plain.read(["A"], 1, again=True)
    assert sent(plain, 1) == [("PARAM_REQUEST_READ", "A")]


def test_what_is_never_told_is_missing_after_three_tries(px4: AutopilotParameters) -> None:
    px4.read(["NONE"], 0)
    when = [now for now in range(0, 9 * NS, NS // 10) if px4.due(now)]
    assert when == [0, NS // 2, 3 * NS // 2]
    assert px4.missing == {"NONE"}
    assert px4.is_complete(["NONE"])
    px4.read(["NONE"], 9 * NS)
    assert px4.due(9 * NS) == []


def test_an_autopilot_that_says_what_does_not_exist_is_believed_at_once(
    plain: AutopilotParameters,
) -> None:
    plain.read(["NONE"], 0)
    plain.due(0)
    plain.handle(mavlink.MAVLink_param_error_message(245, 191, b"NONE", -1, 1), 1)
    assert (plain.missing, plain.due(NS)) == ({"NONE"}, [])


def test_few_are_under_way_at_a_time(plain: AutopilotParameters) -> None:
    names = [f"P{i}" for i in range(100)]
    plain.read(names, 0)
    assert len(plain.due(0)) == AT_ONCE
    assert plain.due(1) == []
    plain.handle(told("P3", 0.0), 2)
    assert sent(plain, 2) == [("PARAM_REQUEST_READ", "P5")]


def test_a_parameter_is_written_once_its_type_is_known_and_told_back(
    px4: AutopilotParameters,
) -> None:
    px4.write("COM_OBL_RC_ACT", 4, 0)
    assert sent(px4, 0) == [("PARAM_REQUEST_READ", "COM_OBL_RC_ACT")]
    px4.handle(told("COM_OBL_RC_ACT", bits(0), INT32), 1)
    (message,) = px4.due(2)
    assert (message.get_type(), message.param_type) == ("PARAM_SET", INT32)
    assert message.param_value == bits(4)
    px4.handle(told("COM_OBL_RC_ACT", bits(0), INT32), 3)  # an answer to the first question, late
    assert not px4.is_complete(["COM_OBL_RC_ACT"])
    px4.handle(told("COM_OBL_RC_ACT", bits(4), INT32), 4)
    assert px4.is_complete(["COM_OBL_RC_ACT"])
    assert (px4.values, px4.refused) == ({"COM_OBL_RC_ACT": 4.0}, {})


def test_a_float_is_compared_as_it_is_on_the_wire(plain: AutopilotParameters) -> None:
    plain.write("GUID_TIMEOUT", 0.1, 0)
    plain.due(0)
    plain.handle(told("GUID_TIMEOUT", 3.0), 0)
    (message,) = plain.due(1)
    plain.handle(told("GUID_TIMEOUT", message.param_value), 2)
    assert plain.is_complete(["GUID_TIMEOUT"])
    assert plain.values["GUID_TIMEOUT"] == rounded(0.1) != 0.1


def test_what_it_has_already_is_not_written(plain: AutopilotParameters) -> None:
    plain.write("A", 2.0, 0)
    plain.due(0)
    plain.handle(told("A", 2.0), 1)
    assert (plain.is_complete(["A"]), plain.due(NS)) == (True, [])


def test_an_autopilot_that_keeps_its_value_has_refused(plain: AutopilotParameters) -> None:
    plain.write("A", 2.0, 0)
    plain.due(0)
    for now in range(0, 9 * NS, NS // 10):
        plain.handle(told("A", 1.0), now)
        plain.due(now)
    assert plain.refused == {"A": "it stays at 1"}
    assert plain.values == {"A": 1.0}


def test_an_error_says_why_it_was_not_written(plain: AutopilotParameters) -> None:
    plain.write("A", 2.0, 0)
    plain.due(0)
    plain.handle(told("A", 1.0), 1)
    plain.due(1)
    plain.handle(mavlink.MAVLink_param_error_message(245, 191, b"A", -1, 5), 2)
    assert plain.refused == {"A": "read-only"}


def test_writing_what_does_not_exist_makes_it_missing(plain: AutopilotParameters) -> None:
    plain.write("NONE", 2.0, 0)
    for now in range(0, 9 * NS, NS // 10):
        plain.due(now)
    assert (plain.missing, plain.refused) == ({"NONE"}, {})


def test_what_nobody_asked_for_is_not_kept(plain: AutopilotParameters) -> None:
    plain.handle(told("STAT_RUNTIME", 5.0), 0)
    assert plain.values == {}
