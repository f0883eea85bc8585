"""What lasted in a run, from the events that begin and end it: faults, holds, estimators."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from kybflow.report.data import Run

FAULT, HOLD, BLIND, FALLBACK = "fault at work", "hold", "no estimate", "fallback estimator"
TINTS = {
    FAULT: "rgba(209,73,91,0.26)",
    HOLD: "rgba(224,167,38,0.30)",
    BLIND: "rgba(120,40,140,0.30)",
    FALLBACK: "rgba(47,126,216,0.20)",
}
"""The colour of each kind; light enough to read a curve through it, on white and on black."""


@dataclass(frozen=True)
class Span:
    """Something of one vehicle from `start` to `end` seconds."""

    kind: str
    vehicle: str
    label: str
    start: float
    end: float


def spans(run: Run) -> list[Span]:
    """The faults, holds and estimators of each vehicle; what never ended lasts to the end of the
    run."""
    found: list[Span] = []
    for track in run.tracks:
        own = [event for event in run.events if event["vehicle"] == track.name]
        found += [*_faults(own, run.end), *_holds(own, run.end)]
    return found


def estimators(run: Run) -> dict[str, list[Span]]:
    """What each vehicle flew by: of the kind FALLBACK unless it is the first that it had."""
    found: dict[str, list[Span]] = {}
    for track in run.tracks:
        own = (event for event in run.events if event["vehicle"] == track.name)
        found[track.name] = list(_estimators(own, track.name, run.end))
    return found


def shaded(run: Run) -> list[Span]:
    """What is shaded behind a curve: everything but the estimator that all goes well with."""
    besides = [s for own in estimators(run).values() for s in own if s.kind in (BLIND, FALLBACK)]
    return sorted([*spans(run), *besides], key=lambda span: list(TINTS).index(span.kind))


def _faults(events: list[dict[str, Any]], end: float) -> Iterator[Span]:
    running: dict[tuple[str, str], list[float]] = {}
    for event in events:
        vehicle, fault = event["vehicle"], event["fields"].get("fault", "")
        key = (fault, event["at"])
        if event["event"] == "fault_injected":
            running.setdefault(key, []).append(event["t_s"])
        elif event["event"] == "fault_ended" and running.get(key):
            yield Span(FAULT, vehicle, fault, running[key].pop(0), event["t_s"])
    for (fault, _), starts in running.items():
        yield from (Span(FAULT, events[0]["vehicle"], fault, start, end) for start in starts)


def _holds(events: list[dict[str, Any]], end: float) -> Iterator[Span]:
    """Pauses and brakes. Leaving the behavior that was frozen ends a hold as well."""
    running: dict[str, float] = {}
    for event in events:
        name, time, fields = event["event"], event["t_s"], event["fields"]
        ended: list[str] = []
        if name == "paused":
            running.setdefault("paused", time)
        elif name == "failsafe_started" and fields.get("reaction") == "brake":
            running.setdefault("brake", time)
        elif name == "resumed":
            ended = ["paused"]
        elif name == "failsafe_ended" and fields.get("reaction") == "brake":
            ended = ["brake"]
        elif name == "behavior_ended":
            ended = list(running)
        for label in ended:
            start = running.pop(label, time)
            if time > start:
                yield Span(HOLD, event["vehicle"], label, start, time)
    for label, start in running.items():
        yield Span(HOLD, events[0]["vehicle"], label, start, end)


def _estimators(events: Iterator[dict[str, Any]], vehicle: str, end: float) -> Iterator[Span]:
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


def _used(vehicle: str, name: str, start: float, end: float, first: str) -> Span:
    kind = "estimator" if name == first else FALLBACK if name else BLIND
    return Span(kind, vehicle, name or BLIND, start, end)
