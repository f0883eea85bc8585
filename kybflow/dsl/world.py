"""The records of a mission's world (fence, points, obstacles and printed tags) and of an airframe's
cameras.

The columns of a grid run along its x axis and the rows along its y axis; tags are numbered along
the columns' direction first, row by row. `facing` turns a grid or a tag so that its printed side
points up, with the upper edge to the north, or upright to one side; `heading` then turns it about
the world's z axis.
"""

from __future__ import annotations

from math import pi
from typing import TYPE_CHECKING, Annotated, Literal

from kybflow.core.files import File
from kybflow.core.geometry import ZERO, Vec3
from kybflow.core.params import NAMED, key, record
from kybflow.core.units import (
    NUMBER,
    Angle,
    Duration,
    Frequency,
    Length,
    Mass,
    Number,
    Position,
)
from kybflow.dsl.calibration_file import read_calibration
from kybflow.dsl.language.records import Record
from kybflow.vision.tags import FAMILIES, MAX_TAG, read_tags
from kybflow.world.cameras import Camera
from kybflow.world.objects import GRIP, ObjectSurface, SlideJoint, TurnJoint, WorldObject
from kybflow.world.obstacle_files import read_image, read_info, read_points
from kybflow.world.scanned import MAX_RANGE
from kybflow.world.shapes import Box, MovingSphere, Shape
from kybflow.world.tags import Tag

CameraFacing = Literal["down", "up", "forward", "backward", "left", "right"]
_TRIM = "Rotation from `facing` about the body's {} axis, right-handed; roll, then pitch, then yaw."


@record("camera", missing="KYB108")
class CameraPlan(Record):
    """A camera."""

    at: Position = key("Position of its lens, body frame (x forward, y left, z up).")
    facing: CameraFacing = key(
        "Direction of its view; with `down` and `up` the image's upper edge is forward.",
        default="down",
    )
    roll: Angle = key(_TRIM.format("x"), default=0.0)
    pitch: Angle = key(_TRIM.format("y"), default=0.0)
    yaw: Angle = key(_TRIM.format("z"), default=0.0)
    width: int | None = key("Width of its image, pixels.", default=None, at_least=16, at_most=8192)
    height: int | None = key(
        "Height of its image, pixels.", default=None, at_least=16, at_most=8192
    )
    field_of_view: Angle | None = key(
        "Angle of view from the left to the right edge of the image; the lens has no distortion.",
        default=None, above=0.0, below=0.95 * pi,
    )  # fmt: skip
    calibration: File | None = key(
        "Calibration file of ROS or OpenCV, instead of width, height and field_of_view.",
        default=None, reads=read_calibration,
    )  # fmt: skip
    rate: Frequency = key("Frames a second.", default=30.0, above=0.0, at_most=1000.0)
    row_time: Duration = key(
        "Time between the exposures of successive rows (rolling shutter); zero for a global "
        "shutter.",
        default=0.0, at_least=0.0, at_most=1e-3,
    )  # fmt: skip
    name: str = ""
    camera: Camera | None = None


if TYPE_CHECKING:
    Family = str
else:
    Family = Literal[tuple(FAMILIES)]

TagFacing = Literal["up", "down", "east", "north", "west", "south"]
_HEADING = "Rotation about the vertical, counter-clockwise from above."
_FACES = "Direction of the printed side; `up` has the upper edge to the north."


@record("grid", missing="KYB108")
class GridParams(Record):
    """Tags in columns and rows."""

    family: Family = key("Family of the tags.")
    count: tuple[int, ...] = key("Number of tags: [columns, rows].", at_least=1)
    size: Length = key("Side of a tag's black square.", above=0.0, at_most=MAX_TAG)
    spacing: Length = key("Gap between the black squares.", at_least=0.0)
    first: int = key("Number of the first tag.", default=0, at_least=0)
    at: Position = key("Centre of the first tag, world frame.", default=ZERO)
    heading: Angle = key(_HEADING, default=0.0)
    facing: TagFacing = key(_FACES, default="up")
    rows: Literal["up", "down"] = key(
        "Direction of the rows from the first tag: `up`, towards the tags' upper edges, or `down`.",
        default="up",
    )
    leave_out: tuple[int, ...] = key("Numbers of missing tags.", default=())


