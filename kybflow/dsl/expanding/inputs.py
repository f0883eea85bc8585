"""The inputs of a mission: each its own, or that of the chosen target in its place."""

from __future__ import annotations

from collections.abc import Mapping as MappingOf

from kybflow.core.text import did_you_mean
from kybflow.dsl.language.decode import Decoder
from kybflow.dsl.plan import InputPlan
from kybflow.dsl.reading.nodes import Mapping, MappingEntry, Node, Scalar, entries_of, is_null

CODES = {
    "KYB400": "A target replaces an input that the mission doesn't have, or a vehicle is called "
    "`inputs`, which a target needs for itself.",
}


def inputs_in(target: Node | None) -> MappingOf[str, MappingEntry]:
    """The inputs that a target has in place of the mission's, as they are written."""
    written = entries_of(target)
    return entries_of(written["inputs"].value) if "inputs" in written else {}


def inputs_of(root: Mapping, target: str, decoder: Decoder) -> tuple[InputPlan, ...]:
    """The inputs on a target; one with errors is left out."""
    own, targets = entries_of(root.get("inputs")), entries_of(root.get("targets"))
    _judge_names(own, entries_of(root.get("vehicles")), targets, decoder)
    replaced = inputs_in(targets[target].value) if target in targets else {}
    inputs: list[InputPlan] = []
    for name, entry in own.items():
        instead = replaced.get(name)
        is_own = instead is None or is_null(instead.value)
        value = entry.value if instead is None or is_own else instead.value
        one = None if is_null(value) else _input(entry.key, value, decoder)
        if one is not None:
            inputs.append(one)
        if instead is not None and not is_null(entry.value):  # judged too, though it isn't used
            _input(entry.key, entry.value, decoder)
    return tuple(inputs)


Entries = MappingOf[str, MappingEntry]


def _judge_names(own: Entries, vehicles: Entries, targets: Entries, decoder: Decoder) -> None:
    for entry in targets.values():
        for name, other in inputs_in(entry.value).items():
            if name not in own:
                hint = did_you_mean(name, own)
                hint = hint or f"write `inputs: {{{name}: {{use: ...}}}}` in it"
                message = f"the mission has no input `{name}`"
                decoder.found.report("KYB400", message, other.key.span, "unknown", help=hint)
        if "inputs" in vehicles:
            span, hint = vehicles["inputs"].key.span, "give it another name"
            decoder.found.report("KYB400", "a vehicle can't be called `inputs`", span, help=hint)


def _input(name: Scalar, node: Node, decoder: Decoder) -> InputPlan | None:
    one: InputPlan | None = decoder.record(
        InputPlan, node, name.span, name=name.text, button_names={}
    )
    if one is None:
        return None
    cls, params = one.part.cls, one.part.params
    stuck = cls.stuck_after if one.stuck_after is None else one.stuck_after
    given = {device: name for name, device in one.buttons.items()}
    names = {b: given.get(b, b) for b in cls.buttons(params) if b in given or b not in one.buttons}
    return one.but(stuck_after=stuck, button_names=names, at=one.part.span.at)
