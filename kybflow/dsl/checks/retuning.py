"""What processors give other values, of the vehicle's tracker: KYB535."""

from __future__ import annotations

from collections.abc import Iterator

from kybflow.core.params import Field
from kybflow.dsl.checks.case import Case
from kybflow.dsl.diagnostics.diagnostic import Diagnostic


def not_of_the_tracker(case: Case) -> Iterator[Diagnostic]:
    """KYB535: a processor retunes an option that the vehicle's tracker doesn't have, or that no
    flight changes.

    A processor declares which options of a tracker it retunes. On another target the vehicle may
    have another tracker.
    """
    for vehicle in case.plan.vehicles:
        tracker = vehicle.tracker
        for processor in vehicle.processors:
            for option in sorted(processor.cls.retunes):
                if _is_tunable(option, tracker.fields):
                    continue
                fitting = _trackers_with(case, option)
                yield Diagnostic(
                    "KYB535",
                    f"`{processor.name}` can't retune `{tracker.name}`",
                    processor.span,
                    label=f"`{tracker.name}` has no `{option}` that changes in flight",
                    help=f"use {fitting}, or leave it out" if fitting else "leave it out",
                )


def _is_tunable(option: str, fields: tuple[Field, ...]) -> bool:
    return any(field.name == option and not field.read_only for field in fields)


def _trackers_with(case: Case, option: str) -> str:
    """The trackers with such an option, in words."""
    known = case.parts("trackers")
    return " or ".join(f"`{spec.name}`" for spec in known if _is_tunable(option, spec.fields))
