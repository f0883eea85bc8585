"""The mode requested from an autopilot, and the mode that it reports.

An acknowledgement only means that a request was accepted. Only HEARTBEAT and CURRENT_MODE show
which mode is in force.
"""

from __future__ import annotations

from kybflow.core.signals import Time
from kybflow.drivers.mavlink.control.requests import CommandRequests, Retries
from kybflow.drivers.mavlink.firmware import FirmwareProfile
from kybflow.drivers.mavlink.protocol.dialect import mavlink
from kybflow.drivers.mavlink.telemetry.received_status import ReceivedStatus


class Modes:
    """The modes of one autopilot.

    wanted: the requested mode's name in the profile, None if no mode is requested.
    was_in_force: whether that mode has been in force since the request.
    before: the custom_mode before the first request."""

    def __init__(
        self, profile: FirmwareProfile, status: ReceivedStatus, requests: CommandRequests
    ) -> None:
        self.wanted: str | None = None
        self.was_in_force = False
        self.before: int | None = None
        self._profile, self._status, self._requests = profile, status, requests
        self._asking: Retries | None = None

    @property
    def reported(self) -> str:
        """The firmware's name of the mode that the autopilot reports."""
        mode = self._status.mode
        return "no known mode" if mode is None else self._profile.mode_name(mode)

    def is_in(self, name: str) -> bool:
        """Return whether the autopilot reports this mode of the profile."""
        return self._status.mode == self._profile.modes[name]

    @property
    def is_manual(self) -> bool:
        """Whether the autopilot reports a mode that a person flies."""
        return self.reported in self._profile.manual_modes

    @property
    def in_force(self) -> bool:
        """Whether the requested mode is in force."""
        return self.wanted is not None and self.is_in(self.wanted)

    @property
    def has_left(self) -> bool:
        """Whether the requested mode was in force and no longer is."""
        return self.was_in_force and not self.in_force

    def want(self, name: str | None) -> None:
        """Request this mode from now on; None withdraws the request."""
        if name != self.wanted:
            self._want(name)

    def again(self) -> None:
        """Request the wanted mode again after the autopilot has left it."""
        self._want(self.wanted)

    def step(self, now: Time) -> bool:
        """Send the request if it is due; return whether the mode is in force. A mode that was in
        force and was left is not requested again. Called once a tick."""
        if self.wanted is None:
            return False
        if self.before is None:
            self.before = self._status.mode
        if self.in_force:
            self.was_in_force = True
            self._drop()
            return True
        if not self.was_in_force:
            if self._asking is None:
                params = self._profile.mode_params(self._profile.modes[self.wanted])
                self._asking = Retries(self._requests, mavlink.MAV_CMD_DO_SET_MODE, params)
            self._asking.step(now)
        return False

    @property
    def trouble(self) -> str:
        """Why the requested mode is not in force, with the autopilot's refusal if there is one."""
        if self.wanted is None:
            return "no mode is requested"
        name = self._profile.mode_name(self._profile.modes[self.wanted])
        refusal = self._asking.refusal if self._asking is not None else ""
        return f"it won't go from {self.reported} to {name}" + (f": {refusal}" if refusal else "")

    def _want(self, name: str | None) -> None:
        self.wanted, self.was_in_force = name, False
        self._drop()

    def _drop(self) -> None:
        if self._asking is not None:
            self._asking.drop()
            self._asking = None
