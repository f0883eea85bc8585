"""Whether anything keeps the vehicles in the room: KYB321 and KYB322."""

from __future__ import annotations

from collections.abc import Iterator

from kybflow.dsl.checks.case import Case
from kybflow.dsl.diagnostics.diagnostic import Diagnostic, Severity
from kybflow.dsl.document import State
from kybflow.parts import AIR


def unfenced(case: Case) -> Iterator[Diagnostic]:
    """KYB321: there is a fence, but no processor of a vehicle keeps its setpoints inside; the
    supervisor lands it only when it is outside."""
    fence = case.document.fence
    for vehicle in case.vehicles() if fence is not None else ():
        boxes = (p.spec.cls.keeps_inside(p.params, fence) for p in vehicle.processors)
        if any(box is not None for box in boxes):
            continue
        yield Diagnostic(
            "KYB321",
            f"no processor keeps `{vehicle.name.text}` inside the fence",
            vehicle.name.span,
            label="lands only when it is outside",
            help="add `fence` to its processors",
            severity=Severity.WARNING,
        )


def without_a_fence(case: Case) -> Iterator[Diagnostic]:
    """KYB322: the mission has no fence, so that neither the supervisor nor the processor `fence`
    keeps a vehicle that flies anywhere. It is told once, for the first of them.

    Where the world itself ends no flight, outdoors, it still tells the failsafe when to land.
    """
    if case.document.fence is not None:
        return
    flying = [v for v in case.vehicles() if any(map(_flies, v.states.values()))]
    if flying:
        others = ", ".join(f"`{v.name.text}`" for v in flying[1:])
        yield Diagnostic(
            "KYB322",
            f"nothing keeps `{flying[0].name.text}` in the room: the mission has no fence",
            flying[0].name.span,
            label="may fly anywhere",
            notes=(f"nor {others}",) if others else (),
            help="under `world`, write its bounds: `fence: {from: [-2, -2, 0], to: [2, 2, 2.5]}`",
            severity=Severity.WARNING,
        )


def _flies(state: State) -> bool:
    return any(AIR in leg for leg in state.part.spec.cls.flight)
