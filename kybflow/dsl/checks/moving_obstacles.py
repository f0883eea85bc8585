"""Obstacles that move, and what sees where they are: KYB511 and KYB547."""

from __future__ import annotations

from collections.abc import Iterator

from kybflow.dsl.checks.case import Case
from kybflow.dsl.diagnostics.diagnostic import Diagnostic


def unseen_when_real(case: Case) -> Iterator[Diagnostic]:
    """KYB511: an obstacle moves, the target's vehicles are real, and none has a sensor that could
    tell where it is: motion capture."""
    if all(vehicle.driver.spec.cls.simulated for vehicle in case.vehicles()):
        return
    for moving in case.document.moving:
        if moving.seen_by(case.vehicles()) is None:
            yield Diagnostic(
                "KYB511",
                f"nothing sees where `{moving.name.text}` is",
                moving.span,
                label="motion capture tracks no vehicle",
                help="give one the sensor `vrpn` or `motion_capture`, or fly a simulated target",
            )


def seen_as_another(case: Case) -> Iterator[Diagnostic]:
    """KYB547: an obstacle that moves has the body in motion capture of a vehicle, or of another
    obstacle: it would be where that one is."""
    taken: dict[str, str] = {}
    for vehicle in case.vehicles() if case.document.moving else ():
        for sensor in vehicle.sensors:
            claim = sensor.part.spec.cls.claim(sensor.part.params, vehicle.name.text)
            if claim is not None:
                taken.setdefault(claim.what, vehicle.name.text)
    for moving in case.document.moving:
        name, seen = moving.name.text, moving.seen_by(case.vehicles())
        claim = None if seen is None else seen[1].spec.cls.claim(seen[2], name)
        if claim is not None and taken.setdefault(claim.what, name) != name:
            yield Diagnostic(
                "KYB547",
                f"`{name}` has {claim.what}, as `{taken[claim.what]}` has",
                moving.span,
                help="give it its own `body`",
            )
