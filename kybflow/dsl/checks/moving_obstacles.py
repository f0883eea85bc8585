"""Moving obstacles and the sensors that track them: KYB511 and KYB547."""

from __future__ import annotations

from collections.abc import Iterator

from kybflow.dsl.checks.case import Case
from kybflow.dsl.diagnostics.diagnostic import Diagnostic
from kybflow.dsl.world import Obstacle


def unseen_when_real(case: Case) -> Iterator[Diagnostic]:
    """KYB511: an obstacle moves, but the target's vehicles are real and none has a motion-capture
    sensor that could track it."""
    if all(vehicle.driver.cls.simulated for vehicle in case.plan.vehicles):
        return
    for moving in _moving(case):
        if case.plan.tracked_by(moving.name) is None:
            yield Diagnostic(
                "KYB511",
                f"nothing tracks `{moving.name}`",
                moving.span,
                label="no vehicle uses motion capture",
                help=f"give a vehicle the sensor {_real(case)}, or fly on a simulated target",
            )


def _moving(case: Case) -> list[Obstacle]:
    return [one for one in case.plan.world.obstacles if one.moving_sphere is not None]


def _real(case: Case) -> str:
    """Return the names of the real sensors that track bodies, as text."""
    known = (spec for spec in case.parts("sensors") if not spec.cls.simulated)
    return " or ".join(f"`{spec.name}`" for spec in known if spec.cls.tracks_bodies)


def seen_as_another(case: Case) -> Iterator[Diagnostic]:
    """KYB547: a moving obstacle has the motion-capture body of a vehicle or of another obstacle, so
    its position would be theirs."""
    taken: dict[str, str] = {}
    for vehicle in case.plan.vehicles if case.plan.moving else ():
        for sensor in vehicle.sensors:
            claim = sensor.part.cls.claim(sensor.part.params, vehicle.name)
            if claim is not None:
                taken.setdefault(claim.what, vehicle.name)
    for moving in _moving(case):
        name, by = moving.name, case.plan.tracked_by(moving.name)
        claim = None if by is None else by[1].cls.claim(by[2], name)
        if claim is not None and taken.setdefault(claim.what, name) != name:
            yield Diagnostic(
                "KYB547",
                f"`{name}` and `{taken[claim.what]}` both have {claim.what}",
                moving.span,
                help="give it its own `body`",
            )
