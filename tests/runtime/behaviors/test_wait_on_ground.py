"""wait_on_ground: rotors at rest, for ever, without an estimate."""

from flying import entry, tick

from kybflow.geometry import ZERO
from kybflow.parts import GROUND
from kybflow.runtime.behaviors.wait_on_ground import WaitOnGround, WaitOnGroundParams
from kybflow.signals import Setpoint, SetpointKind


def test_it_idles_without_an_estimate() -> None:
    behavior = WaitOnGround(WaitOnGroundParams(), entry(ZERO, flight=GROUND))
    assert behavior.update(tick(1e6)) == Setpoint(SetpointKind.IDLE)
