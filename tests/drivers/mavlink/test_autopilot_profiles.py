"""What differs between autopilots."""

from __future__ import annotations

from math import isnan
from types import SimpleNamespace

import pytest

from kybflow.core.errors import DriverError
from kybflow.drivers.mavlink.firmware import Danger, Needed, PayloadCommand, profile_of

PX4, ARDUPILOT = profile_of("px4"), profile_of("ardupilot")
BOTH = pytest.mark.parametrize("profile", [PX4, ARDUPILOT], ids=lambda profile: profile.name)
OWN = 245


def heard(profile, mode="offboard", ready=True, ekf=831):
    return SimpleNamespace(mode=profile.modes.get(mode), ready=ready, ekf=ekf)


def test_an_unknown_autopilot_is_refused():
    with pytest.raises(DriverError, match="px4 and ardupilot"):
        profile_of("betaflight")


@BOTH
def test_every_mode_has_its_own_name_and_three_have_ours(profile):
    for number, name in profile.names.items():
        assert (number, name) == (profile.modes[name], profile.mode_name(number))
    assert {"offboard", "land", "hold"} <= set(profile.modes)
    assert profile.mode_name(999) == "mode 999"


def test_modes_are_set_by_the_numbers_that_were_seen():
    assert [PX4.mode_params(PX4.modes[name]) for name in ("offboard", "land", "hold")] == [
        (1.0, 6.0, 0.0),
        (1.0, 4.0, 6.0),
        (1.0, 4.0, 3.0),
    ]
    assert [
        ARDUPILOT.mode_params(ARDUPILOT.modes[name]) for name in ("offboard", "land", "hold")
    ] == [(1.0, 4.0, 0.0), (1.0, 9.0, 0.0), (1.0, 17.0, 0.0)]
    assert PX4.modes["land"] == (4 << 16 | 6 << 24)


def test_each_simulator_has_its_address():
    assert PX4.default_address(2) == "udpin:127.0.0.1:14541"
    assert ARDUPILOT.default_address(2) == "tcp:127.0.0.1:5770"


@BOTH
def test_streams_are_messages_of_the_dialect(profile):
    mavlink = pytest.importorskip("pymavlink.dialects.v20.all")
    known = {message.msgname for message in mavlink.mavlink_map.values()}
    assert profile.streams <= known


@BOTH
def test_what_setup_writes_is_accepted_and_not_dangerous(profile):
    written = {setting.name: setting.wanted(OWN) for setting in profile.indoors}
    assert len(written) == len(profile.indoors)
    for setting in profile.indoors:
        assert setting.accepts(written[setting.name], OWN)
        assert all(setting.accepts(good, OWN) for good in setting.allowed)
        assert setting.why
        assert not setting.why.endswith(".")
    assert profile.dangers_in(written, OWN, indoors=True) == {}


@BOTH
def test_names_of_parameters_are_short_enough_to_travel(profile):
    names = [setting.name for setting in profile.indoors]
    names += [danger.name for danger in profile.dangers]
    outputs = [profile.output(6, simulator) for simulator in (True, False)]
    names += [profile.hover_parameter, *(output.parameter for output in outputs)]
    assert max(len(name) for name in names) <= 16


def test_a_setting_accepts_what_its_rule_says():
    bits = Needed("GUID_OPTIONS", 8, "so", rule="bits")
    assert (bits.accepts(12.0, OWN), bits.accepts(4.0, OWN), bits.wanted(OWN, 4.0)) == (
        True,
        False,
        12.0,
    )
    bound = Needed("COM_OF_LOSS_T", 1.0, "so", rule="at_most")
    assert [bound.accepts(x, OWN) for x in (0.0, 0.5, 1.0, 2.0)] == [False, True, True, False]
    equal = Needed("COM_OBL_RC_ACT", 4, "so", {5: "or so"})
    assert [equal.accepts(x, OWN) for x in (4.0, 5.0, 0.0)] == [True, True, False]
    assert [equal.does(x) for x in (4.0, 5.0, 0.0, float("nan"))] == ["so", "or so", "so", "so"]
    own = Needed("SYSID_MYGCS", "own", "so")
    assert (own.wanted(OWN), own.accepts(245.0, OWN), own.accepts(255.0, OWN)) == (
        245.0,
        True,
        False,
    )


DANGEROUS = [
    (
        PX4, {"COM_OBL_RC_ACT": 0.0}, False,
        "COM_OBL_RC_ACT is 0: without setpoints it would change to POSITION, and without a"
        " transmitter climb and return; set 4 (land)",
    ),
    (
        PX4, {"COM_OBL_RC_ACT": 3.0}, True,
        "COM_OBL_RC_ACT is 3: without setpoints it would climb and return; set 4 (land)",
    ),
    (
        PX4, {"COM_OF_LOSS_T": 2.5}, False,
        "COM_OF_LOSS_T is 2.5: it would fly on this long without setpoints; set 0.5",
    ),
    (
        ARDUPILOT, {"FS_GCS_ENABLE": 0.0}, False,
        "FS_GCS_ENABLE is 0: without our heartbeat it would hold the last position setpoint for"
        " ever; set 5 (land)",
    ),
    *(
        (
            PX4, {"NAV_DLL_ACT": value}, False,
            f"NAV_DLL_ACT is {value:g}: without our heartbeat its rotors would stop in the air;"
            " set 3 (land), or 0 (nothing; the loss of setpoints then acts)",
        )
        for value in (5.0, 6.0)
    ),
    (
        PX4, {"COM_LOW_BAT_ACT": 3.0}, True,
        "COM_LOW_BAT_ACT is 3: on a critical battery it would climb and return; set 2 (land)",
    ),
    (
        ARDUPILOT, {"BATT_FS_CRT_ACT": 5.0}, False,
        "BATT_FS_CRT_ACT is 5: on a low battery its rotors would stop in the air; set 1 (land)",
    ),
    (
        ARDUPILOT, {"BATT_FS_LOW_ACT": 6.0}, True,
        "BATT_FS_LOW_ACT is 6: on a low battery it would climb and return; set 1 (land)",
    ),
    (
        ARDUPILOT, {"FS_GCS_ENABLE": 4.0}, True,
        "FS_GCS_ENABLE is 4: without our heartbeat it would fly back the way it came;"
        " set 5 (land)",
    ),
    (
        ARDUPILOT, {"SYSID_MYGCS": 255.0}, False,
        "SYSID_MYGCS is 255: it waits for another program's heartbeat, not for kybflow's;"
        " set 245 (this program)",
    ),
]  # fmt: skip


