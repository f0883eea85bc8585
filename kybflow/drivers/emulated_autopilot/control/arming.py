"""Why an emulated autopilot will not be armed or change its mode, in its firmware's words."""

from __future__ import annotations

from kybflow.core.geometry import tilt_of
from kybflow.core.signals import NS, Time
from kybflow.core.units import DEG
from kybflow.drivers.emulated_autopilot.estimation.estimator import sources
from kybflow.drivers.emulated_autopilot.firmware.firmware import Role
from kybflow.drivers.emulated_autopilot.state import State

LEANS = 20.0 * DEG
PILOT_LOST: Time = 3 * NS // 2


def refusal(state: State, now: Time) -> str:
    """Why it can't be armed now in its mode; empty when it can."""
    if state.failures.refuses:
        return state.failures.refuses
    return _px4(state, now) if state.firmware.name == "px4" else _ardupilot(state, now)


def mode_refusal(state: State, number: int, now: Time) -> str:
    """Why it does not change to a mode now; empty when it does."""
    mode = state.firmware.modes[number]
    if state.failures.bars:
        return state.failures.bars
    if not state.armed:
        return ""
    if mode.needs_position and not state.estimator.has_position(now):
        return f"Mode change to {mode.name} failed: requires position"
    if state.firmware.name == "px4":
        if mode.role is Role.FOLLOW and not state.streams(now):
            return "Switching to mode 'Offboard' is currently not available"
        if mode.role is Role.PILOT and not has_pilot(state, now):
            return f"Switching to mode '{mode.name}' is currently not available"
    return ""


def has_pilot(state: State, now: Time) -> bool:
    """Whether a transmitter is heard."""
    return state.sticks is not None and now - state.sticks.time < PILOT_LOST


def _tilt(state: State) -> float:
    return state.failures.leans or tilt_of(state.estimator.attitude.value)


def _px4(state: State, now: Time) -> str:
    estimator, mode = state.estimator, state.flying
    if not estimator.is_settled(now):
        return "Preflight Fail: ekf2 missing data"
    if _tilt(state) > LEANS:
        return "Preflight Fail: Attitude failure (roll)"
    if state.remaining < state.parameters["BAT_LOW_THR"]:
        return "Preflight Fail: low battery"
    if mode.role in (Role.LAND, Role.RETURN):
        return f"Arming denied: mode {mode.name} can't be armed in"
    return _px4_mode(state, now)


def _px4_mode(state: State, now: Time) -> str:
    """What its mode lacks."""
    mode = state.flying
    if mode.role is Role.PILOT and not has_pilot(state, now):
        return "Preflight Fail: No manual control input"
    if mode.needs_position and not state.estimator.has_position(now):
        return "Preflight Fail: No valid local position estimate"
    if mode.role in (Role.HOLD, Role.TAKE_OFF) and state.origin is None:
        return "Preflight Fail: No valid global position estimate"
    if mode.role is Role.FOLLOW and not state.streams(now):
        return "Preflight Fail: No offboard signal"
    return ""


def _ardupilot(state: State, now: Time) -> str:
    estimator, mode, p = state.estimator, state.flying, state.parameters
    if p["ARMING_CHECK"] == 0:
        return ""
    if not estimator.is_settled(now):
        return "PreArm: AHRS: not healthy"
    if 0.0 < state.voltage < max(p["BATT_LOW_VOLT"], p["BATT_ARM_VOLT"]):
        return "PreArm: Battery 1 low voltage failsafe"
    if _tilt(state) > LEANS:
        return "Arm: Leaning"
    if mode.role in (Role.LAND, Role.RETURN, Role.HOLD):
        return f"Arm: {mode.name} mode not armable"
    return _ardupilot_position(state, now)


def _ardupilot_position(state: State, now: Time) -> str:
    """What its position lacks."""
    estimator, heeds_vision = state.estimator, sources(state.parameters).vision
    if heeds_vision and not estimator.sees(now):
        return "PreArm: VisOdom: not healthy"
    if heeds_vision and state.origin is None:
        return "PreArm: AHRS: waiting for home"
    if state.flying.needs_position and not estimator.has_position(now):
        return "Arm: Need Position Estimate"
    return ""
