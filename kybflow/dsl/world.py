"""The records of a mission's world: its fence, points, obstacles and printed tags, and the cameras
of an airframe. A grid's columns go along its x, its rows along its y, the numbers along the columns
first. `facing` turns a grid or a tag to where its printed side looks: up with the upper edge to the
north, or upright to a side; then `heading` turns it about the world's z.
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
    Path,
    Position,
    Speed,
)
from kybflow.dsl.calibration_file import read_calibration
from kybflow.dsl.language.source import Record
from kybflow.vision.families import FAMILIES
from kybflow.vision.tag_table import LARGEST, read_tags
from kybflow.world.cameras import Camera
from kybflow.world.moving_sphere import MovingSphere
from kybflow.world.occupancy_map import read_image, read_info
from kybflow.world.point_cloud import FARTHEST
from kybflow.world.point_cloud_file import read_points
from kybflow.world.shapes import Box, Shape
from kybflow.world.tags import Tag

CameraFacing = Literal["down", "up", "forward", "backward", "left", "right"]
_TRIM = "Turned from there about the body's {} axis, right-handed; roll first, then pitch, yaw."


@record("camera", missing="KYB108")
class CameraPlan(Record):
    """A camera."""

    at: Position = key("Where its lens is, body frame (x forward, y left, z up).")
    facing: CameraFacing = key(
        "Where it looks; `down` and `up` have the image's upper edge forward.", default="down"
    )
    roll: Angle = key(_TRIM.format("x"), default=0.0)
    pitch: Angle = key(_TRIM.format("y"), default=0.0)
    yaw: Angle = key(_TRIM.format("z"), default=0.0)
    width: int | None = key("Width of its image, pixels.", default=None, at_least=16, at_most=8192)
    height: int | None = key(
        "Height of its image, pixels.", default=None, at_least=16, at_most=8192
    )
    field_of_view: Angle | None = key(
        "From the image's left edge to its right one; the lens has no distortion.",
        default=None, above=0.0, below=0.95 * pi,
    )  # fmt: skip
    calibration: File | None = key(
        "Calibration file of ROS or OpenCV, in place of width, height and field_of_view.",
        default=None, reads=read_calibration,
    )  # fmt: skip
    rate: Frequency = key("Frames a second.", default=30.0, above=0.0, at_most=1000.0)
    row_time: Duration = key(
        "From the start of a row's exposure to the next row's (rolling shutter); zero is a global "
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
_HEADING = "Turned about the vertical by this, counter-clockwise from above."
_FACES = "Where the printed side looks; `up` has the upper edge to the north."


@record("grid", missing="KYB108")
class GridParams(Record):
    """Tags in columns and rows."""

    family: Family = key("Family of the tags.")
    count: tuple[int, ...] = key("How many: [columns, rows].", at_least=1)
    size: Length = key("Side of a tag's black square.", above=0.0, at_most=LARGEST)
    spacing: Length = key("Gap between the black squares.", at_least=0.0)
    first: int = key("Number of the first tag.", default=0, at_least=0)
    at: Position = key("Centre of the first tag, world frame.", default=ZERO)
    heading: Angle = key(_HEADING, default=0.0)
    facing: TagFacing = key(_FACES, default="up")
    rows: Literal["up", "down"] = key(
        "Where the rows go from the first tag: `up` to the tags' upper edges, or `down`.",
        default="up",
    )
    leave_out: tuple[int, ...] = key("Numbers that are not there.", default=())


@record("tag", missing="KYB108")
class TagParams(Record):
    """One tag."""

    family: Family = key("Family of the tag.")
    id: int = key("Its number.", at_least=0)
    size: Length = key("Side of its black square.", above=0.0, at_most=LARGEST)
    at: Position = key("Its centre, world frame.")
    heading: Angle = key(_HEADING, default=0.0)
    facing: TagFacing = key(_FACES, default="up")


@record("moving_sphere", missing="KYB108")
class MovingSphereParams(Record):
    """A ball that goes along lines, there and back."""

    along: Path = key("The points through which its centre goes, where it is simulated.")
    radius: Length = key("Its radius.", above=0.0)
    speed: Speed = key("How fast it goes, at most.", above=0.0, at_most=2.0)
    body: str | None = key(
        "Its name in motion capture, which sees where it is; the obstacle's by default.",
        default=None,
    )


@record("point_cloud", missing="KYB108")
class PointCloudParams(Record):
    """What a scanner saw: balls around points."""

    file: File = key(
        "Its points: PLY (ASCII or binary), a table with x, y and z, or three numbers a line.",
        reads=read_points, binary=True,
    )  # fmt: skip
    radius: Length = key(
        "How far around each point it is solid: half the greatest gap in the scan, or more.",
        at_least=1e-3, at_most=1.0,
    )  # fmt: skip
    units: Literal["m", "mm"] = key("What the file measures in.", default="m")
    at: Position = key("Where the scan's origin is, world frame.", default=ZERO)
    heading: Angle = key(
        "The scan turned about the vertical by this, counter-clockwise from above.", default=0.0
    )
    above: Length | None = key(
        "Points that are not higher than this are left out, world frame: the floor's.",
        default=None,
    )


@record("occupancy", missing="KYB108")
class OccupancyParams(Record):
    """The occupied cells of a map, as upright columns."""

    file: File = key(
        "A map's YAML file, as ROS's map_server has it, beside its PGM picture.", reads=read_info
    )
    height: Length = key(
        "How high what is occupied stands, from its foot.", at_least=1e-3, at_most=FARTHEST
    )
    foot: Length = key(
        "Height of the foot, world frame.", default=0.0, at_least=-FARTHEST, at_most=FARTHEST
    )


@record("map")
class MapImage(Record):
    """The picture of a map."""

    image: File = key("The picture of a map.", reads=read_image, binary=True)


@record("fence")
class Corners(Record):
    """The box that no vehicle may leave."""

    low: Position = key("Its lowest corner.", key="from")
    high: Position = key("Its highest corner.", key="to")


@record("box")
class BoxParams(Corners):
    """A box along the axes."""


@record("cylinder")
class CylinderParams(Record):
    """An upright cylinder."""

    at: Position = key("The centre of its foot.")
    radius: Length = key("Its radius.", above=0.0)
    height: Length = key("From its foot up.", above=0.0)


@record("sphere")
class SphereParams(Record):
    """A ball."""

    at: Position = key("Its centre.")
    radius: Length = key("Its radius.", above=0.0)


@record("plane")
class PlaneParams(Record):
    """A wall without end: all behind it is solid."""

    at: Position = key("A point on it.")
    facing: Annotated[Vec3, NUMBER] = key(
        "Its direction, of any length; what is behind it is solid."
    )


@record("obstacle", terse=True)
class Obstacle(Record):
    """One solid: a box, a cylinder, a sphere, a plane, a point cloud, a map or a moving sphere.

    `shape` is the solid, None for one that moves; `files` are those that something scanned is made
    of.
    """

    name: str
    box: BoxParams | None = key("A box along the axes.", default=None)
    cylinder: CylinderParams | None = key("An upright cylinder.", default=None)
    sphere: SphereParams | None = key("A ball.", default=None)
    plane: PlaneParams | None = key("A wall without end: all behind it is solid.", default=None)
    point_cloud: PointCloudParams | None = key(
        "What a scanner saw: balls around points.", default=None
    )
    occupancy: OccupancyParams | None = key(
        "The occupied cells of a map, as upright columns.", default=None
    )
    moving_sphere: MovingSphereParams | None = key(
        "A ball that goes along lines, there and back.", default=None
    )
    contact: Literal["forbidden", "allowed"] = key(
        "`allowed`: it is there to be touched, and nothing keeps away from it.",
        default="forbidden",
    )
    shape: Shape | None = None
    moving: MovingSphere | None = None
    files: tuple[File, ...] = ()

    @property
    def may_touch(self) -> bool:
        """Whether it is there to be touched."""
        return self.contact == "allowed"


@record("entry of tags")
class Tags(Record):
    """Printed tags: a grid, a single one, or those of a file.

    `tags` are those that it means, and `lines` where they stand in a file.
    """

    name: str
    grid: GridParams | None = key("Tags in columns and rows.", default=None)
    tag: TagParams | None = key("One tag.", default=None)
    file: File | None = key(
        "A table of tags: `family, id, size, x, y, z, heading [deg]`, a row a tag.",
        default=None, reads=read_tags,
    )  # fmt: skip
    tags: tuple[Tag, ...] = ()
    lines: tuple[int, ...] = ()


@record("world", like="Start from this world: mappings merge, `null` removes.", block=True)
class World(Record):
    """Where it flies."""

    fence: Corners | None = key("The box that no vehicle may leave.", default=None)
    points: dict[str, Position] = key(
        "Places by name, world frame (ENU); `world.points.NAME` stands for one.",
        default={}, each="A place.",
    )  # fmt: skip
    obstacles: Annotated[tuple[Obstacle, ...], NAMED] = key(
        "What stands in the way, by name.", default=()
    )
    tags: Annotated[tuple[Tags, ...], NAMED] = key(
        "Printed tags to find the way by, by name.", default=()
    )
    box: Box | None = None
    """The fence."""
