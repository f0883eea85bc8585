"""Writes a drone's configuration, one value at a time, reads it back, and measures the delay.

To write a value, the acknowledge bit is cleared with CTRL 5, then CONFIG is sent until the bit is
set. All values but the first follow CONFIG_IDS in the same datagram. Until the first value,
`general:navdata_demo`, is set, a drone that has just started stays in bootstrap and sends no
options. Finally CTRL 4 requests the whole configuration, and each value is compared.

The drone answers no AT command, but CONFIG sets the acknowledge bit and CTRL 5 clears it, and both
are sent like any other command. A round trip lasts from the request to change the bit until
navigation data shows the change. The value written is `gps:altitude`, which is only a tag of
pictures and which controllers may set in flight (SDK 2.0, developer guide).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from kybflow.core.signals import NS, Time
from kybflow.drivers.ardrone.at import (
    RESET_ACKNOWLEDGE,
    SEND_CONFIGURATION,
    Ids,
    Line,
    agrees,
    config,
    config_ids,
    ctrl,
    read_configuration,
)
from kybflow.drivers.ardrone.navdata import OptionTag
from kybflow.drivers.ardrone.params import ArdroneLinkParams, Limits

RESEND_PERIOD: Time = NS // 4
"""Period in which a value is resent until it is acknowledged."""
READ_PERIOD: Time = NS
"""Period in which the configuration is requested until it arrives."""
OPTIONS = sum(
    1 << tag
    for tag in (
        OptionTag.DEMO, OptionTag.TIME, OptionTag.RAW_MEASURES, OptionTag.PHYS_MEASURES,
        OptionTag.MAGNETO, OptionTag.WIFI,
    )
)  # fmt: skip
FIRST = "general:navdata_demo"
VERSION, NAME = "general:num_version_soft", "general:ardrone_name"
WATCHDOG = "general:com_watchdog"
IGNORED_NS: Time = 4 * NS
"""Time without an acknowledgement after which the drone is believed to ignore this client, twice
as long as a client that has gone keeps the drone."""
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
    """Writes and reads the configuration of one drone.

    found: the configuration that was read; None until it has arrived.
    post: queues command lines, each of which is sent only once.
    listen: opens the connection that receives the configuration.
    """

    def __init__(
        self, values: Values, ids: Ids, post: Callable[..., None], listen: Callable[[], None]
    ) -> None:
        self._values, self._ids, self._post, self._listen = values, ids, post, listen
        self.found: Mapping[str, str] | None = None
        self._at = 0
        self._sent: Time | None = None
        self._acknowledged: Time | None = None
        self._clears = True
        self._asked: Time | None = None

    def restart(self) -> None:
        """Write all values again, because the drone has restarted."""
        self._at, self._sent, self._clears, self._asked = 0, None, True, None
        self.found = self._acknowledged = None

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

    def is_ignored(self, now: Time) -> bool:
        """Return whether values are written and the drone acknowledges none."""
        since = self._acknowledged
        writes = self._at < len(self._values)
        return writes and since is not None and now - since > IGNORED_NS

    def update(self, acknowledges: bool, now: Time) -> None:
        """Continue writing and reading. Called once a tick until nothing is `pending`.
        acknowledges: whether the acknowledge bit is set."""
        if self._at < len(self._values):
            self._write(acknowledges, now)
        elif self.found is None and (self._asked is None or now - self._asked >= READ_PERIOD):
            self._listen()
            self._asked = now
            self._post(ctrl(SEND_CONFIGURATION))

    def read(self, data: bytes) -> None:
        """Parse the configuration that the drone sent."""
        if self._at == len(self._values):
            self.found = read_configuration(data)

    def _write(self, acknowledges: bool, now: Time) -> None:
        if self._acknowledged is None:
            self._acknowledged = now
        if self._clears and not acknowledges:
            self._clears, self._sent = False, None
        elif not self._clears and acknowledges and self._sent is not None:
            self._at, self._clears, self._sent = self._at + 1, True, None
            self._acknowledged = now
        if self._at == len(self._values):
            return
        if self._sent is None or now - self._sent >= RESEND_PERIOD:
            self._sent = now
            line = ctrl(RESET_ACKNOWLEDGE) if self._clears else config(*self._values[self._at])
            has_ids = not self._clears and self._at > 0
            self._post(*((config_ids(self._ids), line) if has_ids else (line,)))


def _truth(value: bool) -> str:
    return "TRUE" if value else "FALSE"


PERIOD_NS: Time = NS // 5
"""Period in which a change is requested."""
CHANGE_RESEND_PERIOD: Time = 3 * NS // 100
"""Period in which the request is resent, so that a lost datagram doesn't cause a long round
trip."""
RESEND_TIMEOUT_NS: Time = 2 * NS
"""Time after which to stop resending, and to stop waiting for the first change, since a firmware
may not know the value."""
ALONE = 6
"""How many times as long as two round trips one has to take to count as much."""
TAG, UNSET = "gps:altitude", "0"


class RoundTrips:
    """The round trips of one drone.

    delay: the shorter of the last two round trips, seconds, including the wait for kybflow's tick;
    zero until two have been measured. A pending round trip counts with its duration so far, and
    with its `ALONE`th part if the one before it was short: commands may be queued on their way.
    post: queues command lines, each of which is sent only once.
    """

    def __init__(self, ids: Ids, post: Callable[..., None]) -> None:
        self._write = (config_ids(ids), config(TAG, UNSET))
        self._post = post
        self.restart()

    def waits(self, now: Time) -> bool:
        """Return whether the delay is unknown but may still be measured: no pending request has
        timed out."""
        return not self.delay and (self._asked is None or now - self._asked < RESEND_TIMEOUT_NS)

    def restart(self) -> None:
        """Discard all round trips, because the drone is being configured."""
        self.delay = 0.0
        self._before = self._newest = self._next = 0
        self._asked: Time | None = None
        self._sent: Time = 0
        self._asks_for = False

    def update(self, acknowledges: bool, now: Time) -> None:
        """Continue measuring; called once a tick. acknowledges: whether the acknowledge bit is
        set."""
        if self._asked is None:
            if now >= self._next:
                self._asked, self._next, self._asks_for = now, now + PERIOD_NS, not acknowledges
                self._send(now)
            return
        taken = now - self._asked
        if acknowledges is self._asks_for:
            self._before, self._newest, self._asked = self._newest, taken, None
            self.delay = min(self._before, self._newest) / NS
            return
        alone = taken // ALONE if self._newest else 0
        self.delay = max(min(self._before, self._newest), min(self._newest, taken), alone) / NS
        if now - self._sent >= CHANGE_RESEND_PERIOD and taken < RESEND_TIMEOUT_NS:
            self._send(now)

    def _send(self, now: Time) -> None:
        self._sent = now
        lines: tuple[Line, ...] = self._write if self._asks_for else (ctrl(RESET_ACKNOWLEDGE),)
        self._post(*lines)
