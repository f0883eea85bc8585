"""The actions of callbacks: KYB232 to KYB235, KYB553 and KYB554."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from kybflow.core.text import did_you_mean
from kybflow.dsl.checks.case import Case, wrong_goal
from kybflow.dsl.diagnostics import Collector, Diagnostic, Text
from kybflow.dsl.names import option_values, unknown_vehicle
from kybflow.dsl.plan import ActionKeys
from kybflow.dsl.reading.nodes import Node
from kybflow.dsl.reading.values import shown_value
from kybflow.parts import Act


def switches(case: Case) -> Iterator[Diagnostic]:
    """KYB232: an action addresses a vehicle or a group that does not exist, or requests a state
    that the vehicle does not have.

    A state is one of the vehicle's own behaviors or a built-in state. `fault` is excluded, because
    only the failsafe enters it. Whether the vehicle can enter the state is decided in flight; a
    refusal raises the event `switch_refused`.
    """
    for action in actions_of(case, "switch"):
        who, asked = action.target_text, action.value
        vehicles = case.plan.members(who.text)
        if not vehicles:
            yield unknown_vehicle("KYB232", who, case.plan)
        for name in vehicles:
            goal = Text(asked.state, asked.span)
            finding = wrong_goal("KYB232", goal, case.plan.fleet[name])
            if finding is not None:
                yield finding


def options(case: Case) -> Iterator[Diagnostic]:
    """KYB233: `set` names an option that does not exist, or one that can't change in flight.

    An option is written `VEHICLE.PART.PARAMETER` or `GROUP.PART.PARAMETER`, where the part is
    `processors.NAME`, `supervisors.NAME`, `estimators.NAME`, `behaviors.STATE` or `tracker`. The
    value must have the parameter's type and unit and lie within its bounds.
    """
    for name, value in sets_of(case):
        found = Collector()
        values = option_values(name, value, case.plan, case.catalog, found)
        yield from found.all
        fixed = next((o for o, _ in values if o.field.read_only or o.field.shape == "path"), None)
        if fixed is not None:
            yield Diagnostic(
                "KYB233",
                f"`{name.text}` can't change in flight",
                name.span,
                label="read-only" if fixed.field.read_only else "a path",
                help="set it where the part is declared",
            )


def loosened(case: Case) -> Iterator[Diagnostic]:
    """KYB234: `set` makes a safety parameter less strict than the mission declares it.

    In flight a safety parameter can only be tightened, so the change would always be refused.
    """
    for name, node in sets_of(case):
        for option, value in option_values(name, node, case.plan, case.catalog, Collector()):
            if option.field.loosens(option.declared, value):
                declared = shown_value(option.declared, option.field)
                yield Diagnostic(
                    "KYB234",
                    f"`{option.name}` is a safety parameter, and this loosens it",
                    node.span,
                    label=f"`{declared}` is stricter",
                    help="write the looser value where the part is declared, and tighten it here",
                )
                break


def switched_off(case: Case) -> Iterator[Diagnostic]:
    """KYB235: `enable` or `disable` names something that is not a processor, or a processor that
    keeps the vehicle safe.

    The name is `VEHICLE.processors.NAME` or `GROUP.processors.NAME`. Supervisors and safety
    processors, such as the fence, are always on.
    """
    for action in (*actions_of(case, "enable"), *actions_of(case, "disable")):
        name = action.value_text
        first, _, rest = name.text.partition(".")
        vehicles = case.plan.members(first)
        if not vehicles:
            yield unknown_vehicle("KYB235", name, case.plan, end=len(first))
        place = name.part(len(name.text) - len(rest), len(name.text))
        is_supervisor = rest.startswith("supervisors.")
        for vehicle in vehicles[:1] if is_supervisor else vehicles:
            processors = {use.label: use for use in case.plan.fleet[vehicle].processors}
            why, hint = "it keeps the vehicle safe", "tighten its parameters with `set` instead"
            if is_supervisor:
                why = "supervisors are always on"
            elif rest not in processors:
                message = f"`{vehicle}` has no processor `{rest}`"
                known = [p for p, use in processors.items() if not use.cls.safety]
                hint = did_you_mean(rest, known)
                yield Diagnostic("KYB235", message, place, label="unknown", help=hint)
                continue
            elif not processors[rest].cls.safety:
                continue
            message = f"`{name.text}` can't be switched off or on: {why}"
            yield Diagnostic("KYB235", message, place, help=hint)


def unknown_acts(case: Case) -> Iterator[Diagnostic]:
    """KYB553: `perform` addresses a vehicle or a group that does not exist, or names an act that no
    driver performs.

    An act of another driver is allowed: on this target it is refused in flight, with the event
    `perform_refused`.
    """
    for action in actions_of(case, "perform"):
        who, act = action.target_text, action.value_text
        vehicles = case.plan.members(who.text)
        if not vehicles:
            yield unknown_vehicle("KYB553", who, case.plan)
        elif not any(act.text in _acts_of(case, vehicle) for vehicle in vehicles):
            drivers = (case.catalog.get("drivers", n) for n in case.catalog.names("drivers"))
            known = {name for driver in drivers for name in driver.cls.acts}
            if act.text not in known:
                message = f"no driver performs `{act.text}`"
                hint = did_you_mean(act.text, sorted(known))
                yield Diagnostic("KYB553", message, act.span, label="unknown", help=hint)


def acts_without_permission(case: Case) -> Iterator[Diagnostic]:
    """KYB554: `perform` requests an act that the vehicle's driver performs only when one of its
    parameters allows it."""
    for action in actions_of(case, "perform"):
        act = action.value_text
        for vehicle in case.plan.members(action.target_text.text):
            driver = case.plan.fleet[vehicle].driver
            found = _acts_of(case, vehicle).get(act.text)
            needs = None if found is None else found.needs
            if needs is not None and not getattr(driver.params, needs):
                yield Diagnostic(
                    "KYB554",
                    f"the driver of `{vehicle}` performs `{act.text}` only with `{needs}: true`",
                    act.span,
                    help=f"add `{needs}: true` to `{driver.name}`",
                )


def _acts_of(case: Case, vehicle: str) -> Mapping[str, Act]:
    acts: Mapping[str, Act] = case.plan.fleet[vehicle].driver.cls.acts
    return acts


def actions_of(case: Case, name: str) -> Iterator[ActionKeys]:
    """Yield the actions named `name` of all callbacks."""
    for callback in case.plan.callbacks:
        yield from (action for action in callback.do if action.name == name)


def sets_of(case: Case) -> Iterator[tuple[Text, Node]]:
    """Yield (name, value) for every option that a callback or a phase sets."""
    for action in actions_of(case, "set"):
        yield action.target_text, action.value_node
    for flow in case.plan.flows:
        for phase in flow.phases.values():
            yield from phase.pairs("set")
