"""Something covers some of the tags that the vehicle's cameras could see.

The covered tags are drawn at random once for the whole run; a larger `share` covers more of them.
"""

from __future__ import annotations

from collections.abc import Mapping

from kybflow.core.signals import Frame
from kybflow.core.units import Ratio
from kybflow.parts import Effect, Fault, param, params
from kybflow.world.cameras import Weakness


@params
class TagsCoveredParams:
    share: Ratio = param(
        "Share of the tags that is covered, in addition to the camera's own.",
        default=0.5, above=0.0, at_most=1.0, read_only=True,
    )  # fmt: skip


class TagsCovered(Fault[TagsCoveredParams]):
    spoils = Frame
    ours = True

    def effects(self, vehicle: str) -> Mapping[str, Effect]:
        return {vehicle: Effect(camera=Weakness(covered=self.params.share))}
