"""Flies a record again and compares what is decided with what was decided.

A decision is an event, a setpoint or a command. The first one that differs ends what is claimed:
from then on the recorded measurements no longer show what would have happened.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Sequence
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kybflow.api.compare import fact
from kybflow.api.flight import RunRequest, fly
from kybflow.api.missions import compile_plan
from kybflow.api.replay.tape import Tape, TapeEnded
from kybflow.api.runs import Run, readable
from kybflow.core.errors import FileError
from kybflow.core.files import read_all
from kybflow.core.signals import NS, Event, Time
from kybflow.core.text import did_you_mean
from kybflow.dsl.plan import Plan
from kybflow.dsl.reading.reader import RESOLVED
from kybflow.parts import events as of
from kybflow.recording.earlier_run import read_earlier_run
from kybflow.recording.messages import TICK, Recording, Series, read_recording
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
_SLACK_S = 0.1
"""How long before the end of a run its last tick may be, s."""


class Difference(NamedTuple):
    """The first event, setpoint or command that differs. recorded, replayed: what happened; None if
    nothing happened then. A setpoint or a command is an event of that name here."""

    recorded: Event | None
    replayed: Event | None

    @property
    def time(self) -> float:
        """Seconds since the start of the run."""
        return min(event.time for event in self if event is not None) / NS


class Replayed(NamedTuple):
    """The result of a replay.

    until: the time up to which events, setpoints and commands agree with the record, s. events,
    transitions: how many agree. difference: the first one, or None. is_whole: whether the record
    goes to the end of its run; one that was cut short ends before. changed: whether the mission's
    files have changed since the run.
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
    chosen = mission or unchanged
    sets = earlier.sets if chosen else ()
    plan, _ = compile_plan(chosen or folder / RESOLVED, earlier.target, sets, parts)
    with readable(folder):
        log = read_recording(folder / LOG)
    _check(folder, plan, log)
    names = {event.name for event in _SEEN_OUTSIDE}
    outside: dict[str, list[Event]] = {}
    for event in recorded.events:
        if event.name in names:
            outside.setdefault(event.vehicle, []).append(event)
    comparison = _Comparison(recorded.events)
    tape = Tape(folder, log, outside, comparison.watch)
    with TemporaryDirectory(prefix="kybflow-replay-") as kept:
        request = RunRequest(
            seed=earlier.seed, out=Path(out or Path(kept) / "run"), options=earlier.options,
            emitted=earlier.emits, sets=earlier.sets, again=earlier.commands,
            inputs=earlier.inputs, tape=tape,
        )  # fmt: skip
        flown = fly(tape.plan(plan), request, [comparison.listen])
        if comparison.is_interrupted:
            raise KeyboardInterrupt
        again = read_recording(flown.folder / LOG, lambda topic: topic.endswith("/tick"))
        steered = _steered((log, recorded.events), (again, comparison.replayed))
    ended = tape.end / NS > recorded.summary.get("sim_time_s", math.inf) - _SLACK_S
    result = comparison.result(tape.end, steered, is_whole=ended)
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
    """Compares the events of a replay with those of the record as they happen. is_interrupted:
    whether somebody interrupted the replay. replayed: what happened in it."""

    def __init__(self, recorded: Iterable[Event]) -> None:
        events = [*recorded]
        self.is_interrupted = False
        self.replayed: list[Event] = []
        self._interrupts = sum(event.name == of.RunInterrupted.name for event in events)
        self._left = deque(event for event in events if event.name not in _NOT_COMPARED)
        self._same: list[Event] = []
        self._difference: Difference | None = None
        self._until: Time = 0

    def listen(self, event: Event) -> None:
        self.replayed.append(event)
        if event.name == of.RunInterrupted.name:
            self._interrupts -= 1
            self.is_interrupted = self._interrupts < 0
        if event.name in _NOT_COMPARED or self._difference is not None:
            return
        expected = self._left[0] if self._left else None
        # without the words that explain it, which may name what only the run could know
        if expected is not None and fact(expected, "reason") == fact(event, "reason"):
            self._same.append(self._left.popleft())
        else:
            self._difference = Difference(expected, event)

    def watch(self, now: Time) -> None:
        """Stop the replay if an event differed in the last tick, or did not happen."""
        if self._difference is None and self._left and self._left[0].time < now:
            self._difference = Difference(self._left[0], None)
        if self._difference is not None or self.is_interrupted:
            raise TapeEnded("a decision differs from the recorded one")
        self._until = now

    def result(self, end: Time, steered: Difference | None, *, is_whole: bool) -> Replayed:
        """Return the result. end: the time of the last recorded tick. steered: the first setpoint
        or command that differs."""
        difference = self._difference
        missing = next((event for event in self._left if event.time <= end), None)
        if difference is None and missing is not None:
            difference = Difference(missing, None)
        if steered is not None and (difference is None or steered.time < difference.time):
            difference = steered
        until = min(self._until, end) / NS if difference is None else difference.time
        same = [event for event in self._same if event.time / NS <= until]
        transitions = sum(event.name == of.BehaviorStarted.name for event in same)
        return Replayed(until, len(same), transitions, difference, is_whole)


def _steered(
    recorded: tuple[Recording, Sequence[Event]], replayed: tuple[Recording, Sequence[Event]]
) -> Difference | None:
    """Return the first setpoint or command that differs, as events: the vehicle's state with the
    line of the mission, and the first field that differs. Each is a recording and its events."""
    found: list[tuple[Time, int, str, str, int]] = []
    for vehicle in recorded[0].mission["vehicles"]:
        ours, theirs = (log[f"/{vehicle}/tick"].decoded(TICK) for log, _ in (recorded, replayed))
        for order, part in enumerate(("setpoint", "command")):
            differs = _bytes(ours, part, len(theirs.times)) != _bytes(theirs, part, len(ours.times))
            ticks = np.flatnonzero(differs.any(axis=1))
            if len(ticks):
                found.append((int(ours.times[ticks[0]]), order, vehicle, part, int(ticks[0])))
    if not found:
        return None
    _, _, vehicle, part, tick = min(found)
    logs = (recorded[0], replayed[0])
    rows = [log[f"/{vehicle}/tick"].decoded(TICK).values[part][tick] for log in logs]
    names = rows[0].dtype.names or ()
    field = next((name for name in names if rows[0][name].tobytes() != rows[1][name].tobytes()), "")
    sides = zip(rows, (recorded, replayed), strict=True)
    return Difference(*(_event(vehicle, part, field, tick, row, *side) for row, side in sides))


def _bytes(ticks: Series, part: str, most: int) -> NDArray[np.uint8]:
    rows = np.ascontiguousarray(ticks.values[part][:most])
    return rows.view(np.uint8).reshape(len(rows), TICK[part].itemsize)


def _event(
    vehicle: str,
    part: str,
    field: str,
    tick: int,
    row: Any,
    log: Recording,
    events: Sequence[Event],
) -> Event:
    time = int(log[f"/{vehicle}/tick"].times[tick])
    began = [e for e in events if e.name == of.BehaviorStarted.name and e.vehicle == vehicle]
    state = next((e for e in reversed(began) if e.time <= time), None)
    shown = " ".join(f"{number:.6g}" for number in np.atleast_1d(row[field]).tolist())
    fields = {"behavior": state.fields["behavior"] if state else "", field: shown}
    return Event(time, part, vehicle, fields, state.at if state else "")
