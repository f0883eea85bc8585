"""Both directions of one MAVLink connection, as the tests' own end of a wire has them."""

from __future__ import annotations

from kybflow.drivers.mavlink.protocol.framing import ONBOARD, Message, Packer, Parser
from kybflow.drivers.mavlink.protocol.signing import Signing


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
