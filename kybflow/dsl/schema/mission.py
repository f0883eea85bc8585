"""The shape of the language: every key of a mission and of a library, and no part."""

from __future__ import annotations

from kybflow.core.params import fields_of
from kybflow.core.units import ANGLE, DURATION, FREQUENCY, LENGTH
from kybflow.dsl.reading.values import TYPES
from kybflow.dsl.schema.building import (
    DOTTED,
    NEXT,
    Schema,
    mapping,
    named,
    params_schema,
    quantity,
    text,
    title,
    use,
    uses,
    vector,
)
from kybflow.dsl.schema.flows import faults_schema, flows_schema, groups_schema, on_schema
from kybflow.dsl.schema.world import AirframeCameraParams, world, worlds
from kybflow.world.vehicle_context import Airframe, Parcel

STATE: Schema = {
    "title": "behavior",
    "description": "One state: what the vehicle does, and where it goes from there.",
    "type": "object",
    "properties": {
        "do": text("The behavior to fly; its parameters are keys beside it."),
        "then": text("Where to go when it is done."),
        "next": {
            "description": "Ways out, asked from the top in every tick.",
            "type": "array",
            "items": NEXT,
        },
        "failed": text("Where to go when it fails."),
        "within": quantity(DURATION, "It fails when it takes longer.", exclusiveMinimum=0),
        "estimators": {
            "description": "Estimators of the vehicle that come first here, in this order.",
            "type": "array",
            "items": text("Name of an estimator."),
            "minItems": 1,
            "examples": [["mocap"]],
        },
    },
}
ESTIMATOR_KEYS: Schema = {
    "healthy": text("A condition: the estimate may be used, like `age < 100 ms`."),
    "recover_after": quantity(DURATION, "Healthy so long before it is used again.", minimum=0),
    "for_at_most": quantity(DURATION, "Use it no longer than this.", exclusiveMinimum=0),
}
START = mapping(
    "start",
    "Where the vehicle stands before take-off.",
    {
        "at": vector(LENGTH, "Position, world frame (ENU)."),
        "heading": quantity(ANGLE, "Angle of the nose from east, counter-clockwise."),
    },
    examples=[{"at": [0, 0, 0]}],
)


INPUT_KEYS: Schema = {
    "buttons": named(
        "What the mission calls buttons of the device, like `{leave: a}`.",
        text("The device's name of it."),
    ),
    "dead_man": text("The button without which nothing is steered: released means brake."),
    "silent_after": quantity(
        DURATION, "Lost when it is silent for longer; 300 ms without it.", exclusiveMinimum=0
    ),
    "stuck_after": quantity(
        DURATION,
        "Lost when an axis away from its centre doesn't change for longer.",
        exclusiveMinimum=0,
    ),
}


def inputs() -> Schema:
    """What people steer with, by name."""
    one = use("input", "A device, or a script of one.", INPUT_KEYS)
    return named("What people steer with and give events by, by name.", one)


def _airframe() -> Schema:
    schema = params_schema(fields_of(Airframe), "airframe")
    return {
        **schema,
        "required": [],
        "properties": {
            "like": text("Start from this airframe."),
            **schema["properties"],
            "cameras": named("Cameras that it carries, by name.", _camera()),
        },
    }


def _camera() -> Schema:
    schema = params_schema(fields_of(AirframeCameraParams), "camera")
    return {**schema, "description": "A camera.", "required": []}


def _vehicle() -> Schema:
    airframe = {**_airframe(), "type": ["string", "object"]}
    return mapping(
        "vehicle",
        "What flies, what it trusts, what it does.",
        {
            "like": text(
                "Start from this vehicle: mappings merge, lists are replaced, null removes."
            ),
            "airframe": {**airframe, "description": "Name of an airframe, or its numbers."},
            "start": START,
            "home": vector(LENGTH, "Where `go_home` flies; its start without it."),
            "payload": _payload(),
            "tracker": {
                **use("tracker", "What turns the setpoint into a command."),
                "required": [],
            },
            **lists(),
            "begin": text("The first behavior; without it the topmost."),
            "behaviors": behaviors(),
        },
    )  # fmt: skip


def _payload() -> Schema:
    schema = params_schema(fields_of(Parcel), "payload")
    example = {"mass": "200 g", "size": "10 cm", "channel": 1, "aboard": True}
    return {
        **schema,
        "description": "What it carries and may release.",
        "required": [],
        "examples": [example],
    }


def behaviors() -> Schema:
    """The states of a vehicle; those of a chain have dotted names."""
    dotted = {"pattern": DOTTED}
    whole = named("The vehicle's state machine: exactly one is active.", STATE)
    return {**whole, "propertyNames": dotted}


