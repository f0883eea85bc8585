"""The link is cut or slow, setpoints stall, motion capture is wrong, the program dies: the vehicle
is safe, and on return goes on or lands as the mission says."""

from __future__ import annotations

from dataclasses import replace

import pytest

pytest.importorskip("pymavlink", reason="pymavlink is not installed")

from dry_runs import AUTOPILOTS, DRIVER, HEIGHT, LANDS, UP, WRONG, DryRun, fault, supervised
from short_flights import down, hold, up

HIGH, HIGH_AT = 2.2, 12.0
"""PX4 needs 2.2 s to be taken back, and sinks by 0.7 m/s meanwhile."""
thorough, slow = pytest.mark.thorough, pytest.mark.slow
PATIENT = {"link": {"age": 10.0}}
NOTICES = {"px4": 1.1, "ardupilot": 2.1}
"""When at the latest its own failsafe has it, seconds after the last word."""


def each(*quick):
    """Every autopilot with every length of the cut; of those that are not `quick` a short one with
    each autopilot is thorough."""
    return pytest.mark.parametrize(
        ("autopilot", "seconds"),
        [
            pytest.param(
                name,
                seconds,
                marks=() if (name, seconds) in quick else thorough if seconds < 0.5 else slow,
            )
            for name in AUTOPILOTS
            for seconds in (0.3, 1.0, 5.0)
        ],
    )


def high():
    return [replace(up("hold", HIGH), at=UP), hold(5.0, "down"), down()]


@pytest.mark.thorough
@each(("px4", 1.0), ("ardupilot", 5.0))
def test_a_cut_link_is_nothing_when_it_is_short_and_else_lands_it(autopilot, seconds, tmp_path):
    flight = DryRun(autopilot, tmp_path, faults=[fault("link_cut", seconds)])
    assert flight.is_safe()
    back = flight.only("link_returned")
    assert (back.at, back.fields["value"]) == (DRIVER, pytest.approx(seconds, abs=0.05))
    if seconds < 0.5:
        assert flight.path == ["up", "hold", "down", "landed"]
        assert flight.flown.exit_code == 0
        return
    assert flight.path == ["up", "hold", "auto_land", "fault"]
    assert flight.at("link_lost") - WRONG == pytest.approx(0.51, abs=0.03)
    if seconds > NOTICES[autopilot]:
        assert flight.after(WRONG, LANDS[autopilot]) < NOTICES[autopilot]


@thorough
@pytest.mark.parametrize("autopilot", AUTOPILOTS)
def test_where_silence_is_allowed_its_own_failsafe_is_an_alarm_and_lands_it(autopilot, tmp_path):
    cut = fault("link_cut", 2.5)
    flight = DryRun(autopilot, tmp_path, faults=[cut], supervisors=supervised(**PATIENT))
    assert flight.is_safe()
    assert flight.events("link_lost") == []
    assert flight.after(WRONG, LANDS[autopilot]) < NOTICES[autopilot]


@thorough
@pytest.mark.parametrize("autopilot", AUTOPILOTS)
@pytest.mark.parametrize("way", ["resume", "land"])
def test_on_return_it_goes_on_or_lands_as_the_mission_says(autopilot, way, tmp_path):
    flight = DryRun(
        autopilot,
        tmp_path,
        faults=[fault("link_cut", 1.1, at=HIGH_AT)],
        driver={"after_failsafe": way},
        supervisors=supervised(**PATIENT),
        states=high(),
    )
    assert flight.is_safe(high=HIGH + 0.1)
    if way == "land":
        started = flight.only("failsafe_started")
        assert (started.at, started.fields["reaction"]) == (DRIVER, "land")
        assert "its own failsafe" in started.fields["reason"]
        assert flight.path == ["up", "hold", "auto_land", "fault"]
    else:
        assert flight.only("control_returned").time > flight.only("control_taken").time
        assert flight.path == ["up", "hold", "down", "landed"]
        assert flight.flown.exit_code == 0


@pytest.mark.thorough
@pytest.mark.parametrize("autopilot", [pytest.param("px4", marks=thorough), "ardupilot"])
def test_one_that_is_nearly_down_is_not_taken_back(autopilot, tmp_path):
    """It would be commanded up from the ground, or be believed to fly while it stands there."""
    mute = fault("link_cut", 2.5, way="to_vehicle")
    again = {"after_failsafe": "resume"}
    flight = DryRun(autopilot, tmp_path, faults=[mute], driver=again)
    assert flight.is_safe()
    assert flight.events("control_returned") == []
    assert flight.path == ["up", "hold", "landed"]
    assert "its own failsafe" in flight.flown.summary["reason"]


@pytest.mark.thorough
@each(("px4", 5.0))
def test_set_points_that_stall_are_a_matter_of_its_own_failsafe(autopilot, seconds, tmp_path):
    mute = fault("link_cut", seconds, way="to_vehicle")
    flight = DryRun(autopilot, tmp_path, faults=[mute])
    assert flight.is_safe()
    if seconds < NOTICES[autopilot] - 0.5:
        assert flight.flown.exit_code == 0
    if seconds > NOTICES[autopilot]:
        assert flight.after(WRONG, LANDS[autopilot]) < NOTICES[autopilot]
        started = flight.only("failsafe_started")
        assert (started.at, started.fields["reaction"]) == (DRIVER, "land")
        words = {"px4": "offboard signal lost", "ardupilot": "GCS Failsafe"}[autopilot]
        assert words in started.fields["reason"]
        assert flight.path == ["up", "hold", "auto_land", "fault"]


