"""One flow as it goes: its machine, and when it entered and left which phase."""

from __future__ import annotations

from typing import NamedTuple

from kybflow.core.signals import NS, Time
from kybflow.dsl.machine import FlowMachine
from kybflow.dsl.plan import FlowPlan, PhasePlan
from kybflow.runtime.scores import rounded


class Visit(NamedTuple):
    """One time that a phase was entered; `ended` is next, within, done, asked, operator or
    run_ended."""

    name: str
    start_s: float
    end_s: float | None = None
    ended: str | None = None


class Running:
    """One flow: `machine` is None before it begins and after it ended."""

    def __init__(self, plan: FlowPlan) -> None:
        self.plan = plan
        self.machine: FlowMachine | None = None
        self.entered: Time = 0
        self.visits: list[Visit] = []

    @property
    def phase(self) -> PhasePlan:
        assert self.machine is not None
        return self.plan.phases[self.machine.state]

    def arrived(self, now: Time) -> None:
        self.entered = now
        self.visits.append(Visit(self.phase.name, rounded(now / NS)))

    def left(self, how: str, now: Time) -> None:
        self.visits[-1] = self.visits[-1]._replace(end_s=rounded(now / NS), ended=how)

    def wait(self, dt: float) -> None:
        """A tick in which its time stands still."""
        self.entered += round(dt * NS)
