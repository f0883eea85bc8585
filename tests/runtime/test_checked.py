"""Commands that can't be sent: not finite, or without what their kind needs."""

from __future__ import annotations

from math import inf, nan
from typing import Any

import pytest

from kybflow.core.geometry import LEVEL, ZERO
from kybflow.core.signals import Command, CommandKind, Setpoint, SetpointKind
from kybflow.runtime.finite import checked_command

GOOD = Command(LEVEL, 10.0, ZERO, None)
MOVING = Setpoint(SetpointKind.VELOCITY, None, (1.0, 0.0, 0.0), heading_rate=0.1)


@pytest.mark.parametrize(
    "command",
    [
        GOOD,
        GOOD._replace(kind=CommandKind.RATES_THRUST),
        GOOD._replace(kind=CommandKind.VELOCITY, setpoint=MOVING),
    ],
)
def test_a_good_one_is_given_back(command: Command) -> None:
    assert checked_command(command) is command


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"thrust": nan}, "not finite"),
        ({"attitude": (1.0, inf, 0.0, 0.0)}, "not finite"),
        ({"kind": CommandKind.RATES_THRUST, "rates": (0.0, nan, 0.0)}, "not finite"),
        ({"kind": CommandKind.VELOCITY, "setpoint": MOVING._replace(velocity=(nan, 0.0, 0.0))},
         "not finite"),
        ({"kind": CommandKind.VELOCITY}, "a command of velocity has no velocity"),
        ({"kind": CommandKind.POSITION, "setpoint": MOVING}, "of position has no position"),
        ({"kind": CommandKind.ACCELERATION, "setpoint": MOVING}, "has no acceleration"),
    ],
)  # fmt: skip
def test_one_that_cannot_be_sent_says_why(changes: dict[str, Any], reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        checked_command(GOOD._replace(**changes))
