"""Navigation data: packets, options and state, against known bytes and a real recording."""

from __future__ import annotations

from contextlib import suppress

import pytest
from ardrone_recordings import parsed_by_npm, recording
from hypothesis import given
from hypothesis import strategies as st

from kybflow.drivers.ardrone import navdata
from kybflow.drivers.ardrone.navdata import (
    LAYOUTS,
    DroneState,
    Malformed,
    OptionTag,
    Phase,
    decoded,
    in_words,
    phase_of,
    read_packet,
    write_packet,
)

BOOTSTRAP = bytes.fromhex("88776655100c804f0100000000000000ffff0800a6020000")
"""As a real drone's, captured and published."""
SIZES = {
    0: 148, 1: 8, 2: 52, 3: 46, 4: 16, 5: 12, 6: 88, 7: 16, 8: 24, 9: 76, 10: 56, 11: 16, 12: 44,
    13: 92, 14: 108, 15: 364, 16: 328, 17: 8, 18: 40, 19: 65, 20: 12, 21: 18, 22: 75, 23: 56,
    24: 72, 25: 32, 26: 8,
}  # fmt: skip
"""Of each option with its head, by the headers of Parrot's SDK and a C compiler."""
DEMO = navdata.Demo(Phase.FLYING, 87, 1500.0, -2500.0, 90000.0, 950, (120.0, -40.0, 3.0))


def test_the_bootstrap_packet_of_a_real_drone():
    packet = read_packet(BOOTSTRAP)
    assert DroneState.BOOTSTRAP in packet.state
    assert packet.sequence == 1
    assert not packet.options
    assert write_packet(packet.state, 1) == BOOTSTRAP


@pytest.mark.parametrize("tag", sorted(SIZES))
def test_the_fields_of_an_option_fill_it(tag):
    last = LAYOUTS[tag][-1]
    assert last.at + last.layout.size <= SIZES[tag] - 4
    assert last.at + last.layout.size >= (SIZES[tag] - 4) * 0.85


def test_the_demo_option_comes_back():
    assert navdata.demo(dict([navdata.write_demo(DEMO)])) == DEMO
    assert len(navdata.write_demo(DEMO)[1]) + 4 == 148


def test_time_and_sensors_come_back():
    felt = navdata.PhysMeasures((10.0, -20.0, -1000.0), (1.0, 2.0, 3.0))
    options = dict(
        [
            navdata.write_time(3_000_001),
            navdata.write_phys_measures(felt),
            navdata.write_raw_measures(11_686),
        ]
    )
    assert navdata.drone_time(options) == pytest.approx(3.000001)
    assert navdata.phys_measures(options) == felt
    assert (
        decoded(OptionTag.RAW_MEASURES, options[OptionTag.RAW_MEASURES])["battery_millivolts"]
        == 11_686
    )


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (lambda d: d[:20], "short"),
        (lambda d: b"\0" + d[1:], "header"),
        (lambda d: d[:16] + d[24:], "short"),
        (lambda d: d[:-1] + b"\x07", "checksum"),
        (lambda d: d[:18] + b"\xff\x00" + d[20:], "beyond"),
        (lambda d: d[:18] + b"\x00\x00" + d[20:], "beyond"),
    ],
)
def test_what_is_broken_is_refused_with_a_reason(change, why):
    with pytest.raises(Malformed, match=why):
        read_packet(change(BOOTSTRAP))


@given(st.binary(max_size=3000))
def test_no_bytes_raise_anything_else(data):
    with suppress(Malformed):
        read_packet(data)


@given(st.dictionaries(st.integers(0, 40), st.binary(max_size=200), max_size=8), st.data())
def test_options_of_any_size_are_read_as_far_as_they_go(contents, draw):
    state = DroneState(draw.draw(st.integers(0, 2**32 - 1)))
    packet = read_packet(write_packet(state, 9, contents.items()))
    assert packet.options == contents
    assert packet.state == state
    for tag, data in packet.options.items():
        decoded(tag, data)
    navdata.demo(packet.options)
    navdata.phys_measures(packet.options)
    navdata.drone_time(packet.options)


def test_states_in_words():
    assert in_words(DroneState.EMERGENCY | DroneState.CUT_OUT) == [
        "a motor was stopped by force", "it is in emergency, its rotors stopped"
    ]  # fmt: skip
    assert phase_of(6 << 16 | 3) is Phase.TAKING_OFF
    assert phase_of(77 << 16) is Phase.DEFAULT


def test_every_option_of_a_real_recording():
    packet = read_packet(recording("navdata.bin"))
    assert packet.sequence == 300711
    assert int(packet.state) == 0x4F8000D0
    assert sorted(packet.options) == list(range(28))
    for tag, data in packet.options.items():
        assert len(decoded(tag, data)) == len(LAYOUTS[tag]), OptionTag(tag).name
    found = navdata.demo(packet.options)
    assert found is not None
    assert found.phase is Phase.LANDED
    assert decoded(2, packet.options[2])["battery_millivolts"] == 11686


def test_a_real_recording_is_read_as_by_npm(tmp_path):
    data = recording("navdata.bin")
    path = tmp_path / "navdata.bin"
    path.write_bytes(data)
    theirs, options = parsed_by_npm(path), read_packet(data).options
    ours = {tag: decoded(tag, content) for tag, content in options.items()}
    demo = theirs["demo"]
    assert demo["batteryPercentage"] == ours[OptionTag.DEMO]["battery_percent"]
    assert demo["rotation"]["yaw"] == pytest.approx(ours[OptionTag.DEMO]["psi"] / 1000)
    felt = theirs["physMeasures"]["accelerometers"]
    assert list(felt.values()) == pytest.approx(
        list(ours[OptionTag.PHYS_MEASURES]["accelerometers"])
    )
    assert theirs["pressureRaw"]["pressure"] == ours[OptionTag.PRESSURE_RAW]["pressure"]
    assert theirs["magneto"]["radius"] == pytest.approx(ours[OptionTag.MAGNETO]["radius"])
    assert theirs["videoStream"]["fifoQueueLevel"] == ours[OptionTag.VIDEO_STREAM]["fifo_queue"]
    assert theirs["gps"]["latitude"] == pytest.approx(ours[OptionTag.GPS]["latitude"])
    assert theirs["visionDetect"]["nbDetected"] == ours[OptionTag.VISION_DETECT]["detected"]
