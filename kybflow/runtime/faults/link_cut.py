"""The link to the vehicle is cut: what is said over it is lost, both ways or one.

As out of range, behind a wall, or with a radio that hangs. Nothing is sent later when it is back.
The vehicle does what it does when nobody commands it. What comes another way, such as the poses of
motion capture beside an autopilot, comes as ever; where the link brings everything, nothing comes.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

from kybflow.parts import Effect, Fault, param, params


@params
class LinkCutParams:
    way: Literal["both", "to_vehicle", "from_vehicle"] = param(
        "Which way is cut: what is sent to the vehicle, what comes from it, or `both`.",
        default="both", read_only=True,
    )  # fmt: skip


class LinkCut(Fault[LinkCutParams]):
    ours = True

    def effects(self, vehicle: str) -> Mapping[str, Effect]:
        way = self.params.way
        return {vehicle: Effect(deaf=way != "to_vehicle", mute=way != "from_vehicle")}
