"""position_error: an alarm past the limit, nothing before it."""

from flying import SITE, at_rest, estimate, tick

from kybflow.geometry import ZERO
from kybflow.runtime.processors.position_error import PositionError, PositionErrorParams
from kybflow.signals import Alarm, Reaction, Setpoint, SetpointKind

PROCESSOR = PositionError(PositionErrorParams(), SITE)
KNOWN = estimate((0.0, 0.0, 1.0))


def test_past_the_limit_it_asks_to_brake() -> None:
    expected = Alarm(
        "position_error_exceeded",
        Reaction.BRAKE,
        "0.75 m from its setpoint, 0.5 m allowed",
        0.75,
        0.5,
    )
    assert expected == PROCESSOR(at_rest((0.75, 0.0, 1.0)), tick(known=KNOWN))


def test_within_the_limit_the_setpoint_passes() -> None:
    near = at_rest((0.5, 0.0, 1.0))
    assert PROCESSOR(near, tick(known=KNOWN)) is near


def test_a_setpoint_without_a_position_passes() -> None:
    velocity = Setpoint(SetpointKind.VELOCITY, None, (9.0, 0.0, 0.0), ZERO)
    assert PROCESSOR(velocity, tick(known=KNOWN)) is velocity
