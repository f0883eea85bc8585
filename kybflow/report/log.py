"""Reads a recording for the report: battery reports, estimators, and ticks at the same rate."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mcap.exceptions import EndOfFile
from mcap.records import Channel, Message, Metadata
from mcap.stream_reader import StreamReader

from kybflow.recording.layout import METADATA, kept_every


@dataclass(frozen=True)
class Log:
    """What is kept of a recording. mission: what its head says. messages: the kept ones, by topic.
    seen: the ticks of each topic, last: its newest log time, both kept or not."""

    mission: dict[str, Any]
    messages: dict[str, list[Message]] = field(default_factory=dict)
    seen: dict[str, int] = field(default_factory=dict)
    last: dict[str, int] = field(default_factory=dict)


def read_log(path: Path) -> Log:
    """The recording at `path`, as far as it goes. Raises OSError, ValueError or McapError for a
    file that is no recording of a run."""
    mission: dict[str, Any] = {}
    topics: dict[int, str] = {}
    log = Log(mission)
    with path.open("rb") as file:
        try:
            for record in StreamReader(file).records:
                if isinstance(record, Message):
                    _keep(log, topics[record.channel_id], record)
                elif isinstance(record, Channel):
                    topics[record.id] = record.topic
                elif isinstance(record, Metadata) and record.name == METADATA:
                    mission.update(json.loads(record.metadata["plan"]))
        except EndOfFile:
            pass  # the run was killed, or is still going on
    if not mission:
        raise ValueError(f"`{path.name}` says nothing of a mission")
    return log


def _keep(log: Log, topic: str, message: Message) -> None:
    """Keep battery reports and estimators, and ticks at the rate of the report."""
    log.last[topic] = message.log_time
    if topic.endswith("/battery") or "/estimator/" in topic:
        log.messages.setdefault(topic, []).append(message)
    elif topic.endswith("/tick"):
        seen = log.seen[topic] = log.seen.get(topic, 0) + 1
        if (seen - 1) % kept_every(log.mission["control_rate"]) == 0:
            log.messages.setdefault(topic, []).append(message)
