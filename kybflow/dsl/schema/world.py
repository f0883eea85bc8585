"""The shape of `world:` and of a library's `worlds:`, and what a mission may say of cameras and of
printed tags.

No key of a world is required here: `like` may bring it, and `kybflow.dsl.shaping.world` says what
is missing then. A grid's columns go along its x, its rows along its y, the numbers along the
columns first. `facing` turns a grid or a tag to where its printed side looks: up with the upper
edge to the north, or upright to a side; then `heading` turns it about the world's z.
"""

from __future__ import annotations

from math import pi
from typing import TYPE_CHECKING, Literal

from kybflow.core.files import File
from kybflow.core.geometry import (
    ZERO,
)
from kybflow.core.params import declared, fields_of, param
from kybflow.core.units import (
    LENGTH,
    NUMBER,
    Angle,
    Duration,
    Frequency,
    Length,
    Path,
    Position,
    Speed,
)
from kybflow.dsl.reading.calibration import read_calibration
from kybflow.dsl.reading.occupancy_map import read_image, read_info
from kybflow.dsl.reading.point_cloud import read_points
from kybflow.dsl.reading.tag_table import LARGEST, read_tags
from kybflow.dsl.schema.building import (
    Schema,
    mapping,
    named,
    params_schema,
    quantity,
    text,
    vector,
)
from kybflow.vision.families import FAMILIES
from kybflow.world.point_cloud import FARTHEST

CameraFacing = Literal["down", "up", "forward", "backward", "left", "right"]
_TRIM = "Turned from there about the body's {} axis, right-handed; roll first, then pitch, yaw."


@declared
class AirframeCameraParams:
    at: Position = param("Where its lens is, body frame (x forward, y left, z up).")
    facing: CameraFacing = param(
        "Where it looks; `down` and `up` have the image's upper edge forward.", default="down"
    )
    roll: Angle = param(_TRIM.format("x"), default=0.0)
    pitch: Angle = param(_TRIM.format("y"), default=0.0)
    yaw: Angle = param(_TRIM.format("z"), default=0.0)
    width: int | None = param(
        "Width of its image, pixels.", default=None, at_least=16, at_most=8192
    )
    height: int | None = param(
        "Height of its image, pixels.", default=None, at_least=16, at_most=8192
    )
    field_of_view: Angle | None = param(
        "From the image's left edge to its right one; the lens has no distortion.",
        default=None, above=0.0, below=0.95 * pi,
    )  # fmt: skip
    calibration: File | None = param(
        "Calibration file of ROS or OpenCV, in place of width, height and field_of_view.",
        default=None, reads=read_calibration,
    )  # fmt: skip
    rate: Frequency = param("Frames a second.", default=30.0, above=0.0, at_most=1000.0)
    row_time: Duration = param(
        "From the start of a row's exposure to the next row's (rolling shutter); zero is a global "
        "shutter.",
        default=0.0, at_least=0.0, at_most=1e-3,
    )  # fmt: skip


if TYPE_CHECKING:
    Family = str
else:
    Family = Literal[tuple(FAMILIES)]

TagFacing = Literal["up", "down", "east", "north", "west", "south"]
_HEADING = "Turned about the vertical by this, counter-clockwise from above."
_FACES = "Where the printed side looks; `up` has the upper edge to the north."


@declared
class GridParams:
    family: Family = param("Family of the tags.")
    count: tuple[int, ...] = param("How many: [columns, rows].", at_least=1)
    size: Length = param("Side of a tag's black square.", above=0.0, at_most=LARGEST)
    spacing: Length = param("Gap between the black squares.", at_least=0.0)
    first: int = param("Number of the first tag.", default=0, at_least=0)
    at: Position = param("Centre of the first tag, world frame.", default=ZERO)
    heading: Angle = param(_HEADING, default=0.0)
    facing: TagFacing = param(_FACES, default="up")
    rows: Literal["up", "down"] = param(
        "Where the rows go from the first tag: `up` to the tags' upper edges, or `down`.",
        default="up",
    )
    leave_out: tuple[int, ...] = param("Numbers that are missing on the floor.", default=())


@declared
class TagParams:
    family: Family = param("Family of the tag.")
    id: int = param("Its number.", at_least=0)
    size: Length = param("Side of its black square.", above=0.0, at_most=LARGEST)
    at: Position = param("Its centre, world frame.")
    heading: Angle = param(_HEADING, default=0.0)
    facing: TagFacing = param(_FACES, default="up")


@declared
class ObstacleParams:
    contact: Literal["forbidden", "allowed"] = param(
        "`allowed`: it is there to be touched, and nothing keeps away from it.",
        default="forbidden",
    )


@declared
class MovingSphereParams:
    along: Path = param("The points through which its centre goes, where it is simulated.")
    radius: Length = param("Its radius.", above=0.0)
    speed: Speed = param("How fast it goes, at most.", above=0.0, at_most=2.0)
    body: str | None = param(
        "Its name in motion capture, which sees where it is; the obstacle's by default.",
        default=None,
    )


@declared
class PointCloudParams:
    file: File = param(
        "Its points: PLY (ASCII or binary), a table with x, y and z, or three numbers a line.",
        reads=read_points, binary=True,
    )  # fmt: skip
    radius: Length = param(
        "How far around each point it is solid: half the greatest gap in the scan, or more.",
        at_least=1e-3, at_most=1.0,
    )  # fmt: skip
    units: Literal["m", "mm"] = param("What the file measures in.", default="m")
    at: Position = param("Where the scan's origin is, world frame.", default=ZERO)
    heading: Angle = param(
        "The scan turned about the vertical by this, counter-clockwise from above.", default=0.0
    )
    above: Length | None = param(
        "Points that are not higher than this are left out, world frame: the floor's.",
        default=None,
    )


@declared
class OccupancyParams:
    file: File = param(
        "A map's YAML file, as ROS's map_server has it, beside its PGM picture.", reads=read_info
    )
    height: Length = param(
        "How high what is occupied stands, from its foot.", at_least=1e-3, at_most=FARTHEST
    )
    foot: Length = param(
        "Height of the foot, world frame.", default=0.0, at_least=-FARTHEST, at_most=FARTHEST
    )


@declared
class MapImage:
    image: File = param("The picture of a map.", reads=read_image, binary=True)


@declared
class TagFile:
    file: File = param(
        "A table of tags: `family, id, size, x, y, z, heading [deg]`, a row a tag.",
        reads=read_tags,
    )


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
        "One solid: a box, a cylinder, a sphere, a plane, a point cloud, a map or a moving sphere.",
        {
            **params_schema(fields_of(ObstacleParams), "obstacle")["properties"],
            "box": _solid("box", "A box along the axes.", {"from": low, "to": high}),
            "cylinder": _solid(
                "cylinder", "An upright cylinder.", {"at": foot, "radius": radius, "height": height}
            ),
            "sphere": _solid("sphere", "A ball.", {"at": at, "radius": radius}),
            "plane": _solid("plane", "A wall without end.", {"at": point, "facing": facing}),
            "point_cloud": _declared(
                PointCloudParams, "point_cloud", "What a scanner saw: balls around points."
            ),
            "occupancy": _declared(
                OccupancyParams, "occupancy", "The occupied cells of a map, as upright columns."
            ),
            "moving_sphere": _solid(
                "moving_sphere",
                "A ball that goes along lines, there and back.",
                params_schema(fields_of(MovingSphereParams), "moving_sphere")["properties"],
            ),
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
