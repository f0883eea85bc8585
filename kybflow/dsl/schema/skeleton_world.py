"""The shape of `world:`, and of a library's `worlds:`. No key is required here: `like` may bring
it, and `kybflow.dsl.shaping.world.world` says what is missing then."""

from __future__ import annotations

from kybflow.core.params import fields_of
from kybflow.core.units import LENGTH, NUMBER
from kybflow.dsl.schema.part_schema import Schema, params_schema, quantity, vector
from kybflow.dsl.schema.skeleton_base import mapping, named, text
from kybflow.dsl.shaping.world.tag_params import GridParams, TagFile, TagParams


def world() -> Schema:
    """A mission's world: the name of one, or its own, which may be `like` another."""
    whole = _mapping_of_world()
    says = "Name of a library's world, or what bounds the flight, stands in its way and has a name."
    return {**whole, "type": ["string", "object"], "description": says}


def worlds() -> Schema:
    """The worlds of a library."""
    return named("Worlds by name.", _mapping_of_world())


def _mapping_of_world() -> Schema:
    return mapping(
        "world",
        "Where it flies.",
        {
            "like": text("Start from this world: mappings merge, `null` removes."),
            "fence": _fence(),
            "points": named(
                "Places by name, world frame (ENU); `world.points.NAME` stands for one.",
                vector(LENGTH, "A place."),
            ),
            "obstacles": named("What stands in the way, by name.", _obstacle()),
            "tags": named("Printed tags to find the way by, by name.", _tags()),
        },
    )


def _fence() -> Schema:
    return mapping(
        "fence",
        "The box that no vehicle may leave.",
        {"from": vector(LENGTH, "Its lowest corner."), "to": vector(LENGTH, "Its highest corner.")},
    )


def _obstacle() -> Schema:
    at, radius = vector(LENGTH, "Its centre."), quantity(LENGTH, "Its radius.", exclusiveMinimum=0)
    foot = vector(LENGTH, "The centre of its foot.")
    height = quantity(LENGTH, "From its foot up.", exclusiveMinimum=0)
    low, high = vector(LENGTH, "Its lowest corner."), vector(LENGTH, "Its highest corner.")
    point = vector(LENGTH, "A point on it.")
    facing = vector(NUMBER, "Its direction, of any length; what is behind it is solid.")
    return mapping(
        "obstacle",
        "One solid: a box, a cylinder, a sphere or a plane.",
        {
            "box": _solid("box", "A box along the axes.", {"from": low, "to": high}),
            "cylinder": _solid(
                "cylinder", "An upright cylinder.", {"at": foot, "radius": radius, "height": height}
            ),
            "sphere": _solid("sphere", "A ball.", {"at": at, "radius": radius}),
            "plane": _solid("plane", "A wall without end.", {"at": point, "facing": facing}),
        },
    )


def _tags() -> Schema:
    return mapping(
        "entry of tags",
        "Printed tags: a grid, a single one, or those of a file.",
        {
            "grid": _declared(GridParams, "grid", "Tags in columns and rows."),
            "tag": _declared(TagParams, "tag", "One tag."),
            **params_schema(fields_of(TagFile), "file")["properties"],
        },
    )


def _declared(cls: type, title: str, help: str) -> Schema:
    whole = params_schema(fields_of(cls), title)
    return {**whole, "description": help, "required": []}


def _solid(name: str, help: str, properties: Schema) -> Schema:
    return mapping(name, help, properties)
