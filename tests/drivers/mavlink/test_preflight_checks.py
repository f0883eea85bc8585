"""What the preflight asks of an autopilot that is not ready, and what mends it."""

from __future__ import annotations

import pytest
from framing import ARM
from scripted_autopilot import BOTH, Bench, estimate, mavlink, standing

from kybflow.core.errors import Refused
from kybflow.core.signals import NS
from kybflow.core.text import details, headline

RUN_PREARM_CHECKS = mavlink.MAV_CMD_RUN_PREARM_CHECKS

COMPASS = mavlink.MAV_SYS_STATUS_SENSOR_3D_MAG
ESTIMATE, RECEIVER = mavlink.MAV_SYS_STATUS_AHRS, mavlink.MAV_SYS_STATUS_SENSOR_RC_RECEIVER
NO_POSITION = 37


def looked(bench: Bench, seconds: float = 3.0, tells: bool = True):
    """The last checks, by name. tells: whether it is told where it is meanwhile."""
    for _ in range(round(seconds * 50)):
        bench.tick()
        if tells:
            bench.link.tell_position(estimate(bench.now), bench.now)
        bench.link.prepare_preflight(bench.now)
        checks = bench.link.checks(bench.now)
    return {check.name: check for check in checks}


def test_one_that_stays_unready_is_asked_why_and_its_words_are_shown():
    bench = Bench()
    bench.fake.ready = False
    looked(bench, 3.0)
    assert bench.fake.commands(RUN_PREARM_CHECKS) == []
    looked(bench, 1.0)
    assert len(bench.fake.commands(RUN_PREARM_CHECKS)) == 1
    bench.fake.say("Preflight Fail: no battery")
    assert "Preflight Fail: no battery" in looked(bench, 0.5)["autopilot"].reason
    looked(bench, 20.0)
    assert len(bench.fake.commands(RUN_PREARM_CHECKS)) == 3


@BOTH
def test_poses_that_its_filter_rejects_are_red_on_the_ground_and_told_in_flight(name):
    bench = Bench(name)
    line = looked(bench)["innovations"]
    assert line.green
    assert "position 0.05" in line.reason
    assert bench.link.rejection is None
    bench.fake.innovation = 1.5
    line = looked(bench, 1.0)["innovations"]
    assert not line.green
    assert "position 1.50" in line.reason
    assert "`units`" in line.reason
    assert "its filter rejects the poses: position 1.50" in bench.link.rejection
    looked(bench, 1.0, tells=False)
    assert bench.link.rejection is None, "it was sent none"
    looked(bench, 0.4)
    bench.fake.innovation = 0.4
    looked(bench, 0.4)
    assert bench.link.rejection is None


def test_an_autopilot_with_gps_has_no_line_about_poses():
    assert "innovations" not in looked(Bench(position="own"))


def test_asking_for_the_checks_sends_nothing():
    bench = Bench()
    bench.fake.ready = False
    bench.run(1.0)
    bench.fake.sent.clear()
    for _ in range(500):
        bench.now += NS // 50
        bench.link.checks(bench.now)
    bench.fake.step(bench.now)
    assert bench.fake.sent == []


def test_one_that_is_ready_is_asked_nothing():
    bench = Bench()
    looked(bench, 2.0)
    assert looked(bench, 10.0)["autopilot"].green
    assert bench.fake.commands(RUN_PREARM_CHECKS) == []


def test_what_mends_its_parameters_is_a_command_for_this_very_vehicle():
    plain = looked(Bench(), 5.0)["parameters"].reason
    assert "`kybflow mavlink setup --vehicle px4 --system 1 --write`" in plain
    told = {"address": "udpin:127.0.0.1:14555", "own_system": 250, "simulator": True}
    other = looked(Bench(**told), 5.0)["parameters"].reason
    words = "--system 1 --address udpin:127.0.0.1:14555 --own-system 250 --simulator --write`"
    assert words in other


