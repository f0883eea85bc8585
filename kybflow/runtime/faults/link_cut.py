"""The link to the vehicle is cut: messages are lost, in both directions or in one.

This simulates a vehicle that is out of range or behind a wall, or a radio that hangs. Lost messages
are not sent again when the link is back. The vehicle behaves as it does without commands.
Measurements that don't use the link, such as motion capture poses beside an autopilot, still
arrive.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

from kybflow.parts import Effect, Fault, param, params


@params
class LinkCutParams:
    way: Literal["both", "to_vehicle", "from_vehicle"] = param(
        "The direction that is cut: to the vehicle, from the vehicle, or `both`.",
        default="both", read_only=True,
    )  # fmt: skip


class LinkCut(Fault[LinkCutParams]):
    ours = True

    def effects(self, vehicle: str) -> Mapping[str, Effect]:
        way = self.params.way
        return {vehicle: Effect(deaf=way != "to_vehicle", mute=way != "from_vehicle")}
