"""`kybflow replay`."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Argument, Exit, Option

from kybflow.cli import arguments
from kybflow.cli.output import echo
from kybflow.core.errors import FAILED, INVALID, KybflowError

if TYPE_CHECKING:
    from kybflow.api.replay.replay import Replayed
    from kybflow.core.signals import Event


def command(
    run: Annotated[Path, Argument(help="The run folder.")],
    *,
    mission: Annotated[
        Path | None, Option(help="An edited mission that decides instead of the recorded one.")
    ] = None,
    parts: arguments.Parts,
    out: Annotated[
        Path | None, Option(help="Keep the record of the replay in this new folder.")
    ] = None,
) -> None:
    """Fly the measurements of a run again and show the first decision that differs.

    Nothing is sent to any vehicle, and no simulator runs: estimators, transitions, behaviors,
    processors and trackers decide anew on what was measured in the run, in simulation or in a
    laboratory. With an edited mission, this shows what the edit would have changed first. There the
    replay ends, because the record doesn't show what would have happened then.

    \b
    Exit codes:
    0: everything was decided as in the run.
    1: a decision differs, or the run can't be read.
    2: the mission is invalid.

    \b
    Examples:
      kybflow replay runs/fallback-1
      kybflow replay runs/fallback-1 --mission edited.yaml
    """
    from kybflow.api.missions import MissionInvalid
    from kybflow.api.replay.replay import replay
    from kybflow.cli.commands.run import warn_of_changed
    from kybflow.recording.earlier_run import read_earlier_run

    with arguments.failing(FAILED, KybflowError), arguments.failing(INVALID, MissionInvalid):
        warn_of_changed(read_earlier_run(run), parts)
        replayed = replay(run, mission=mission, parts=parts, out=out)
    for line in _told(replayed):
        echo(line)
    if replayed.difference is not None:
        raise Exit(FAILED)


def _told(replayed: Replayed) -> Iterator[str]:
    same = (
        f"every setpoint and command and {replayed.events} events, {replayed.transitions} of them "
        "transitions, as in the run"
    )
    difference = replayed.difference
    if difference is None:
        yield (
            f"{same}, to its end at {replayed.until:.2f} s"
            if replayed.is_whole
            else (f"{same}, to {replayed.until:.2f} s, where its record ends")
        )
        return
    yield f"{same}; the first difference is at {difference.time:.3f} s:"
    yield from _shown("in the run", difference.recorded, has_line=not replayed.changed)
    yield from _shown("in the replay", difference.replayed)
    yield "The record doesn't show what would have happened then."


def _shown(name: str, event: Event | None, *, has_line: bool = True) -> Iterator[str]:
    """Yield an event and, if it `has_line`, the line of the mission that caused it."""
    from kybflow.cli.printing.flights import sentence

    if event is None:
        yield f"{name}: nothing then"
        return
    yield f"{name}: {sentence(event).strip()}"
    file, _, line = event.at.rpartition(":")
    if file and has_line:
        with suppress(OSError, ValueError, IndexError):  # the file isn't there any more
            text = Path(file).read_text(encoding="utf-8").splitlines()[int(line) - 1]
            yield f"    {line} | {text.strip()}"