def set_up(bench: Bench) -> Bench:
    """Its parameters as they should be."""
    for setting in bench.fake.profile.indoors:
        bench.fake.params[setting.name] = setting.wanted(245)
    return bench


def test_one_that_is_unready_without_a_word_is_asked_what_is_not_well():
    bench = set_up(Bench())
    bench.fake.ready, bench.fake.ill = False, COMPASS | RECEIVER
    assert looked(bench, 8.0)["autopilot"].reason == (
        "it reports that it is not ready to arm; it reports as not well: compass,"
        " receiver of the transmitter (is the transmitter on?)"
    )
    bench.fake.say("Preflight Fail: compass 1 missing")
    assert looked(bench, 0.5)["autopilot"].reason == (
        "it reports that it is not ready to arm: Preflight Fail: compass 1 missing; it reports as"
        " not well: compass, receiver of the transmitter (is the transmitter on?)"
    )


def test_what_is_not_well_is_said_of_a_refusal_to_arm_too():
    bench = standing(arming_time=3.0)
    bench.fake.refuses, bench.fake.ill = {ARM: (1, "")}, ESTIMATE
    with pytest.raises(Refused, match="not well: estimate of attitude and position"):
        bench.arm(10.0)


def test_where_it_has_no_position_the_line_says_what_it_is_made_of():
    bench = set_up(Bench())
    bench.fake.flags = NO_POSITION
    assert looked(bench, 8.0)["position"].reason == (
        "it has none (estimator flags 37); kybflow sends it one, and it is set up to use it"
        " (EKF2_EV_CTRL 15, EKF2_HGT_REF 3): new parameters may take effect only after a restart"
    )
    bare = Bench()
    bare.fake.flags = NO_POSITION
    assert looked(bare, 8.0)["position"].reason == (
        "it has none (estimator flags 37); it is not set up to use kybflow's heading: see "
        "`parameters`"
    )


def test_one_that_finds_its_own_position_says_by_which_parameters():
    bench = Bench("ardupilot", position="own")
    bench.fake.params |= {"GPS_TYPE": 1.0, "EK3_SRC1_POSXY": 3.0}
    bench.fake.flags = NO_POSITION
    assert looked(bench, 8.0)["position"].reason == (
        "it has none (estimator flags 37); it finds its own heading by GPS_TYPE 1, "
        "EK3_SRC1_POSXY 3: does"
        " it receive satellites?"
    )


def test_several_dangers_are_a_line_each_and_told_once():
    bench = set_up(Bench("ardupilot"))
    wrong = {"FS_GCS_ENABLE": 0.0, "SYSID_MYGCS": 255.0, "VISO_TYPE": 0.0, "BATT_FS_LOW_ACT": 5.0}
    bench.fake.params |= wrong
    found = looked(bench, 8.0)
    watchdog, parameters = found["watchdog"].reason, found["parameters"].reason
    assert headline(watchdog) == "dangerous: FS_GCS_ENABLE, SYSID_MYGCS, BATT_FS_LOW_ACT"
    assert [row.split()[0] for row in details(watchdog)] == [
        "FS_GCS_ENABLE", "SYSID_MYGCS", "BATT_FS_LOW_ACT",
    ]  # fmt: skip
    assert headline(parameters) == (
        "3 of 15 are wrong for flight without GPS, 2 of these under `watchdog`"
    )
    assert details(parameters) == [
        "VISO_TYPE is 0,  should be 1:  takes poses from kybflow",
        "to set all of them: `kybflow mavlink setup --vehicle ardupilot --system 1 --write`",
    ]


def test_what_newer_versions_renamed_is_looked_at_by_its_new_name():
    bench = set_up(Bench("ardupilot"))
    del bench.fake.params["GPS_TYPE"], bench.fake.params["SYSID_MYGCS"]
    bench.fake.params |= {"GPS1_TYPE": 1.0, "MAV_GCS_SYSID": 255.0}
    found = looked(bench, 20.0)
    assert headline(found["watchdog"].reason) == "dangerous: MAV_GCS_SYSID"
    [danger] = details(found["watchdog"].reason)
    assert danger.startswith("MAV_GCS_SYSID is 255: ")
    [row, _] = details(found["parameters"].reason)
    assert row == "GPS1_TYPE is 1,  should be 0:  no GPS indoors"


