"""Groups and flows: their names, their phases, and phases that block forever: KYB190 to KYB197,
KYB240 and KYB454."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Literal, NamedTuple, get_args

from kybflow.core.text import did_you_mean
from kybflow.dsl.checks.case import WORDS, Case, taken_names, wrong_goal
from kybflow.dsl.checks.events import given_by_a_person
from kybflow.dsl.diagnostics import Diagnostic, Severity, Text
from kybflow.dsl.expressions import parse
from kybflow.dsl.names import BUILT_IN, unknown_vehicle
from kybflow.dsl.plan import END, FlowPlan, PhasePlan, Plan, TransitionPlan, VehiclePlan
from kybflow.dsl.reading.nodes import Scalar, entries_of, is_null, items_of


def flow_names(case: Case) -> Iterator[Diagnostic]:
    """KYB191: a flow has the name of a vehicle, a group or a reserved word, or a phase is
    called `end`."""
    plan = case.plan
    for flow in plan.flows:
        name = flow.name
        taken = taken_names(plan) | dict.fromkeys(WORDS, "a reserved word")
        if name in taken:
            message, hint = f"a flow can't be called `{name}`", "give it another name"
            yield Diagnostic("KYB191", message, flow.span, label=taken[name], help=hint)
        if END in flow.phases:
            message, hint = "a phase can't be called `end`", "`go: end` ends the flow"
            span = flow.phases[END].span
            yield Diagnostic("KYB191", message, span, label="a reserved word", help=hint)


def phase_targets(case: Case) -> Iterator[Diagnostic]:
    """KYB193: a phase addresses a vehicle or a group that does not exist, or gives a vehicle to a
    flow that does not exist."""
    plan = case.plan
    for flow, phase in phases(plan):
        for who, _ in (pair for key in ASKED for pair in goals_of(phase, key)):
            if not plan.members(who.text) and who.text not in plan.groups:
                yield _nobody(who, plan)
        for _, goal in goals_of(phase, "give"):
            if goal.text not in plan.flows_by_name:
                message = f"there is no flow `{goal.text}`"
                others = plan.flows_by_name.keys() - {flow.name, *plan.fleet, *plan.groups}
                hint = did_you_mean(goal.text, others) or "declare it under `flows`"
                yield Diagnostic("KYB193", message, goal.span, label="unknown", help=hint)
            elif goal.text == flow.name:
                message = f"`{goal.text}` can't give a vehicle to itself"
                hint = "give it to another flow, or remove it"
                yield Diagnostic("KYB193", message, goal.span, "already controls it", help=hint)


def _nobody(who: Text, plan: Plan) -> Diagnostic:
    """Return the finding for a name that is neither a vehicle nor a group. An inherited flow may
    need a group that the mission lacks."""
    finding = unknown_vehicle("KYB193", who, plan)
    if not who.span.used:
        return finding
    group = f"write `groups: {{{who.text}: [...]}}` in the mission: the vehicles that fly it"
    near = finding.help.startswith("did")
    message = f"there is no vehicle and no group `{who.text}`"
    return replace(finding, message=message, help=finding.help if near else group)


def phase_states(case: Case) -> Iterator[Diagnostic]:
    """KYB194: a phase runs a state that one of its vehicles does not have.

    A state is one of the vehicle's own behaviors or one of the built-in states `landed`, `brake`,
    `hover`, `auto_land` and `land_blind`. Only the failsafe enters `fault`.
    """
    for _, phase in phases(case.plan):
        for vehicle, _, state in assignments(case.plan, phase, "run"):
            finding = wrong_goal("KYB194", state, case.plan.fleet[vehicle])
            if finding is not None:
                yield finding


def phase_transitions(case: Case) -> Iterator[Diagnostic]:
    """KYB195: a transition of a phase, or `begin`, names a phase that the flow does not have."""
    for flow in case.plan.flows:
        begin = flow.text_of("begin")
        goals = [(flow.begin, flow.span if begin is None else begin.span)]
        for phase in flow.phases.values():
            goals += [(t.target, t.target_span) for t in phase.transitions if t.target != END]
        for goal, span in goals:
            if goal not in flow.phases:
                message = f"the flow `{flow.name}` has no phase `{goal}`"
                hint = did_you_mean(goal, [*flow.phases, END])
                yield Diagnostic("KYB195", message, span, label="unknown", help=hint)


def tries_for_ever(case: Case) -> Iterator[Diagnostic]:
    """KYB454: a phase that times out starts again, and so on forever (a warning)."""
    for _, phase in phases(case.plan):
        for transition in phase.transitions:
            if transition.cause == "within" and transition.target == phase.name != END:
                yield Diagnostic(
                    "KYB454",
                    f"`{phase.name}` repeats forever",
                    transition.target_span,
                    label="leads back to itself",
                    help="let it lead to a phase that lands all vehicles",
                    severity=Severity.WARNING,
                )


def unreachable_phases(case: Case) -> Iterator[Diagnostic]:
    """KYB196: no transition and no callback leads to a phase.

    Phases inherited through `like` are exempt: a template may offer more than one mission uses.
    Flows with a transition to an unknown phase are checked once that is corrected.
    """
    for flow in case.plan.flows:
        found = reached(case.plan, flow)
        for phase in flow.phases.values() if found <= {*flow.phases} else ():
            if phase.name not in found | {END} and not phase.inherited:
                message = f"the phase `{phase.name}` is never reached"
                hint = f"let another phase lead to it (`go: {phase.name}`), or remove it"
                label = "no transition leads here"
                yield Diagnostic("KYB196", message, phase.span, label=label, help=hint)


def barriers(case: Case) -> Iterator[Diagnostic]:
    """KYB197: a phase that waits for others can block forever.

    The awaited event or state may never come, for example because a vehicle fails. The phase
    therefore needs `within` and `otherwise`, or a transition that waits only for time. Two waits
    need no bound: a wait for a person (`operator.NAME` and `INPUT.BUTTON`), and a wait for the end
    of a flow that was given a vehicle, because that flow has its own bounds.
    """
    for flow, phase in phases(case.plan):
        bounded = any(
            t.after is not None and t.when is None and t.event is None for t in phase.transitions
        )
        own = [transition for transition in phase.transitions if not transition.since]
        waits = [a for a in own if not _may_wait(a, flow, case.plan)]
        if waits and not bounded:
            yield Diagnostic(
                "KYB197",
                f"the phase `{phase.name}` can block forever",
                phase.span,
                label="waits for others",
                notes=(
                    f"{waits[0].span.beside(phase.span)} waits for something that may never happen",
                ),
                help="add `within: 20 s` and `otherwise: PHASE`",
            )


def _may_wait(transition: TransitionPlan, flow: FlowPlan, plan: Plan) -> bool:
    """Return whether a phase may wait for this transition alone without a time limit."""
    if transition.event is None or transition.when is not None:
        return False
    given = {goal for phase in flow.phases.values() for goal in phase.give.values()}
    finished = {f"{name}.finished" for name in given & set(plan.flows_by_name)}
    return transition.event in finished or given_by_a_person(transition.event, plan)


def timeless_cycles(case: Case) -> Iterator[Diagnostic]:
    """KYB240: phases form a cycle in which no time passes: each continues `after: 0 s`."""
    for flow in case.plan.flows:
        told: set[str] = set()
        for name in flow.phases:
            cycle = _cycle(flow, name)
            if cycle and told.isdisjoint(cycle):
                told.update(cycle)
                yield Diagnostic(
                    "KYB240",
                    f"the flow `{flow.name}` runs in an endless cycle",
                    flow.phases[name].span,
                    label="no time passes here",
                    notes=("`" + "` → `".join([*cycle, cycle[0]]) + "`",),
                    help="let one of these phases wait for something",
                )


def _cycle(flow: FlowPlan, name: str) -> list[str]:
    """Return the phases that follow `name` without waiting and lead back to it; empty if they
    don't."""
    path = [name]
    while True:
        phase = flow.phases.get(path[-1])
        ahead = next(
            (
                transition.target
                for transition in (phase.transitions if phase else ())
                if transition.after == 0.0 and transition.when is None and transition.event is None
            ),
            None,
        )
        if ahead == name:
            return path
        if ahead is None or ahead in path:
            return []
        path.append(ahead)


