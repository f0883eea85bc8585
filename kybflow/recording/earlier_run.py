"""An earlier run, read from its folder to fly it again: what was asked for, and the commands that
were given while it flew."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from kybflow.core.errors import FileError
from kybflow.core.signals import NS
from kybflow.dsl.reading.folders import PROVENANCE
from kybflow.inputs.rows import parse
from kybflow.recording.growing_file import whole_lines
from kybflow.recording.run_folder import EVENTS, INPUTS, RunFolderError
from kybflow.runtime.commanding.command_queue import RecordedCommand
from kybflow.runtime.commanding.lease import SCHEDULE


class EarlierRun(NamedTuple):
    """sets, options, emits: as the command line takes them. commands: those that weren't scheduled
    when the run began, in the order in which they were heard. inputs: what each said, a table."""

    target: str
    seed: int
    sets: tuple[str, ...]
    options: tuple[str, ...]
    emits: tuple[str, ...]
    commands: tuple[RecordedCommand, ...]
    inputs: dict[str, str]


def read_earlier_run(folder: Path) -> EarlierRun:
    """Return the run in `folder`. Raises RunFolderError where its files can't be read."""
    try:
        asked = json.loads((folder / PROVENANCE).read_text(encoding="utf-8"))
        events = [json.loads(line) for line in whole_lines(folder / EVENTS)]
        return EarlierRun(
            target=asked["target"],
            seed=asked["seed"],
            sets=tuple(asked["set"]),
            options=tuple(asked["option"]),
            emits=tuple(asked["emit"]),
            commands=tuple(_command(e) for e in events if _is_command(e)),
            inputs=dict(_tables(folder / INPUTS)),
        )
    except OSError as error:
        reason = f"`{error.filename}`: {error.strerror}"
        raise RunFolderError(f"`{folder}` is no run that can be flown again: {reason}") from error
    except (ValueError, LookupError, TypeError, AttributeError) as error:
        reason = f"`{PROVENANCE}` or `{EVENTS}` is not as a run writes it"
        raise RunFolderError(f"`{folder}` can't be flown again: {reason}") from error


def _tables(folder: Path) -> Iterator[tuple[str, str]]:
    """Yield each input that said something, with its table. Raises RunFolderError where it is
    none."""
    for path in sorted(folder.glob("*.csv")):
        lines = whole_lines(path)
        try:
            if len(lines) > 1:
                parse("\n".join(lines))
                yield path.stem, "\n".join(lines)
        except FileError as error:
            raise RunFolderError(f"`{path}`, line {error.line}: {error}") from error


def _is_command(event: dict[str, Any]) -> bool:
    return bool(event["event"] == "command_given" and event["fields"]["by"] != SCHEDULE)


def _command(event: dict[str, Any]) -> RecordedCommand:
    fields = event["fields"]
    heard = round(fields.get("heard_s", event["t_s"]) * NS)
    return RecordedCommand(heard, fields["command"], fields["by"], fields.get("take", False))