def test_a_green_watchdog_says_what_this_one_does():
    bench = set_up(Bench())
    bench.fake.params["NAV_DLL_ACT"] = 0.0
    assert looked(bench, 8.0)["watchdog"].reason == "it lands when setpoints stop"
    bench = set_up(Bench())
    bench.fake.params["COM_OBL_RC_ACT"] = 5.0
    found = looked(bench, 8.0)["watchdog"]
    assert found.green
    assert found.reason.startswith("it holds where it is when setpoints stop")
    bench = Bench(position="own")
    bench.fake.params |= {"COM_OBL_RC_ACT": 3.0, "COM_OF_LOSS_T": 1.0}
    assert "COM_OBL_RC_ACT is 3" in looked(bench, 8.0)["watchdog"].reason


@BOTH
def test_one_that_does_not_tell_what_it_does_without_us_is_not_flown(name):
    """As on a line that is full, or where it hears nothing that is not signed."""
    bench = set_up(Bench(name))
    reaction = bench.fake.profile.reaction
    del bench.fake.params[reaction]
    watchdog = looked(bench, 8.0)["watchdog"]
    assert not watchdog.green
    assert f"it does not report {reaction}" in watchdog.reason


def test_the_preflight_goes_into_the_mode_that_it_asks_about():
    bench = standing("ardupilot", position="own")
    checks = looked(bench)
    assert bench.fake.mode == bench.fake.profile.modes["offboard"]
    assert checks["autopilot"].green
    assert checks["position"].green
    assert "parameters" not in checks


def test_the_preflight_names_every_parameter_that_is_wrong():
    bench = Bench("px4")
    bench.fake.params["COM_OBL_RC_ACT"] = 3.0
    bench.run(3.0)
    checks = looked(bench, 10.0)
    headline, *rows, cure, end = checks["parameters"].reason.split("\n")
    assert headline == ("12 of 17 are wrong for flight without GPS, 1 of these under `watchdog`")
    assert rows[0] == (
        "  EKF2_EV_CTRL is 0,    should be 15:    takes position, height, velocity and heading from"
        " kybflow"
    )
    assert len(rows) == 11
    assert not any("COM_OBL_RC_ACT" in row for row in rows)
    assert cure == (
        "  to set all of them: `kybflow mavlink setup --vehicle px4 --system 1 --write`"
    )
    assert end == ""
    assert not checks["parameters"].waits
    assert "COM_OBL_RC_ACT is 3" in checks["watchdog"].reason
    checks = looked(set_up(Bench()), 15.0)
    assert [name for name, check in checks.items() if not check.green] == []


def test_the_preflight_says_what_it_says():
    bench = Bench("ardupilot", position="own")
    bench.fake.ready = False
    bench.run(1.0)
    bench.fake.say("PreArm: Battery 1 low", 2)
    checks = looked(bench)
    assert "PreArm: Battery 1 low" in checks["autopilot"].reason
    bench.fake.armed = True
    checks = looked(bench)
    assert "armed already" in checks["autopilot"].reason


def test_the_preflight_sees_that_it_believes_to_be_elsewhere():
    bench = Bench("px4")
    bench.fake.position = (2.0, 0.0, 0.0)
    assert "2.00 m" in looked(bench)["position"].reason
    assert "no estimate to send" in looked(Bench("px4"), tells=False)["position"].reason


def test_another_autopilot_is_told_as_such():
    bench = Bench("px4")
    bench.fake.profile = Bench("ardupilot").fake.profile
    found = looked(bench)
    check = found["heartbeat"]
    assert not check.green
    assert "it is ardupilot, px4 is expected: set the driver's `autopilot`" in check.reason
    assert not found["watchdog"].green, "nothing is known of it yet"