def phase_conditions(case: Case) -> Iterator[Diagnostic]:
    """Every `when` of a phase must be a valid condition: KYB210 to KYB215."""
    scope = case.scopes.flow()
    for _, phase in phases(case.plan):
        for transition in phase.transitions:
            when = transition.text_of("when")
            if when is not None:
                yield from parse(when, scope)[1]


def groups(case: Case) -> Iterator[Diagnostic]:
    """KYB190: a group is invalid.

    Its name can't be that of a vehicle or a reserved word. It has at least one member, and
    each member is a vehicle of the mission, listed once.
    """
    plan = case.plan
    own_groups = plan.entry("groups")
    for name, entry in entries_of(own_groups and own_groups.value).items():
        span, own = entry.key.span, items_of(entry.value)
        if name in plan.fleet:
            message = f"`{name}` is the name of a vehicle and of a group"
            yield Diagnostic("KYB190", message, span, help="give the group another name")
        elif name in WORDS:
            message, hint = f"a group can't be called `{name}`", "give it another name"
            yield Diagnostic("KYB190", message, span, label="a reserved word", help=hint)
        if not own:
            message = f"the group `{name}` is empty"
            yield Diagnostic("KYB190", message, span, help="list a vehicle, or remove the group")
        members = [item.as_text for item in own if isinstance(item, Scalar)]
        yield from _members(name, members, plan)


