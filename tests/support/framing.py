"""Both directions of one MAVLink connection, as the tests' own end of a wire has them; the commands
and the results that both ends name."""

from __future__ import annotations

from pymavlink.dialects.v20 import all as mavlink

from kybflow.drivers.mavlink.protocol.framing import ONBOARD, Message, Packer, Parser
from kybflow.drivers.mavlink.protocol.signing import Signing

SET_MODE, ARM = mavlink.MAV_CMD_DO_SET_MODE, mavlink.MAV_CMD_COMPONENT_ARM_DISARM
TAKEOFF = mavlink.MAV_CMD_NAV_TAKEOFF
SERVO, GRIPPER = mavlink.MAV_CMD_DO_SET_SERVO, mavlink.MAV_CMD_DO_GRIPPER
INTERVAL, REQUEST = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAV_CMD_REQUEST_MESSAGE
ACCEPTED, REJECTED = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_TEMPORARILY_REJECTED
UNSUPPORTED, FAILED = mavlink.MAV_RESULT_UNSUPPORTED, mavlink.MAV_RESULT_FAILED

PX4_HEARTBEAT = mavlink.MAVLink_heartbeat_message(
    mavlink.MAV_TYPE_QUADROTOR, mavlink.MAV_AUTOPILOT_PX4, 81, 0, mavlink.MAV_STATE_ACTIVE, 3
)


class Framing:
    """Both directions of one connection. key: the secret of signed messages."""

    def __init__(self, system: int, component: int = ONBOARD, key: bytes | None = None) -> None:
        signing = None if key is None else Signing(key)
        self._parser, self._packer = Parser(signing), Packer(system, signing)
        self._component = component
        self.counts = self._parser.counts
        self.parse = self._parser.parse

    def pack(self, message: Message, component: int | None = None) -> bytes:
        """The frame of a message. Raises DriverError where a field does not fit."""
        return self._packer.pack(message, self._component if component is None else component)
