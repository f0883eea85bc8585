"""Flies a record again and compares what is decided with what was decided.

The first decision that differs ends the replay: from then on the recorded measurements no longer
show what would have happened.
"""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Iterable, Sequence
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from kybflow.api.flight import RunRequest, fly
from kybflow.api.missions import compile_plan
from kybflow.api.replay.tape import Tape, TapeEnded
from kybflow.api.runs import Run
from kybflow.core.errors import FileError
from kybflow.core.files import read_all
from kybflow.core.signals import NS, Event, Time
from kybflow.core.text import did_you_mean
from kybflow.dsl.plan import Plan
from kybflow.dsl.reading.reader import RESOLVED
from kybflow.parts import events as of
from kybflow.recording.earlier_run import read_earlier_run
from kybflow.recording.messages import Recording, read_recording
from kybflow.recording.run_folder import LOG, RunFolderError

_SEEN_OUTSIDE = (
    of.SensorFailed, of.SensorRecovered, of.MeasurementRefused, of.CameraFroze, of.CameraJumped,
    of.CameraLostEvent, of.CameraRecovered, of.CameraSwappedEvent, of.TagsFound, of.TagsLost,
    of.RunInterrupted,
)  # fmt: skip
"""What comes from images, devices and people, which a record doesn't contain. The replay repeats
these events."""
_OF_THE_COMPUTER = (
    of.RecordingStopped, of.ObserverFailed, of.CommandsFailed, of.RehearsalSkipped, of.TicksMissed,
    of.RunEnded, of.PreflightPassed,
)  # fmt: skip
"""Events about the computer or the record, which aren't decisions."""
_NOT_COMPARED = frozenset(event.name for event in (*_SEEN_OUTSIDE, *_OF_THE_COMPUTER))


class Difference(NamedTuple):
    """The first event that differs. recorded, replayed: what happened; None if nothing happened
    then."""

    recorded: Event | None
    replayed: Event | None

    @property
    def time(self) -> float:
        """Seconds since the start of the run."""
        return min(event.time for event in self if event is not None) / NS


class Replayed(NamedTuple):
    """The result of a replay.

    until: the time up to which it agrees with the record, s. events, transitions: how many agree.
    difference: the first one, or None. is_whole: whether the record goes to the end of its run; one
    that was cut short ends before. changed: whether the mission's files have changed since the run.
    """

    until: float
    events: int
    transitions: int
    difference: Difference | None
    is_whole: bool
    changed: bool = False


def replay(
    run: str | Path,
    *,
    mission: str | Path | None = None,
    parts: Sequence[str | Path] = (),
    out: str | Path | None = None,
) -> Replayed:
    """Fly the recorded measurements of a run again, without any device.

    mission: an edited mission that decides instead of the recorded one. parts: the files of the
    parts that the run was flown with. out: a new folder for the record of the replay; None keeps
    none. Raises RunFolderError if the run can't be read, MissionInvalid, PartError, RunUnwritten.
    """
    folder = Path(run)
    recorded, earlier = Run.load(folder), read_earlier_run(folder)
    if missing := earlier.missing_parts([Path(part).name for part in parts]):
        raise RunFolderError(f"`{folder}` was flown with parts that are not given:{missing}")
    unchanged = _unchanged(recorded)
    flown = mission or unchanged
    sets = earlier.sets if flown else ()
    plan, _ = compile_plan(flown or folder / RESOLVED, earlier.target, sets, parts)
    log = read_recording(folder / LOG)
    _check(folder, plan, log)
    names = {event.name for event in _SEEN_OUTSIDE}
    outside: dict[str, list[Event]] = {}
    for event in recorded.events:
        if event.name in names:
            outside.setdefault(event.vehicle, []).append(event)
    comparison = _Comparison(recorded.events)
    tape = Tape(log, outside, comparison.watch)
    with TemporaryDirectory(prefix="kybflow-replay-") as kept:
        request = RunRequest(
            seed=earlier.seed, out=Path(out or Path(kept) / "run"), options=earlier.options,
            emitted=earlier.emits, sets=earlier.sets, again=earlier.commands,
            inputs=earlier.inputs, tape=tape,
        )  # fmt: skip
        fly(tape.plan(plan), request, [comparison.listen])
    result = comparison.result(tape.end, is_whole=bool(recorded.summary))
    return result._replace(changed=unchanged is None)


def _check(folder: Path, plan: Plan, log: Recording) -> None:
    """Raise RunFolderError if the run can't be replayed with this plan."""
    unknown = [v.name for v in plan.vehicles if v.name not in log.mission["vehicles"]]
    if unknown:
        known = did_you_mean(unknown[0], log.mission["vehicles"])
        raise RunFolderError(f"the run `{folder}` has no vehicle `{unknown[0]}`; {known}")
    if not all(log[f"/{vehicle.name}/link"].sizes.size for vehicle in plan.vehicles):
        raise RunFolderError(
            f"`{folder}` can't be replayed: it was recorded by an earlier version of kybflow, "
            "which left out what the vehicles answered"
        )
    if plan.control_rate != log.mission["control_rate"]:
        raise RunFolderError(
            f"`{folder}` was flown at {log.mission['control_rate']} ticks a second, not at "
            f"{plan.control_rate}: the control rate of the mission must be that of the run"
        )


def _unchanged(run: Run) -> Path | None:
    """Return the mission that was flown, if its files still are what they were."""
    sources = run.provenance["sources"]
    try:
        known = [sha256(read_all(Path(of["path"]))).hexdigest() for of in sources]
    except (OSError, FileError):
        return None
    is_same = known == [of["sha256"] for of in sources]
    return Path(sources[0]["path"]) if is_same else None


class _Comparison:
    """Compares the events of a replay with those of the record."""

    def __init__(self, recorded: Iterable[Event]) -> None:
        self._left = deque(event for event in recorded if event.name not in _NOT_COMPARED)
        self._difference: Difference | None = None
        self._same = self._transitions = 0
        self._until: Time = 0

    def listen(self, event: Event) -> None:
        if event.name in _NOT_COMPARED or self._difference is not None:
            return
        expected = self._left[0] if self._left else None
        if expected is not None and _fact(expected) == _fact(event):
            self._left.popleft()
            self._same += 1
            self._transitions += event.name == of.BehaviorStarted.name
        else:
            self._difference = Difference(expected, event)

    def watch(self, now: Time) -> None:
        """Stop the replay if an event differed in the last tick, or did not happen."""
        if self._difference is None and self._left and self._left[0].time < now:
            self._difference = Difference(self._left[0], None)
        if self._difference is not None:
            raise TapeEnded("a decision differs from the recorded one")
        self._until = now

    def result(self, end: Time, *, is_whole: bool) -> Replayed:
        """Return the result. end: the time of the last recorded tick."""
        missing = next((event for event in self._left if event.time <= end), None)
        if self._difference is None and missing is not None:
            self._difference = Difference(missing, None)
        until = min(self._until, end) / NS
        return Replayed(until, self._same, self._transitions, self._difference, is_whole)


def _fact(event: Event) -> tuple[Any, ...]:
    """Return what happened; the words that explain it may name what only the run could know."""
    fields = {name: value for name, value in event.fields.items() if name != "reason"}
    return event.time, event.name, event.vehicle, json.dumps(fields, sort_keys=True)
