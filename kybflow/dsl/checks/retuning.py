"""Tracker options that processors change in flight: KYB535."""

from __future__ import annotations

from collections.abc import Iterator

from kybflow.core.params import Field
from kybflow.dsl.checks.case import Case
from kybflow.dsl.diagnostics import Diagnostic


def not_of_the_tracker(case: Case) -> Iterator[Diagnostic]:
    """KYB535: a processor retunes an option that the vehicle's tracker doesn't have or that can't
    change in flight.

    A processor declares which options of a tracker it retunes. The vehicle may have another tracker
    on another target.
    """
    for vehicle in case.plan.vehicles:
        tracker = vehicle.tracker
        for processor in vehicle.processors:
            for option in sorted(processor.cls.retunes):
                if _is_tunable(option, tracker.fields):
                    continue
                known = (t for t in case.parts("trackers") if _is_tunable(option, t.fields))
                fitting = " or ".join(f"`{tracker.name}`" for tracker in known)
                yield Diagnostic(
                    "KYB535",
                    f"`{processor.name}` can't retune `{tracker.name}`",
                    processor.span,
                    label=f"`{tracker.name}` has no `{option}` that can change in flight",
                    help=f"use {fitting}, or remove the processor"
                    if fitting
                    else "remove the processor",
                )


def _is_tunable(option: str, fields: tuple[Field, ...]) -> bool:
    return any(field.name == option and not field.read_only for field in fields)
