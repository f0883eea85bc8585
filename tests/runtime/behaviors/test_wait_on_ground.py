"""wait_on_ground: rotors at rest, for ever, without an estimate."""

from part_bench import entry, tick

from kybflow.core.geometry import ZERO
from kybflow.core.signals import Setpoint, SetpointKind
from kybflow.parts import GROUND
from kybflow.runtime.behaviors.wait_on_ground import WaitOnGround, WaitOnGroundParams


def test_it_idles_without_an_estimate() -> None:
    behavior = WaitOnGround(WaitOnGroundParams(), entry(ZERO, flight=GROUND))
    assert behavior.update(tick(1e6)) == Setpoint(SetpointKind.IDLE)
