"""Tells notable events from routine, and finds the intervals of a run in its events: faults, holds,
clamps and estimators in use."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from kybflow.recording.appearance import IMPACTS
from kybflow.report.data import RecordedRun

BARS = frozenset({"behavior_started", "behavior_ended", "phase_started", "phase_ended"})
"""Events that the timeline shows as bars."""
_ROUTINE = BARS | {
    "run_started", "run_ended", "preflight_passed", "took_off", "landed", "driver_changed",
    "payload_loaded", "payload_released", "payload_rested",
}  # fmt: skip


def is_notable(event: Mapping[str, Any]) -> bool:
    """Return whether an event is more than a normal step of a flight."""
    if event["event"] == "estimator_changed":
        return event["fields"].get("previous") is not None
    return event["event"] not in _ROUTINE and not event["event"].endswith(".finished")


def impact_text(event: Mapping[str, Any]) -> str:
    fields = event["fields"]
    if event["event"] == "collided":
        return f"ran into {fields.get('into')}"
    return f"landed hard ({fields['speed']:.2f} m/s) on {fields['onto']}"


_FINAL = {"ground": "on the ground", "air": "in the air", "unknown": "not heard at the end"}


def ending(run: RecordedRun, name: str) -> str:
    """Describe how a vehicle's run ended: in the air or on the ground, any fault, and what it
    hit."""
    vehicle = run.summary["vehicles"][name]
    visits = vehicle["behaviors"]
    last = visits[-1] if visits else None
    own = [event for event in run.events if event["vehicle"] == name]
    parts = [_FINAL[vehicle["final"]]]
    if last is not None and last["name"] == "fault":
        # the reason of the last failsafe that ended the flight, or else of the last failure
        before = [event for event in own if event["t_s"] <= last["start_s"]]
        stopped = [
            event["fields"]["reason"]
            for event in before
            if event["event"] == "failsafe_started" and event["fields"].get("reaction") != "brake"
        ]
        failed = [e["fields"]["reason"] for e in before if e["event"].endswith("_failed")]
        reason = (stopped or failed or [""])[-1]
        parts.append(f"in fault: {reason}" if reason else "in fault")
    parts += [
        f"{impact_text(event)} at {event['t_s']:.2f} s"
        for event in own
        if event["event"] in IMPACTS
    ]
    return ", ".join(parts)


FAULT, HOLD, CLAMP = "fault at work", "hold", "clamped setpoint"
BLIND, FALLBACK = "no estimate", "fallback estimator"
TINTS = {
    FAULT: "rgba(209,73,91,0.26)",
    HOLD: "rgba(224,167,38,0.30)",
    CLAMP: "rgba(52,140,86,0.26)",
    BLIND: "rgba(120,40,140,0.30)",
    FALLBACK: "rgba(47,126,216,0.20)",
}
"""The colour of each kind, light enough for curves on top of it in both themes."""


@dataclass(frozen=True)
class Interval:
    """An interval in a vehicle's flight, from `start` to `end`, s."""

    kind: str
    vehicle: str
    label: str
    start: float
    end: float


def faults_and_holds(run: RecordedRun) -> list[Interval]:
    """Return the faults, holds and clamps of each vehicle. An interval without an end lasts until
    the run ends."""
    found: list[Interval] = []
    for track in run.tracks:
        own = [event for event in run.events if event["vehicle"] == track.name]
        lasting = _lasting(own, track.name, run.end)
        found += sorted(lasting, key=lambda i: (FAULT, HOLD, CLAMP).index(i.kind))
    return found


def estimators_in_use(run: RecordedRun) -> dict[str, list[Interval]]:
    """Return the intervals in which each vehicle flew on each estimator, by vehicle. Their kind is
    FALLBACK for all estimators but the first, and BLIND while there was no estimate."""
    found: dict[str, list[Interval]] = {}
    for track in run.tracks:
        own = (event for event in run.events if event["vehicle"] == track.name)
        found[track.name] = list(_estimators(own, track.name, run.end))
    return found


def shaded(run: RecordedRun) -> list[Interval]:
    """Return the intervals to shade behind curves: all except the use of the first estimator."""
    used = [interval for own in estimators_in_use(run).values() for interval in own]
    besides = [interval for interval in used if interval.kind in (BLIND, FALLBACK)]
    order = list(TINTS)
    return sorted([*faults_and_holds(run), *besides], key=lambda i: order.index(i.kind))


_BEGINS = {
    "fault_injected": FAULT,
    "clamp_started": CLAMP,
    "paused": HOLD,
    "failsafe_started": HOLD,
}
_ENDS = {"fault_ended": FAULT, "clamp_ended": CLAMP, "resumed": HOLD, "failsafe_ended": HOLD}


def _lasting(events: list[dict[str, Any]], vehicle: str, end: float) -> Iterator[Interval]:
    """Yield the faults, the clamps, and the holds, which pauses and brakes cause. A hold also ends
    when the behavior ends that it interrupts."""
    running: dict[tuple[str, str, str], list[float]] = {}
    for event in events:
        name, time, fields = event["event"], event["t_s"], event["fields"]
        is_failsafe = name.startswith("failsafe_")
        if is_failsafe and fields.get("reaction") != "brake":
            continue
        kind = _BEGINS.get(name) or _ENDS.get(name, "")
        key = (kind, "brake" if is_failsafe else "paused", "")
        if kind == FAULT:  # the same fault may have several causes at once
            key = (kind, fields.get("fault", ""), event["at"])
        elif kind == CLAMP:
            key = (kind, fields.get("processor", ""), "")
        ended = [key] if name in _ENDS else []
        if name == "behavior_ended":
            ended = [one for one in running if one[0] == HOLD]
        elif name in _BEGINS and (kind == FAULT or not running.get(key)):
            running.setdefault(key, []).append(time)
        for one in (one for one in ended if running.get(one)):
            start = running[one].pop(0)
            if time > start or one[0] != HOLD:
                yield Interval(one[0], vehicle, one[1], start, time)
    for (kind, label, _), starts in running.items():
        yield from (Interval(kind, vehicle, label, start, end) for start in starts)


def _estimators(events: Iterator[dict[str, Any]], vehicle: str, end: float) -> Iterator[Interval]:
    first: str | None = None
    now: tuple[str, float] | None = None
    for event in events:
        if event["event"] not in ("estimator_changed", "estimator_lost"):
            continue
        name = event["fields"].get("estimator") or ""
        first = first or name
        if now is not None:
            yield _used(vehicle, *now, event["t_s"], first)
        now = (name, event["t_s"])
    if now is not None and first is not None:
        yield _used(vehicle, *now, end, first)


def _used(vehicle: str, name: str, start: float, end: float, first: str) -> Interval:
    kind = "estimator" if name == first else FALLBACK if name else BLIND
    return Interval(kind, vehicle, name or BLIND, start, end)