@record("tag", missing="KYB108")
class TagParams(Record):
    """One tag."""

    family: Family = key("Family of the tag.")
    id: int = key("Its number.", at_least=0)
    size: Length = key("Side of its black square.", above=0.0, at_most=MAX_TAG)
    at: Position = key("Its centre, world frame.")
    heading: Angle = key(_HEADING, default=0.0)
    facing: TagFacing = key(_FACES, default="up")


@record("point_cloud", missing="KYB108")
class PointCloudParams(Record):
    """A scan: a ball around each point."""

    file: File = key(
        "File of the points: PLY or PCD (ASCII or binary), a table with x, y and z, or three "
        "numbers per line.",
        reads=read_points, binary=True,
    )  # fmt: skip
    radius: Length = key(
        "Radius of the balls: half the widest gap in the scan, or more.",
        at_least=1e-3, at_most=1.0,
    )  # fmt: skip
    units: Literal["m", "mm"] = key("Unit of the file's numbers.", default="m")
    at: Position = key("Position of the scan's origin, world frame.", default=ZERO)
    heading: Angle = key(
        "Rotation of the scan about the vertical, counter-clockwise from above.", default=0.0
    )
    above: Length | None = key(
        "Height, world frame, at or below which points are ignored, such as those of the floor.",
        default=None,
    )


@record("occupancy", missing="KYB108")
class OccupancyParams(Record):
    """The occupied cells of a map, as upright columns."""

    file: File = key(
        "A map's YAML file of ROS's map_server, beside its PGM image.", reads=read_info
    )
    height: Length = key(
        "Height of the columns above their foot.", at_least=1e-3, at_most=MAX_RANGE
    )
    foot: Length = key(
        "Height of the foot, world frame.", default=0.0, at_least=-MAX_RANGE, at_most=MAX_RANGE
    )


@record("map")
class MapImage(Record):
    """The image of a map."""

    image: File = key("The image of a map.", reads=read_image, binary=True)


@record("fence")
class Corners(Record):
    """The box that no vehicle may leave."""

    low: Position = key("Lowest corner of the box.", key="from")
    high: Position = key("Highest corner of the box.", key="to")


@record("box")
class BoxParams(Corners):
    """A box along the axes."""


@record("cylinder")
class CylinderParams(Record):
    """An upright cylinder."""

    at: Position = key("Centre of the lower end.")
    radius: Length = key("Its radius.", above=0.0)
    height: Length = key("Its height.", above=0.0)


@record("sphere")
class SphereParams(Record):
    """A ball."""

    at: Position = key("Its centre.")
    radius: Length = key("Its radius.", above=0.0)


@record("plane")
class PlaneParams(Record):
    """An infinite wall; the space behind it is solid."""

    at: Position = key("A point on the plane.")
    facing: Annotated[Vec3, NUMBER] = key(
        "Normal of the plane, of any length, away from the solid side."
    )


@record("obstacle", terse=True)
class Obstacle(Record):
    """An obstacle: a box, cylinder, sphere, plane, point cloud, map or moving sphere.

    shape: the solid, None for a moving sphere. files: the files of a scan or a map.
    """

    name: str
    box: BoxParams | None = key("A box along the axes.", default=None)
    cylinder: CylinderParams | None = key("An upright cylinder.", default=None)
    sphere: SphereParams | None = key("A ball.", default=None)
    plane: PlaneParams | None = key("An infinite wall; the space behind it is solid.", default=None)
    point_cloud: PointCloudParams | None = key("A scan: a ball around each point.", default=None)
    occupancy: OccupancyParams | None = key(
        "The occupied cells of a map, as upright columns.", default=None
    )
    moving_sphere: MovingSphere | None = key(
        "A ball that moves along a path and back.", default=None
    )
    contact: Literal["forbidden", "allowed"] = key(
        "`allowed`: vehicles may touch the obstacle, and nothing keeps them away from it.",
        default="forbidden",
    )
    shape: Shape | None = None
    files: tuple[File, ...] = ()

    @property
    def may_touch(self) -> bool:
        """Whether vehicles may touch this obstacle."""
        return self.contact == "allowed"


