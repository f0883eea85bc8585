"""The shape of `groups:`, `flows:`, `on:` and `faults:`, without the actions and faults of
packages."""

from __future__ import annotations

from kybflow.core.params import declared, fields_of, param
from kybflow.core.units import DURATION
from kybflow.dsl.plan import Arrive
from kybflow.dsl.schema.building import NEXT, Schema, field_schema, mapping, named, quantity, text
from kybflow.parts.events import AWAITED_EVENTS

_SCALAR = ["string", "number", "boolean"]


@declared
class PhaseParams:
    arrive: Arrive | None = param(
        "How those that `run` names arrive: `together`, on straight lines at one pace, or "
        "`in_turns`, each when the one before is there.",
        default=None,
    )


(ARRIVE,) = fields_of(PhaseParams)


def groups_schema() -> Schema:
    """Vehicles that go by one name."""
    members: Schema = {"description": "Its vehicles.", "type": "array", "items": {"type": "string"}}
    members["examples"] = [["a", "b"]]
    return named("Vehicles that go by one name, as in `all swarm in hover`.", members)


def flows_schema() -> Schema:
    """The flows of a mission or a library, by name."""
    like = "Start from this flow: mappings merge, lists are replaced, null removes."
    keys: Schema = {
        "like": text(like),
        "begin": text("The first phase; without it the topmost."),
        "next": {
            "description": "Ways out of every phase but the one that it leads to, asked first.",
            "type": "array",
            "items": NEXT,
        },
        "phases": named("Its phases: exactly one is active.", _phase(), minProperties=1),
    }
    alone = {"title": "flow", "properties": dict.fromkeys(keys, True), "required": ["phases"]}
    says = "Phases over several vehicles; a vehicle is driven by one flow at a time."
    flow = mapping("flow", says, keys, **{"if": {"required": ["like"]}, "else": alone})
    return named("What several vehicles do together, flows side by side.", flow)


def _goal(what: str) -> Schema:
    """A state, or `{STATE: {PARAMETER: VALUE}}`."""
    values: Schema = {
        "description": "Values of its parameters in place of its own.",
        "type": ["object", *_SCALAR, "array"],
    }
    return {
        "description": f"{what}, or it with values: `{{goto: {{position: [1, 0, 1]}}}}`.",
        "type": ["string", "object"],
        "minProperties": 1,
        "additionalProperties": values,
    }


def _phase() -> Schema:
    value: Schema = {"type": ["string", "number", "boolean", "array"]}
    return mapping(
        "phase",
        "What begins together, and what it goes on by. One without a way out is the last.",
        {
            "give": named("Vehicles or groups, and the flow that drives each from here on.",
                          text("The flow; it gives back when it ends.")),
            "set": {
                "description": "Options, like `swarm.processors.limit_speed.speed`, and values.",
                "type": "object", "minProperties": 1, "additionalProperties": value,
            },
            "run": named("Vehicles or groups, and the behavior that each is asked to enter.",
                         _goal("The behavior")),
            "arrive": field_schema(ARRIVE),
            "next": {
                "description": "Ways out, asked from the top in every tick; `end` ends the flow.",
                "type": "array", "items": NEXT,
            },
            "within": quantity(DURATION, "The longest that it lasts.", exclusiveMinimum=0),
            "otherwise": text("The phase to go to when it lasts longer, or `end`."),
        },
    )  # fmt: skip


_OWN = {
    "event": (
        "What to hear: `VEHICLE.NAME`, `any.NAME` of every vehicle, `operator.NAME` of a person, "
        "or the bare name of an event of the run, or of one that a mission emits."
    ),
    "when": (
        "A condition that must hold too, like `a in landed`; vehicles go by their names. Without "
        "`event`, the actions are done when it begins to hold."
    ),
}


def _names(help: str, value: Schema) -> Schema:
    return {
        "description": help, "type": "object", "minProperties": 1, "additionalProperties": value,
    }  # fmt: skip


def action_schema() -> Schema:
    """One action: a mapping with one key. Those of packages have any other key, and their
    parameters."""
    value: Schema = {"type": [*_SCALAR, "array"]}
    return {
        "title": "action",
        "description": "What to do: one action.",
        "type": "object",
        "examples": [[{"log": "hello"}, {"stop": "enough"}]],
        "minProperties": 1,
        "properties": {
            "switch": _names(
                "Vehicles or groups, and the state that each is asked to enter.",
                _goal("The state"),
            )
            | {"examples": [{"a": "home"}]},
            "set": _names(
                "Options, like `a.processors.limit_speed.speed`, and their new values.", value
            ),
            "enable": text("A processor to use again, like `a.processors.limit_speed`."),
            "disable": text("A processor to leave out; none that is a safety part."),
            "emit": text("An event of the mission's own, to be heard in the next tick."),
            "phase": {
                "description": "A phase to enter; `{FLOW: PHASE}` where several flows have it.",
                "type": ["string", "object"],
                "minProperties": 1,
                "additionalProperties": text("The phase."),
            },
            "perform": _names(
                "Vehicles or groups, and what each is asked to perform: an act of its driver, like"
                " `leds_blink_red`.",
                text("The act."),
            )
            | {"examples": [{"a": "leds_blink_red"}]},
            "log": text("A text for the record, with `{vehicle}`, `{time}` and the event's own."),
            "stop": text("Why the run ends here: every vehicle lands."),
        },
        "additionalProperties": {"type": ["object", "null", *_SCALAR, "array"]},
    }


def on_schema() -> Schema:
    """The list of callbacks. A callback's other keys are fields of its event."""
    fields = sorted({name for event in AWAITED_EVENTS.values() for name in event.fields})
    return {
        "description": "What is done when something happens, at any time.",
        "type": "array",
        "items": {
            "title": "callback",
            "description": "An event or a condition, and the actions that it brings about.",
            "type": "object",
            "properties": {
                **{key: text(what) for key, what in _OWN.items()},
                "for": quantity(
                    DURATION, "How long a condition without an `event` must hold.", minimum=0
                ),
                "do": {
                    "description": "The actions, each a mapping with one key.",
                    "type": "array",
                    "items": action_schema(),
                    "examples": [[{"log": "hello"}, {"stop": "enough"}]],
                },
                **{
                    name: {"description": f"Only when the event's `{name}` is this.",
                           "type": _SCALAR}
                    for name in fields
                },
            },
            "required": ["do"],
            "additionalProperties": False,
        },
    }  # fmt: skip


def faults_schema() -> Schema:
    """The list of faults; a fault's other keys are its part's parameters."""
    return {
        "description": "What breaks, and when; in simulation, and our side of it on a firmware's"
        " own simulator.",
        "type": "array",
        "items": {
            "title": "fault",
            "description": "One thing that breaks on one vehicle: `at` a time, or `when`.",
            "type": "object",
            "properties": {
                "at": quantity(DURATION, "Time of the run.", minimum=0),
                "when": text("A condition: the first time that it holds, like `behavior == hop`."),
                "on": text("The vehicle."),
                "inject": text("The fault; its parameters are keys beside it."),
                "for": quantity(
                    DURATION, "How long it lasts; to the end without it.", exclusiveMinimum=0
                ),
            },
            "required": ["on", "inject"],
        },
    }
