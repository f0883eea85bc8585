"""Motion capture does not see the vehicle, or an object of the world: its poses are lost.

Each pose is lost independently with the probability `share`; by default all are lost. Other
measurements still arrive.
"""

from __future__ import annotations

from collections.abc import Mapping

from kybflow.core.signals import Measurement, Pose
from kybflow.core.units import Ratio
from kybflow.parts import Effect, Fault, param, params


@params
class MocapDropoutParams:
    object: str | None = param(
        "The object that is not seen, instead of the vehicle.",
        default=None, names="object", read_only=True,
    )  # fmt: skip
    share: Ratio = param(
        "Share of the poses that is lost.", default=1.0, above=0.0, at_most=1.0, read_only=True
    )


class MocapDropout(Fault[MocapDropoutParams]):
    spoils = Pose
    ours = True

    def effects(self, vehicle: str) -> Mapping[str, Effect]:
        return {self.params.object or vehicle: Effect(filter=self._lose)}

    def _lose(self, measurement: Measurement) -> Measurement | None:
        lost = isinstance(measurement, Pose) and self.generator.random() < self.params.share
        return None if lost else measurement
