"""What an emulated autopilot does by itself: when set-points, ground stations, its position or its
battery's charge are gone, and when it is time to stop the rotors. As the firmwares were seen to."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from kybflow.core.signals import NS, Time
from kybflow.drivers.emulated_autopilot.control.setpoints import Tilt
from kybflow.drivers.emulated_autopilot.firmware.firmware import Role
from kybflow.drivers.emulated_autopilot.state import State

RESTS: Time = NS
"""ArduPilot disarms so long after a landing in a mode that lands."""


class Act(NamedTuple):
    """A change of mode that nobody asked for; mode None: the rotors stop. words: said with it."""

    mode: int | None
    words: str
    cause: str


def act(state: State, now: Time) -> Act | None:
    """What is to be done now by itself, while armed."""
    if state.is_down:
        return _rest(state, now)
    own = _px4(state, now) if state.firmware.name == "px4" else _ardupilot(state, now)
    if own is None or own.mode == state.mode or own.cause == state.failed_over:
        return None
    return own


def forgets(state: State, now: Time) -> bool:
    """Whether the set-point is too old: ArduPilot follows a velocity or an attitude only for so
    long, a position for ever. PX4 leaves the mode instead."""
    wanted, at = state.wanted, state.wanted_at
    if state.firmware.name == "px4" or wanted is None or at is None:
        return False
    lasting = not isinstance(wanted, Tilt) and None not in wanted.position
    return not lasting and now - at > state.parameters["GUID_TIMEOUT"] * NS


def _rest(state: State, now: Time) -> Act | None:
    """On the ground."""
    p, stood = state.parameters, now - max(state.landed_at, state.armed_at)
    px4 = state.firmware.name == "px4"
    if not state.has_flown:
        idle = p["COM_DISARM_PRFLT"] if px4 else p["DISARM_DELAY"]
        if px4 and state.flying.role is Role.FOLLOW and state.streams(now):
            return None
        if state.climb_to is None and 0.0 < idle * NS <= stood:
            return Act(None, "Disarmed by auto preflight disarming" if px4 else "", "idle")
        return None
    if px4:
        landed = p["COM_DISARM_LAND"]
        return Act(None, "Disarmed by landing", "landed") if 0 < landed * NS <= stood else None
    lands = state.flying.role in (Role.LAND, Role.RETURN)
    wait = RESTS if lands else p["DISARM_DELAY"] * NS
    return Act(None, "", "landed") if 0 < wait <= stood else None


def _px4(state: State, now: Time) -> Act | None:
    p, role, firmware = state.parameters, state.flying.role, state.firmware
    unseen = state.estimator.unseen(now)
    if state.flying.needs_position and (unseen is None or unseen > firmware.gives_up):
        return Act(firmware.land, "Failsafe activated: switching to Descend", "position")
    low, levels = p["COM_LOW_BAT_ACT"], ("BAT_CRIT_THR", "BAT_EMERGEN_THR")
    critical, empty = (state.remaining < p[level] for level in levels)
    if low >= 2 and empty and role is not Role.LAND:
        return Act(firmware.land, "Failsafe activated: emergency battery", "battery")
    if low in (1, 3) and critical and role not in (Role.LAND, Role.RETURN):
        return Act(firmware.back, "Failsafe activated: critical battery", "battery")
    if low == 2 and critical and role is not Role.LAND:
        return Act(firmware.land, "Failsafe activated: critical battery", "battery")
    if role is Role.FOLLOW and not state.streams(now):
        action = {4: firmware.land, 5: firmware.hold}.get(int(p["COM_OBL_RC_ACT"]), firmware.back)
        return Act(action, "Failsafe activated: offboard signal lost", "set-points")
    alone = {1: firmware.hold, 2: firmware.back, 3: firmware.land}.get(int(p["NAV_DLL_ACT"]))
    if alone is not None and _deserted(state.stations.values(), p["COM_DL_LOSS_T"], now):
        return Act(alone, "Failsafe activated: GCS connection lost", "station")
    return None


def _ardupilot(state: State, now: Time) -> Act | None:
    p, role, firmware = state.parameters, state.flying.role, state.firmware
    unseen = state.estimator.unseen(now)
    if state.flying.needs_position and (unseen is None or unseen > firmware.gives_up):
        return Act(firmware.land, "EKF Failsafe: changed to LAND Mode", "position")
    if 0.0 < state.voltage < p["BATT_LOW_VOLT"] and p["BATT_FS_LOW_ACT"] and role is not Role.LAND:
        mode = firmware.land if p["BATT_FS_LOW_ACT"] == 1 else firmware.back
        return Act(mode, "Battery Failsafe", "battery")
    station = state.stations.get(int(p["SYSID_MYGCS"]))
    if not p["FS_GCS_ENABLE"] or station is None or role is Role.LAND:
        return None
    if not _deserted((station,), p["FS_GCS_TIMEOUT"], now):
        return None
    back = p["FS_GCS_ENABLE"] in (1, 3, 4)
    return Act(firmware.back if back else firmware.land, "GCS Failsafe", "station")


def _deserted(heard: Iterable[Time], patience: float, now: Time) -> bool:
    """Whether ground stations were heard, and none is any more."""
    times = tuple(heard)
    return bool(times) and now - max(times) > patience * NS