@thorough
def test_one_that_holds_by_itself_while_it_is_to_be_landed_is_landed(tmp_path):
    """It was landed by setpoints already when it was found not to follow them."""

    def holds(flight):
        flight.pilot.state.parameters._values["COM_OBL_RC_ACT"] = 5.0

    flight = DryRun("px4", tmp_path, faults=[fault("link_cut", 1.5)], deeds=[(6.0, holds)])
    assert flight.is_safe()
    assert "AUTO.LOITER" in {s.mode for s in flight.samples if s.time > WRONG}
    assert flight.path[-2:] == ["auto_land", "fault"]


@pytest.mark.thorough
@pytest.mark.parametrize("autopilot", ["px4", pytest.param("ardupilot", marks=thorough)])
def test_when_the_program_dies_it_lands_and_stops_its_rotors(autopilot, tmp_path):
    def dies(flight):
        flight.go_on(60.0)
        flight.engine.interrupts = 2

    flight = DryRun(autopilot, tmp_path, deeds=[(WRONG, dies)])
    assert flight.is_safe()
    assert flight.after(WRONG, LANDS[autopilot]) < NOTICES[autopilot]
    down = next(s.time for s in flight.samples if s.time > WRONG and not s.armed)
    assert down - WRONG < 8.0


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("autopilot", "at", "late_poses"),
    [
        ("ardupilot", 2.2, False),
        ("ardupilot", 2.2, True),
        pytest.param("ardupilot", 1.3, False, marks=thorough),
        pytest.param("px4", 3.5, False, marks=thorough),
        pytest.param("px4", 3.5, True, marks=thorough),
    ],
)
def test_one_that_lifts_off_while_the_program_hangs_is_landed(autopilot, at, late_poses, tmp_path):
    """Its arming is under way when the hang begins; it is in the air, in its own failsafe, when the
    hang ends."""
    hang = (at, lambda flight: flight.hang(1.8, late_poses))
    flight = DryRun(autopilot, tmp_path, deeds=[hang])
    assert flight.is_safe()
    assert flight.path[-1] == "fault"
    assert flight.only("landed").time > flight.only("failsafe_started").time
    assert flight.events("arming_refused") == flight.events("foreign_command") == []


@pytest.mark.thorough
@pytest.mark.parametrize("autopilot", [pytest.param("px4", marks=thorough), "ardupilot"])
def test_a_program_that_is_late_does_not_come_between_an_autopilot_and_its_rotors(
    autopilot, tmp_path
):
    flight = DryRun(
        autopilot,
        tmp_path,
        faults=[fault("clock_late", 2.0, by=0.3)],
        supervisors=supervised(link={"delay": 1.0}),
    )
    assert flight.is_safe()
    late = [s for s in flight.samples if WRONG <= s.time < WRONG + 1.0]
    assert min(s.position[2] for s in late) > HEIGHT - 0.1


@pytest.mark.thorough
@pytest.mark.parametrize("autopilot", ["px4", pytest.param("ardupilot", marks=thorough)])
def test_a_slow_link_is_noticed_and_the_autopilot_lands_it(autopilot, tmp_path):
    flight = DryRun(autopilot, tmp_path, faults=[fault("clock_late", by=0.3)])
    assert flight.is_safe()
    slow = flight.only("link_slow").fields
    assert (slow["value"], slow["bound"]) == (pytest.approx(0.31, abs=0.02), 0.2)
    assert flight.at("link_slow") - WRONG < 0.75
    assert flight.after(WRONG, LANDS[autopilot]) < 1.2
    assert flight.path == ["up", "hold", "auto_land", "fault"]


@thorough
@pytest.mark.parametrize("autopilot", AUTOPILOTS)
@pytest.mark.parametrize(("seconds", "by"), [(0.4, 0.3), pytest.param(None, 0.05, marks=slow)])
def test_a_hiccup_is_no_slow_link_nor_is_one_that_is_a_little_late(
    autopilot, seconds, by, tmp_path
):
    flight = DryRun(autopilot, tmp_path, faults=[fault("clock_late", seconds, by=by)])
    assert flight.is_safe()
    assert flight.path == ["up", "hold", "down", "landed"]
    assert flight.events("link_slow") == []


BOUND = 0.3
"""Seconds; of the supervisor `estimate`."""
DRIFT = 1.2
"""Metres, blind from 0.6 m to the ground."""


@pytest.mark.parametrize(
    "autopilot", ["px4", pytest.param("ardupilot", marks=pytest.mark.thorough)]
)
def test_motion_capture_lost_for_good(autopilot, tmp_path):
    flight = DryRun(autopilot, tmp_path, faults=[fault("mocap_dropout")])
    lost = flight.only("estimate_lost")
    since_last_pose = lost.fields["value"]
    assert BOUND < since_last_pose < BOUND + 0.3
    assert since_last_pose < BOUND + 0.025, "the watch is asked 50 times a second"
    assert flight.at("failsafe_started") - WRONG < since_last_pose
    assert flight.path == ["up", "hold", "land_blind", "fault"]
    assert flight.only("land_mode_started")
    assert flight.is_safe(wide=DRIFT)


@pytest.mark.parametrize("autopilot", AUTOPILOTS)
@pytest.mark.thorough
def test_an_estimate_that_jumps_by_a_metre_is_not_followed(autopilot, tmp_path):
    flight = DryRun(autopilot, tmp_path, faults=[fault("mocap_jump")])
    jumped = flight.only("body_jumped")
    assert jumped.fields["value"] == pytest.approx(1.0, abs=0.02)
    assert flight.at("body_jumped") - WRONG < 0.05
    assert flight.path == ["up", "hold", "land_blind", "fault"]
    assert flight.only("land_mode_started")
    assert flight.is_safe(wide=DRIFT)