@pytest.mark.parametrize(("profile", "values", "indoors", "words"), DANGEROUS)
def test_a_dangerous_watchdog_is_told_with_its_way_out(profile, values, indoors, words):
    assert [words] == list(profile.dangers_in(values, OWN, indoors=indoors).values())


LANDS = {"COM_OBL_RC_ACT": 4, "NAV_RCL_ACT": 3, "COM_LOW_BAT_ACT": 2}
"""The value of each with which PX4 lands, by its own reference."""


@pytest.mark.parametrize("name", LANDS)
def test_what_does_not_land_at_once_does_not_say_so(name):
    [setting] = [s for s in PX4.indoors if s.name == name]
    assert setting.does(LANDS[name]).startswith("it lands")
    assert not any(words.startswith("it lands") for words in setting.allowed.values())
    assert LANDS[name] not in setting.allowed


def test_outdoors_an_autopilot_may_return_by_itself():
    assert PX4.dangers_in({"COM_OBL_RC_ACT": 3.0, "COM_OF_LOSS_T": 1.0}, OWN, indoors=False) == {}
    assert ARDUPILOT.dangers_in({"FS_GCS_ENABLE": 1.0}, OWN, indoors=False) == {}
    assert Danger("X", cure="1", above=1.0).of(1.0, OWN) is None


GRIPS = [
    (ARDUPILOT, 9, 0.0, (183, (9.0, 1100.0)), (183, (9.0, 1900.0))),
    (ARDUPILOT, 9, 28.0, (211, (1.0, 0.0)), (211, (1.0, 1.0))),
    (ARDUPILOT, 10, -1.0, (181, (1.0, 0.0)), (181, (1.0, 1.0))),
    (PX4, 6, 430.0, (211, (1.0, 0.0)), (211, (1.0, 1.0))),
]


@pytest.mark.parametrize(("profile", "channel", "function", "opened", "closed"), GRIPS)
def test_an_output_is_moved_by_what_it_is_for(profile, channel, function, opened, closed):
    (opens,) = profile.grip(channel, True, function)
    (closes,) = profile.grip(channel, False, function)
    assert (opened, closed) == (opens[:2], closes[:2])
    assert opens.seen is (opened[0] != 181)


def test_an_actuator_set_of_px4_moves_alone():
    (ask,) = PX4.grip(5, True, 302.0)
    assert (ask.command, ask.params[1], ask.params[6]) == (187, -1.0, 0.0)
    assert [isnan(value) for value in ask.params] == [True, False, True, True, True, True, False]


def test_an_output_that_a_motor_is_on_is_not_moved_and_an_unknown_one_is_tried():
    assert ARDUPILOT.grip(1, True, 33.0) == ()
    assert PX4.grip(1, True, 101.0) == ()
    assert [ask.command for ask in ARDUPILOT.grip(9, True, None)] == [183, 211]
    assert [ask.command for ask in PX4.grip(9, True, None)] == [211, 187]
    assert PayloadCommand(211, (1.0, 1.0)) in PX4.grip(6, False, None)


@BOTH
def test_an_autopilot_is_ready_only_in_the_mode_in_which_it_follows(profile):
    assert profile.ready(heard(profile)) is None
    assert "not" in profile.ready(heard(profile, mode="land"))
    assert "not" in profile.ready(heard(profile, mode="no such"))
    assert "it has not reported its health" in profile.ready(heard(profile, ready=None))
    assert profile.ready(heard(profile, ready=False)) is not None
    assert "no position yet" in profile.ready(heard(profile, ready=False, ekf=167))


def test_ardupilot_is_not_ready_without_a_position_whatever_it_says():
    assert "flags 167" in ARDUPILOT.ready(heard(ARDUPILOT, ekf=167))
    assert ARDUPILOT.ready(heard(ARDUPILOT, ekf=None)) == "it has not reported its estimator"


def test_the_spread_is_told_only_with_a_position():
    px4 = SimpleNamespace(flags=831, pos_horiz_accuracy=0.07)
    assert PX4.spread(px4) == 0.07
    assert PX4.spread(SimpleNamespace(flags=7, pos_horiz_accuracy=0.07)) is None
    ardupilot = SimpleNamespace(flags=831, pos_horiz_variance=0.5)
    assert pytest.approx(0.3) == ARDUPILOT.spread(ardupilot)
    assert ARDUPILOT.spread(SimpleNamespace(flags=167, pos_horiz_variance=0.1)) is None
    assert ARDUPILOT.spread(SimpleNamespace(flags=831, pos_horiz_variance=0.0)) == 0.02