@record("entry of tags")
class Tags(Record):
    """Printed tags: a grid, a single tag, or those of a file.

    tags: the tags of this entry. lines: their line numbers, if they are from a file.
    """

    name: str
    grid: GridParams | None = key("Tags in columns and rows.", default=None)
    tag: TagParams | None = key("One tag.", default=None)
    file: File | None = key(
        "A table of tags: `family, id, size, x, y, z, heading [deg]`, one row per tag.",
        default=None, reads=read_tags,
    )  # fmt: skip
    tags: tuple[Tag, ...] = ()
    lines: tuple[int, ...] = ()


@record("surface", missing="KYB108")
class SurfaceParams(Record):
    """A flat surface, where vehicles push an object."""

    name: str
    at: Position = key("Its centre, in the object's axes.")
    facing: Annotated[Vec3, NUMBER] = key("Direction out of it, of any length.")
    width: Length = key("Its width.", above=0.0)
    height: Length = key("Its height.", above=0.0)


@record("object", missing="KYB108", terse=True)
class ObjectParams(Record):
    """An object that moves: a box, with a thin plate at each surface.

    Without a joint (`slide` or `turn`) it is free or, on another object, a part of it.
    """

    name: str
    at: Position = key("Its centre, world frame, or in the axes of the object that it is on.")
    size: Position = key("Its size along its axes.", above=0.0)
    mass: Mass = key("Its mass, with its surfaces.", above=0.0)
    on: str | None = key("The object that it is on; without it, the world.", default=None)
    heading: Angle = key("Its heading at the start.", default=0.0)
    slide: SlideJoint | None = key("A joint along which it slides.", default=None)
    turn: TurnJoint | None = key("A joint about which it turns.", default=None)
    grip: Number = key(
        "Coefficient of friction of its faces and surfaces.",
        default=GRIP, at_least=0.0, at_most=2.0,
    )  # fmt: skip
    surfaces: Annotated[tuple[SurfaceParams, ...], NAMED] = key(
        "Surfaces at which vehicles push it, by name.", default=()
    )
    body: str | None = key("Its name in motion capture; by default its name here.", default=None)

    @property
    def made(self) -> WorldObject:
        """The object."""
        surfaces = (ObjectSurface(s.name, s.at, s.facing, s.width, s.height) for s in self.surfaces)
        return WorldObject(
            self.name, self.at, self.size, self.mass, self.on, self.heading,
            self.slide or self.turn, self.grip, tuple(surfaces),
            self.body,
        )  # fmt: skip


@record("world", like="Start from this world: mappings merge, `null` removes.", block=True)
class World(Record):
    """The world that the vehicles fly in."""

    fence: Corners | None = key("The box that no vehicle may leave.", default=None)
    points: dict[str, Position] = key(
        "Positions by name, world frame (ENU); write one as `world.points.NAME`.",
        default={}, each="A place.",
    )  # fmt: skip
    obstacles: Annotated[tuple[Obstacle, ...], NAMED] = key("Obstacles, by name.", default=())
    objects: Annotated[tuple[ObjectParams, ...], NAMED] = key(
        "Objects that move and that vehicles may touch, by name.", default=()
    )
    tags: Annotated[tuple[Tags, ...], NAMED] = key(
        "Printed tags for localization, by name.", default=()
    )
    box: Box | None = None
    """The box of the fence."""
