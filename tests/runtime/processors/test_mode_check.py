"""mode_check: kinds of setpoint that are not meant are refused."""

from part_bench import SITE, tick

from kybflow.core.params import fields_of
from kybflow.core.signals import Alarm, Reaction, Setpoint, SetpointKind
from kybflow.runtime.processors.mode_check import ModeCheck, ModeCheckParams

POSITION, VELOCITY, ACCELERATION = (
    Setpoint(kind)
    for kind in (SetpointKind.POSITION, SetpointKind.VELOCITY, SetpointKind.ACCELERATION)
)


def test_as_in_telekyb_positions_and_velocities_pass_and_accelerations_do_not() -> None:
    processor = ModeCheck(ModeCheckParams(), SITE)
    assert processor(POSITION, tick()) is POSITION
    assert processor(VELOCITY, tick()) is VELOCITY
    expected = Alarm(
        "setpoint_kind_refused",
        Reaction.BRAKE,
        "setpoints of acceleration are refused",
        1.0,
        0.0,
    )
    assert expected == processor(ACCELERATION, tick())


def test_what_it_takes_follows_its_parameters() -> None:
    assert set(ModeCheck.takes(ModeCheckParams())) == {
        SetpointKind.POSITION,
        SetpointKind.VELOCITY,
    }
    narrow = ModeCheckParams(velocity=False)
    assert set(ModeCheck.takes(narrow)) == {SetpointKind.POSITION}
    assert isinstance(ModeCheck(narrow, SITE)(VELOCITY, tick()), Alarm)


def test_in_flight_it_only_becomes_stricter() -> None:
    for field in fields_of(ModeCheckParams):
        assert field.loosens(False, True)
        assert not field.loosens(True, False)
