"""Reads from the folder of an earlier run what is needed to repeat it: its request, commands and
inputs."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

from kybflow.core.errors import FileError
from kybflow.core.files import read_all
from kybflow.core.signals import NS
from kybflow.dsl.reading.reader import PROVENANCE
from kybflow.inputs.rows import parse
from kybflow.recording.run_folder import EVENTS, INPUTS, RunFolderError, whole_lines
from kybflow.runtime.commanding.command_queue import RecordedCommand
from kybflow.runtime.commanding.orders import SCHEDULE


class EarlierRun(NamedTuple):
    """The settings and inputs of an earlier run.

    sets: as on the command line. options: changed options, as (name, value). emits: scheduled
    events, as (seconds, name). commands: in order of arrival, without those scheduled before the
    run. inputs: the recorded table of each input. parts: the files of --parts, with the SHA-256 of
    each.
    """

    target: str
    seed: int
    sets: tuple[str, ...]
    options: tuple[tuple[str, str], ...]
    emits: tuple[tuple[float, str], ...]
    commands: tuple[RecordedCommand, ...]
    inputs: dict[str, str]
    parts: tuple[tuple[Path, str], ...]

    def missing_parts(self, given: Iterable[str]) -> str:
        """Return the `--parts` that are missing, a line each. given: the names of the given
        files."""
        missing = [(file, digest) for file, digest in self.parts if file.name not in given]
        return "".join(f"\n  --parts {file} (SHA-256 {digest})" for file, digest in missing)


def read_earlier_run(folder: Path) -> EarlierRun:
    """Read the run in `folder`. Raises RunFolderError."""
    try:
        asked = json.loads(read_all(folder / PROVENANCE))
        events = [json.loads(line) for line in read_all(folder / EVENTS).decode().split("\n")[:-1]]
        given = [(e["t_s"], e["fields"]) for e in events if e["event"] == "command_given"]
        commands = tuple(
            RecordedCommand(
                round(of.get("heard_s", t) * NS), of["command"], of["by"], of.get("take", False)
            )
            for t, of in given
            if of["by"] != SCHEDULE
        )
        return EarlierRun(
            target=asked["target"],
            seed=asked["seed"],
            sets=tuple(asked["set"]),
            options=tuple(
                (name, value)
                for name, _, value in (text.partition("=") for text in asked["option"])
            ),
            emits=tuple(
                (float(time.removesuffix("s")), name)
                for name, _, time in (text.rpartition("@") for text in asked["emit"])
            ),
            commands=commands,
            inputs=dict(_tables(folder / INPUTS)),
            parts=tuple((Path(file["path"]), file["sha256"]) for file in asked.get("parts", ())),
        )
    except OSError as error:
        reason = f"`{error.filename}`: {error.strerror}"
        raise RunFolderError(f"`{folder}` is not a run that can be repeated: {reason}") from error
    except (ValueError, LookupError, TypeError, AttributeError) as error:
        reason = f"`{PROVENANCE}` or `{EVENTS}` is damaged"
        raise RunFolderError(f"`{folder}` can't be repeated: {reason}") from error


def _tables(folder: Path) -> Iterator[tuple[str, str]]:
    """Yield (input, table) for each table that has rows. Raises RunFolderError if a table can't be
    read."""
    for path in sorted(folder.glob("*.csv")):
        lines = whole_lines(path)
        try:
            if len(lines) > 1:
                parse("\n".join(lines))
                yield path.stem, "\n".join(lines)
        except FileError as error:
            raise RunFolderError(f"`{path}`, line {error.line}: {error}") from error
