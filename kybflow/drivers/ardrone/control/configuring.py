"""Writes a drone's configuration, one value at a time, and reads it back.

To write a value, the acknowledge bit is cleared with CTRL 5, then CONFIG is sent until the bit is
set. All values but the first follow CONFIG_IDS in the same datagram. Until the first value,
`general:navdata_demo`, is set, a drone that has just started stays in bootstrap and sends no
options. Finally CTRL 4 requests the whole configuration, and each value is compared.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from kybflow.core.signals import NS, Time
from kybflow.drivers.ardrone.control.moves import Limits
from kybflow.drivers.ardrone.params import ArdroneLinkParams
from kybflow.drivers.ardrone.protocol.at import (
    RESET_ACKNOWLEDGE,
    SEND_CONFIGURATION,
    Ids,
    Line,
    config,
    config_ids,
    ctrl,
)
from kybflow.drivers.ardrone.protocol.configuration import agrees, read_configuration
from kybflow.drivers.ardrone.protocol.navdata.layouts import OptionTag

RESEND_PERIOD: Time = NS // 4
"""Period in which a value is resent until it is acknowledged."""
READ_PERIOD: Time = NS
"""Period in which the configuration is requested until it arrives."""
OPTIONS = sum(
    1 << tag
    for tag in (
        OptionTag.DEMO,
        OptionTag.TIME,
        OptionTag.RAW_MEASURES,
        OptionTag.PHYS_MEASURES,
        OptionTag.MAGNETO,
        OptionTag.WIFI,
    )
)
FIRST = "general:navdata_demo"
VERSION = "general:num_version_soft"
WATCHDOG = "general:com_watchdog"
LONGEST_WATCHDOG = 2.0
"""Longest accepted time without a command after which the drone lands, seconds; also the
default."""

H264_360P = "129"
"""Video codec: H.264 at 640 x 360."""

Values = tuple[tuple[str, str], ...]


def values_of(params: ArdroneLinkParams, limits: Limits, ids: Ids) -> Values:
    """Return the values to write, in order, as pairs of key and value."""
    p = params
    return (
        (FIRST, _truth(p.navdata == "demo")),
        ("custom:session_id", ids.session),
        ("custom:application_id", ids.application),
        ("custom:profile_id", ids.user),
        ("general:navdata_demo", _truth(p.navdata == "demo")),
        ("general:navdata_options", str(OPTIONS)),
        ("control:outdoor", _truth(p.outdoor)),
        ("control:flight_without_shell", _truth(not p.hull)),
        ("control:altitude_max", str(round(p.altitude_max * 1000.0))),
        ("control:euler_angle_max", f"{limits.tilt:.6f}"),
        ("control:control_vz_max", str(round(limits.climb * 1000.0))),
        ("control:control_yaw", f"{limits.turn:.6f}"),
        ("video:video_codec", H264_360P),
        ("video:video_channel", "1" if p.video == "down" else "0"),
        ("pic:ultrasound_freq", "7" if p.ultrasound == "22 Hz" else "8"),
    )


class Configuring:
    """Writes and reads the configuration of one drone. found: the configuration as read, None
    before. post: sends lines once. listen: opens the connection that receives the configuration."""

    def __init__(
        self,
        values: Values,
        ids: Ids,
        post: Callable[..., None],
        listen: Callable[[], None],
    ) -> None:
        self._values, self._ids, self._post, self._listen = values, ids, post, listen
        self.found: Mapping[str, str] | None = None
        self._at = 0
        self._sent: Time | None = None
        self._clears = True
        self._asked: Time | None = None

    def restart(self) -> None:
        """Write all values again, because the drone has restarted."""
        self._at, self._sent, self._clears, self._asked = 0, None, True, None
        self.found = None

    @property
    def pending(self) -> str:
        """The step that is not acknowledged or finished yet, as a text; empty when all is done."""
        if self._at < len(self._values):
            return f"`{self._values[self._at][0]}` is not acknowledged"
        return "" if self.found is not None else "the drone has not sent its configuration"

    @property
    def mismatches(self) -> Sequence[str]:
        """The differences between the values read and those written, as texts."""
        found = self.found or {}
        return [
            f"`{key}` is {found[key]}, not {value}"
            for key, value in dict(self._values).items()
            if key in found and not agrees(value, found[key])
        ]

    def update(self, acknowledges: bool, now: Time) -> None:
        """Continue writing and reading. Called once a tick until nothing is `pending`.
        acknowledges: whether the acknowledge bit is set."""
        if self._at < len(self._values):
            self._write(acknowledges, now)
        elif self.found is None and self._is_due(self._asked, READ_PERIOD, now):
            self._listen()
            self._asked = now
            self._post(ctrl(SEND_CONFIGURATION))

    def read(self, data: bytes) -> None:
        """Parse the configuration that the drone sent."""
        if self._at == len(self._values):
            self.found = read_configuration(data)

    def _write(self, acknowledges: bool, now: Time) -> None:
        if self._clears and not acknowledges:
            self._clears, self._sent = False, None
        elif not self._clears and acknowledges and self._sent is not None:
            self._at, self._clears, self._sent = self._at + 1, True, None
        if self._at < len(self._values) and self._is_due(self._sent, RESEND_PERIOD, now):
            self._sent = now
            self._post(*self._lines())

    def _lines(self) -> tuple[Line, ...]:
        if self._clears:
            return (ctrl(RESET_ACKNOWLEDGE),)
        line = config(*self._values[self._at])
        return (line,) if self._at == 0 else (config_ids(self._ids), line)

    @staticmethod
    def _is_due(before: Time | None, period: Time, now: Time) -> bool:
        return before is None or now - before >= period


def _truth(value: bool) -> str:
    return "TRUE" if value else "FALSE"
