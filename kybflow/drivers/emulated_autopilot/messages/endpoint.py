"""The connection of an emulated autopilot to its MAVLink channels."""

from __future__ import annotations

import random
from typing import Any

from kybflow.core.signals import Measurement, Time
from kybflow.drivers.emulated_autopilot.autopilot import OnboardAutopilot
from kybflow.drivers.emulated_autopilot.messages.channel import Channel
from kybflow.drivers.emulated_autopilot.messages.handlers import MessageHandlers
from kybflow.drivers.emulated_autopilot.messages.telemetry import MAKERS
from kybflow.drivers.mavlink.protocol.framing import mavlink
from kybflow.drivers.mavlink.transport.wire import Wire

CHUNK = 50
"""The bytes of text in a STATUSTEXT."""


class MavlinkEndpoint:
    """One autopilot and its channels. generator: draws which messages are lost."""

    def __init__(self, autopilot: OnboardAutopilot, generator: random.Random) -> None:
        self.autopilot, self.failures = autopilot, autopilot.failures
        self._generator = generator
        self._channels: list[tuple[Channel, MessageHandlers]] = []
        self._text_id = 0
        autopilot.on_mode_change = self._send_mode

    def connect(self, wire: Wire, key: bytes | None = None) -> Channel:
        """Add a wire and return its channel. key: the secret key of signed messages."""
        streams = {"HEARTBEAT": 1.0, **self.autopilot.firmware.streams}
        system = self.autopilot.system
        channel = Channel(wire, system, key, streams, self.failures, self._generator)
        self._channels.append((channel, MessageHandlers(self.autopilot, channel)))
        return channel

    def add_measurement(self, measured: Measurement, now: Time) -> None:
        """Handle a measurement of the vehicle's own sensors."""
        self.autopilot.add_measurement(measured, now)

    def step(self, now: Time) -> None:
        """Handle messages, estimate, fly, and report. Must be called at least fifty times a
        second."""
        self.autopilot.now = now
        for channel, handlers in self._channels:
            for message in channel.receive(now):
                handlers.handle(message)
                if message.get_type() == "HEARTBEAT" and len(self._channels) > 1:
                    self._forward(message, channel)
        self.autopilot.step(now)
        self._report(now)

    def _forward(self, message: Any, heard: Channel) -> None:
        """Forward a heartbeat to the other channels, as both firmwares do."""
        for channel, _ in self._channels:
            if channel is not heard:
                channel.forward(message)

    def _send_mode(self) -> None:
        for channel, _ in self._channels:
            for name in self.autopilot.firmware.mode_messages:
                channel.send(MAKERS[name](self.autopilot))

    def _report(self, now: Time) -> None:
        texts, self.autopilot.texts = self.autopilot.texts, []
        for words, severity in texts:
            self._send_text(words, severity, now)
        for channel, _ in self._channels:
            for name in channel.due(now):
                message = MAKERS[name](self.autopilot)
                if message is not None:
                    channel.send(message)

    def _send_text(self, words: str, severity: int, now: Time) -> None:
        """Send a text in chunks, on the channels to which the firmware sends texts."""
        firmware = self.autopilot.firmware
        data = (words + firmware.text_end).encode()
        chunks = [data[at : at + CHUNK] for at in range(0, len(data), CHUNK)]
        self._text_id = self._text_id % 0xFFFF + 1
        number = self._text_id if len(chunks) > 1 else 0
        for channel, _ in self._channels:
            if firmware.speaks_to_all or channel.has_station(now):
                for place, chunk in enumerate(chunks):
                    channel.send(mavlink.MAVLink_statustext_message(severity, chunk, number, place))