def _chain() -> Schema:
    return mapping(
        "chain",
        "Behaviors that are used as one: `do: chain.NAME`, with its parameters beside it.",
        {
            "summary": text("One line for people."),
            "parameters": named("Values that are given where it is used.", _parameter()),
            "begin": text("The first behavior; without it the topmost."),
            "behaviors": named("Its states; `then: end`, or none, leaves it.", STATE),
        },
        required=["behaviors"],
    )


def _stack() -> Schema:
    return mapping(
        "stack",
        "Parts for the lists of a vehicle: `- stack: NAME` stands for them.",
        {
            "summary": text("One line for people."),
            "like": text("Start from this stack."),
            **lists(),
        },
    )


def lists() -> Schema:
    """The lists of parts of a vehicle."""
    return {
        "estimators": uses("estimator", "The first healthy one is used.", ESTIMATOR_KEYS),
        "processors": uses("processor", "What may bend the setpoint, in this order."),
        "supervisors": uses("supervisor", "What watches a bound."),
    }


def _parameter() -> Schema:
    value: Schema = {"type": ["number", "string", "boolean", "array"]}
    return mapping(
        "parameter",
        "A value that `--set` may change; `$name` stands for it.",
        {
            "type": {**text("What kind of value."), "examples": list(TYPES)},
            "default": {"description": "The value when nothing sets it.", **value},
            **{bound: {"description": "A bound.", "type": ["number", "string"]}
               for bound in ("above", "at_least", "below", "at_most")},
            "help": text("What it is."),
        },
        required=["type"], examples=[{"type": "length", "default": "1 m"}],
    )  # fmt: skip


def _import() -> Schema:
    return {
        "title": "import",
        "type": ["string", "object"],
        "properties": {
            "from": text("The library's file."),
            "with": {"description": "Values of its parameters, by name.", "type": "object"},
        },
        "required": ["from"],
        "additionalProperties": False,
    }


def _shared() -> Schema:
    return {
        "summary": text("One line for people."),
        "import": named("Libraries, each under a name.", _import()),
        "parameters": named("Values that `--set` may change.", _parameter()),
        "airframes": named("Airframes by name.", _airframe()),
        "chains": named("Sequences that can be used as one behavior, by name.", _chain()),
        "stacks": named("Parts for the lists of a vehicle, by name.", _stack()),
        "vehicles": named("What flies, by name.", _vehicle()),
    }


def library_schema() -> Schema:
    """The shape of a library file."""
    return mapping(
        "library", "What missions share.",
        {"library": title(), **_shared(), "worlds": worlds(), "flows": flows_schema()},
        required=["library"],
    )  # fmt: skip


def skeleton() -> Schema:
    """The shape of a mission, with no part in it."""
    shared = _shared()
    shared["vehicles"] = {**shared["vehicles"], "minProperties": 1}
    return mapping(
        "mission",
        "A kybflow mission: what flies, what it trusts, what it does, what is expected of it.",
        {
            "kybflow": {"description": "Version of the language.", "const": 1},
            "mission": title(),
            **shared,
            "world": world(),
            **_rates(),
            "inputs": inputs(),
            "groups": groups_schema(),
            "flows": flows_schema(),
            "on": on_schema(),
            "faults": faults_schema(),
            "expect": {
                "description": "What must hold for the mission to succeed.",
                "type": "array",
                "items": {"type": "string"},
            },
            "targets": _targets(),
        },
        required=["kybflow", "mission", "vehicles"],
    )


def _rates() -> Schema:
    hover = "A hover that was entered by default lands after this; 30 s without it."
    limit = "The run ends after this at the latest; 600 s without it."
    rate = (
        "Control rate, a whole number of Hz; unless said 250 Hz, or 100 Hz where every vehicle is"
        " on an autopilot that takes at most 50 set-points a second."
    )
    return {
        "control": quantity(FREQUENCY, rate, exclusiveMinimum=0),
        "hover_limit": quantity(DURATION, hover, exclusiveMinimum=0),
        "time_limit": quantity(DURATION, limit, exclusiveMinimum=0),
    }


def _targets() -> Schema:
    driver = use("driver", "What flies it.")
    sensor = use("sensor", "Where the estimator's measurements come from: one, or a list of them.")
    several = {**sensor, "type": [*sensor["type"], "array"], "items": sensor, "minItems": 1}
    sensors = named("Sensors beside the driver, under the names of estimators.", several)
    tracker = use("tracker", "What turns the setpoint into a command there.")
    place = mapping(
        "vehicle's target", "How a vehicle is reached.",
        {"driver": driver, "tracker": tracker, "sensors": sensors},
    )  # fmt: skip
    target = {
        "title": "target",
        **named("One target: `all`, or a vehicle's name.", place, properties={"inputs": inputs()}),
    }
    return named("Where the mission can fly; `sim` and those of the drivers are implied.", target)
