"""The configuration of an emulated drone.

A value that belongs to a session, user or application can be written only with the current ids,
which the `custom:` values set. Common values need no ids. Read-only values can't be written.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from kybflow.drivers.ardrone.protocol.at import Ids

NO_ID = "00000000"
DEFAULTS: Mapping[str, str] = MappingProxyType(
    {
        "general:num_version_config": "1", "general:num_version_mb": "33",
        "general:num_version_soft": "2.4.8", "general:drone_serial": "XXXXXXXXXX",
        "general:ardrone_name": "kybflow", "general:flying_time": "0",
        "general:navdata_demo": "TRUE", "general:navdata_options": "65537",
        "general:com_watchdog": "2", "general:video_enable": "TRUE",
        "general:vision_enable": "TRUE", "general:vbat_min": "9000",
        "control:accs_offset": "{ 0 0 0 }", "control:control_level": "0",
        "control:euler_angle_max": "2.0943952e-01", "control:altitude_max": "3000",
        "control:altitude_min": "50", "control:control_trim_z": "0.0000000e+00",
        "control:control_iphone_tilt": "3.4906584e-01", "control:control_vz_max": "700",
        "control:control_yaw": "1.7453293e+00", "control:outdoor": "FALSE",
        "control:flight_without_shell": "FALSE", "control:autonomous_flight": "FALSE",
        "control:manual_trim": "FALSE", "control:flying_mode": "0",
        "control:hovering_range": "1000", "control:flight_anim": "0,0",
        "network:ssid_single_player": "ardrone2_emulated",
        "network:wifi_mode": "0", "network:owner_mac": "00:00:00:00:00:00",
        "pic:ultrasound_freq": "8", "pic:ultrasound_watchdog": "3", "pic:pic_version": "184877090",
        "video:video_codec": "129", "video:video_channel": "0", "video:bitrate": "1000",
        "leds:leds_anim": "0,0,0", "detect:enemy_colors": "1", "detect:detect_type": "3",
        "syslog:output": "7", "userbox:userbox_cmd": "0", "custom:application_id": NO_ID,
        "custom:application_desc": "Default application configuration",
        "custom:profile_id": NO_ID, "custom:profile_desc": ".Primary Profile",
        "custom:session_id": NO_ID, "custom:session_desc": "Session 00000000",
        "gps:latitude": "5.0000000000000000e+02", "gps:longitude": "5.0000000000000000e+02",
        "gps:altitude": "0.0000000000000000e+00",
    }
)  # fmt: skip
FIXED = ("general:num_version", "general:drone_serial", "general:vbat_min", "pic:pic_version")
"""Prefixes of read-only keys."""
SESSION = frozenset(
    {
        "general:navdata_options", "video:video_codec", "video:video_channel", "leds:leds_anim",
        "detect:detect_type", "control:flying_mode",
        "gps:latitude", "gps:longitude", "gps:altitude",
    }
)  # fmt: skip
IDS = ("custom:session_id", "custom:profile_id", "custom:application_id")


class EmulatedConfiguration:
    """The configuration values of one drone. refused: number of rejected writes."""

    def __init__(self) -> None:
        self.values = dict(DEFAULTS)
        self.refused = 0

    def write(self, key: str, value: str, ids: Ids | None) -> bool:
        """Set a value unless the write is rejected. Return whether the drone acknowledges the
        write."""
        key = key.lower()
        known = key in self.values and not key.startswith(FIXED)
        current = Ids(*(self.values[name] for name in IDS))
        is_owner = current in (ids, (NO_ID, NO_ID, NO_ID))
        if not known or (key in SESSION and not is_owner):
            self.refused += 1
            return known
        self.values[key] = value
        return True

    def number(self, key: str) -> float:
        """Return a value as a number; if it isn't one, return the default."""
        try:
            return float(self.values[key])
        except ValueError:
            return float(DEFAULTS[key])

    def truth(self, key: str) -> bool:
        return self.values[key].strip().upper() == "TRUE"