def _members(group: str, members: list[Text], plan: Plan) -> Iterator[Diagnostic]:
    first: dict[str, Text] = {}
    for member in members:
        if member.text in first:
            message = f"`{member.text}` is twice in `{group}`"
            yield Diagnostic("KYB190", message, member.span, help="list it once")
        elif member.text not in plan.fleet:
            message, label = f"there is no vehicle `{member.text}`", "unknown"
            hint = did_you_mean(member.text, plan.fleet)
            if member.text in plan.groups:
                message = f"`{member.text}` is a group, and a group may contain only vehicles"
                label, hint = "", "list each of its vehicles"
            yield Diagnostic("KYB190", message, member.span, label=label, help=hint)
        first.setdefault(member.text, member)


Asked = Literal["run", "give"]
ASKED: tuple[Asked, ...] = get_args(Asked)
"""The keys of a phase that contain requests to vehicles."""


class Assignment(NamedTuple):
    """The request of a phase to one vehicle. who: the vehicle or group as written. goal: the state
    to enter, or the flow that receives the vehicle."""

    vehicle: str
    who: Text
    goal: Text


def phases(plan: Plan) -> Iterator[tuple[FlowPlan, PhasePlan]]:
    """Yield every phase of every flow."""
    for flow in plan.flows:
        for phase in flow.phases.values():
            yield flow, phase


def goals_of(phase: PhasePlan, key: Asked) -> Iterator[tuple[Text, Text]]:
    """Yield (vehicle or group, state or flow) for each entry of `run` or `give`."""
    for who, goal in phase.pairs(key):
        if not is_null(goal):
            keys = [entry.key for entry in entries_of(goal).values()]  # the values are below it
            name = keys[0] if keys else goal
            assert isinstance(name, Scalar)
            yield who, name.as_text


def assignments(plan: Plan, phase: PhasePlan, key: Asked) -> Iterator[Assignment]:
    """Yield a phase's requests under `run` or `give`, one per vehicle. Unknown names are
    skipped."""
    for who, goal in goals_of(phase, key):
        for vehicle in plan.members(who.text):
            yield Assignment(vehicle, who, goal)


def runs_of(case: Case, phase: PhasePlan) -> Mapping[str, str]:
    """Return the state or chain that a phase requests from each of its vehicles."""
    (runs,) = case.cached(_runs)
    return runs[id(phase)]


def _runs(case: Case) -> Iterator[dict[int, Mapping[str, str]]]:
    yield {
        id(phase): {v: r.state for who, r in phase.run.items() for v in case.plan.members(who)}
        for _, phase in phases(case.plan)
    }


def handovers(plan: Plan, phase: PhasePlan) -> Iterator[Assignment]:
    """Yield the requests under `give` of a phase whose flow exists, one per vehicle."""
    asked = assignments(plan, phase, "give")
    yield from (a for a in asked if a.goal.text in plan.flows_by_name)


def all_known(plan: Plan) -> bool:
    """Return whether every vehicle and state that phases request exists."""
    asked = [one for _, phase in phases(plan) for one in phase.run.items()]
    return all(
        bool(plan.members(who))
        and all(
            has_state(plan.fleet[name], request.state) or request.state in BUILT_IN
            for name in plan.members(who)
        )
        for who, request in asked
    )


def has_state(vehicle: VehiclePlan, state: str) -> bool:
    """Return whether a vehicle has its own state or chain with that name."""
    return vehicle.goal(state) in vehicle.states


def reached(plan: Plan, flow: FlowPlan) -> set[str]:
    """Return the phases reached from the first one, or from one that a callback enters."""
    waiting = [flow.begin]
    for action in (action for callback in plan.callbacks for action in callback.do):
        if action.name == "phase" and action.target in (None, flow.name):
            waiting += [action.value] if action.value in flow.phases else []
    found = set(waiting)
    while waiting:
        phase = flow.phases.get(waiting.pop())
        for transition in phase.transitions if phase else ():
            if transition.target not in found:
                found.add(transition.target)
                waiting.append(transition.target)
    return found - {END}
