"""What `kybflow command state` prints: what a run does, and what a person may ask of it now."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import degrees
from typing import Any

_TO_VEHICLES = ("pause", "resume", "reset", "land")


def described(situation: Mapping[str, Any]) -> Iterator[str]:
    """The lines about a situation, given as its JSON."""
    holder = situation["holder"]
    commander = f"commanded by {holder}" if holder else "nobody holds the lease"
    flying = "" if situation["flying"] else ", preflight"
    yield f"{situation['mission']}   {situation['time']:.1f} s{flying}, {commander}"
    for vehicle in situation["vehicles"]:
        yield from _vehicle(vehicle)
    for flow in situation["flows"]:
        yield from _flow(flow)
    if emit := situation["emit"]:
        waits = (
            f"{name}{'' if now else ' (nothing waits for it now)'}" for name, now in emit.items()
        )
        yield f"events to emit: {', '.join(waits)}"


def _vehicle(vehicle: Mapping[str, Any]) -> Iterator[str]:
    facts = [_state(vehicle), vehicle["flight"]]
    if vehicle["battery"] is not None:
        facts.append(f"battery {vehicle['battery']:.0%}")
    yield f"{vehicle['name']}   {', '.join(facts)}"
    if (estimate := vehicle["estimate"]) is not None:
        where = ", ".join(f"{x:.2f}" for x in estimate["position"])
        heading = f"heading {degrees(estimate['heading']):.0f} deg"
        yield f"  at ({where}) m, {heading}, by {estimate['estimator'] or 'no estimator'}"
    yield from (f"  {line}" for line in _held(vehicle))
    yield from _entries(vehicle["enter"], "may enter")
    if vehicle["waits_for"]:
        yield f"  waits for {', '.join(vehicle['waits_for'])}"
    legal = [word for word in _TO_VEHICLES if vehicle[word] is None]
    yield f"  legal: {', '.join(legal) or 'nothing'}"
    for word in _TO_VEHICLES:
        if vehicle[word] is not None:
            yield f"  not `{word}`: {vehicle[word]}"


def _state(vehicle: Mapping[str, Any]) -> str:
    if not vehicle["state"]:
        return "not begun"
    return f"{vehicle['state']} ({vehicle['behavior']}) for {vehicle['elapsed']:.1f} s"


def _held(vehicle: Mapping[str, Any]) -> Iterator[str]:
    """Why a vehicle doesn't do what its state says."""
    if vehicle["holders"]:
        yield f"held by {', '.join(vehicle['holders'])}"
    if vehicle["braking"]:
        yield f"brakes: {vehicle['braking']}"
    if vehicle["latched"]:
        yield f"failsafe: {vehicle['latched']}, until a reset"
    if vehicle["override"]:
        yield f"somebody else has control: {vehicle['override']}"
    if vehicle["retired"]:
        yield f"lands for the rest of the run: {vehicle['retired']}"
    if vehicle["driver"]:
        yield f"driven by the flow {vehicle['driver']}"


def _flow(flow: Mapping[str, Any]) -> Iterator[str]:
    phase = f"{flow['phase']} for {flow['elapsed']:.1f} s" if flow["phase"] else "in no phase"
    yield f"{flow['name']}   {phase}, drives {', '.join(flow['vehicles']) or 'nothing'}"
    yield from _entries(flow["enter"], "may enter phase")
    if flow["waits_for"]:
        yield f"  waits for {', '.join(flow['waits_for'])}"


def _entries(enter: Mapping[str, str | None], what: str) -> Iterator[str]:
    """What may be entered, then the rest by the reason why not."""
    reasons: dict[str, list[str]] = {}
    for name, reason in enter.items():
        reasons.setdefault(reason or "", []).append(name)
    if legal := reasons.pop("", None):
        yield f"  {what} {', '.join(legal)}"
    for reason, names in reasons.items():
        yield f"  not {', '.join(f'`{name}`' for name in names)}: {reason}"
