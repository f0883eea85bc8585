"""How an emulated autopilot is set up: as it comes, or as its owner made it ready for kybflow."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

from kybflow.core.errors import DriverError
from kybflow.drivers.emulated_autopilot.control.payload import GRIPPER
from kybflow.drivers.emulated_autopilot.firmware.ardupilot import ARDUPILOT
from kybflow.drivers.emulated_autopilot.firmware.firmware import Firmware
from kybflow.drivers.emulated_autopilot.firmware.px4 import PX4
from kybflow.drivers.mavlink.firmware import profile_of
from kybflow.dsl.diagnostics.diagnostic import did_you_mean
from kybflow.world.vehicle_context import VehicleContext

FIRMWARES: dict[str, Firmware] = {"px4": PX4, "ardupilot": ARDUPILOT}


class Plans(NamedTuple):
    """How a vehicle's autopilot is to be. outside: whether its position comes from a client.
    station: the system id of the client that it obeys. changes: of its parameters, on top."""

    firmware: str
    outside: bool
    prepared: bool
    station: int
    changes: Mapping[str, float] = MappingProxyType({})


def check_names(firmware: str, changes: Mapping[str, float]) -> None:
    """Raises DriverError for a parameter that the emulated firmware does not have."""
    profile = profile_of(firmware)
    known = set(FIRMWARES[firmware].parameters)
    known |= {setting.name for setting in profile.indoors}
    known |= {danger.name for danger in profile.dangers}
    for name in changes.keys() - known:
        hint = did_you_mean(name, known)
        raise DriverError(f"the emulated {firmware} has no parameter {name}; {hint}")


def as_built(firmware: Firmware, context: VehicleContext, system: int) -> dict[str, float]:
    """Parameters that any airframe has of its own: what throttle it hovers with."""
    hover = round(context.airframe.hover_thrust / context.airframe.max_thrust, 4)
    if firmware.bytewise:
        return {"MPC_THR_HOVER": hover, "MAV_SYS_ID": system}
    return {"MOT_THST_HOVER": hover, "SYSID_THISMAV": system}


def prepared(
    firmware: Firmware, context: VehicleContext, system: int, *, outside: bool, station: int
) -> dict[str, float]:
    """The same, and what kybflow's own profile wants. outside: whether its position comes from
    kybflow; else its own is left on. station: the system id of the program that flies it."""
    profile = profile_of(firmware.name)
    safe = {danger.name for danger in profile.dangers}
    changes = as_built(firmware, context, system)
    for setting in profile.indoors:
        if outside or setting.name in safe or setting.value == "own":
            found = firmware.parameters.get(setting.name, 0.0)
            if not setting.accepts(found, station):
                changes[setting.name] = setting.wanted(station, found)
    if context.payload is not None:
        function = GRIPPER if firmware.bytewise else 0
        changes[profile.output(context.payload.channel, True).parameter] = function
    return changes
