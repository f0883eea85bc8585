"""What motion capture says is wrong, or it says nothing any more: kybflow's own supervisor acts,
long before the autopilot does, and the vehicle comes down."""

from __future__ import annotations

import pytest

pytest.importorskip("pymavlink", reason="pymavlink is not installed")

from dry_runs import AUTOPILOTS, WRONG, DryRun, fault

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
