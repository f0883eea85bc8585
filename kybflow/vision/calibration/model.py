"""The residuals of a bundle adjustment for a walk with a camera over printed tags, and their sparse
Jacobian.

The unknowns are corrections of the prior values, x = (lens, mount, offset, tags, frames):

    lens    s, dcx, dcy, dk1  focal lengths (1 + s) f0, centre in pixels, first radial term
    mount   dm, r             the lens is at m = m0 + dm in the body, its frame M = exp([r]x) M0
    offset  o                 the reference's clock is o seconds behind the frames' clock
    tags    dt, h             for each tag: its centre, and its heading about the vertical
    frames  dp, d (, v, w)    for each frame: the lens is at p = p0 + dp, and C = C0 exp([d]x) turns
                              its frame to the world; for a rolling shutter also velocity and rates

A tag corner, offset by q from the tag's centre t, lies at X = t + Rz(h) q in the world and at
c = C^T (X - p) in the optical frame, and appears at u(c_x / c_z, c_y / c_z), with u the lens of
`projection`. A row that is read a seconds after the middle row has the pose p + v a and
C exp([w a]x). With U = du/dc, the derivatives are (Triggs, McLauchlan, Hartley and Fitzgibbon,
"Bundle adjustment - a modern synthesis", 2000, ch. 4)

    du/dp = -U C^T    du/dd = U [c]x    du/dt = U C^T    du/dh = U C^T (z x Rz(h) q)

If a reference gives the body's pose b_r, B_r, with velocity v_r and body rates w_r, the camera's
pose implies B = C M^T and b = p - B m. The residuals are b - b_r and the rotation vector e of
B_r^T B, with (hand-eye calibration; Tsai and Lenz, 1989)

    db/dp = 1    db/dd = B [m]x M    db/dm = -B    db/dr = -B [m]x    db/do = -v_r
                 de/dd = M                         de/dr = -1         de/do = -w_r

A rolling shutter's v and w are then v_r + B_r (w_r x m) and M^T w_r.

Rotations are differentiated in the tangent space at their current value. The priors of lens, mount,
offset, tags and motions are residuals too. They fix the gauge: without a reference, frames
determine the map only up to a common motion, and the survey as a whole fixes it (a free network;
ch. 9). The tags' sizes fix the scale.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy
from numpy.typing import NDArray

from kybflow.vision.projection import distort, rotation, slopes
from kybflow.world.cameras import Camera, Lens
from kybflow.world.tags import Tag

Array = NDArray[Any]

LENS, MOUNT, OFFSET, TAG, FRAME = 4, 6, 1, 4, 6
"""The number of corrections of the lens, the mount, the offset, a tag and the pose of a frame."""
TAGS = LENS + MOUNT + OFFSET
"""Index of the first tag's first correction."""
CORRECTIONS = {
    "focal": [0],
    "centre": [1, 2],
    "k1": [3],
    "mount position": [4, 5, 6],
    "mount attitude": [7, 8, 9],
    "offset": [10],
}
"""Indices of the corrections of lens, mount and clock, by kind."""
_NEAR = 1e-3


class Seen(NamedTuple):
    """Observed corners. frame, tag, corner: (k,) indices; corners are in the order of
    `Tag.corners`. pixel: (k, 2)."""

    frame: Array
    tag: Array
    corner: Array
    pixel: Array


class KnownPoses(NamedTuple):
    """The body's poses from a reference. frame: (k,) indices. position: (k, 3), world, metres.
    body: (k, 3, 3), rotations from body to world. velocity: (k, 3), world, m/s. rates: (k, 3),
    body, rad/s."""

    frame: Array
    position: Array
    body: Array
    velocity: Array
    rates: Array


class Block(NamedTuple):
    """Residuals of one kind. values: (k, r), divided by their standard deviation. unit: (k,),
    residuals with equal numbers are rejected together. columns (k, c) and slopes (k, r, c): the
    Jacobian."""

    kind: str
    values: Array
    unit: Array
    columns: Array
    slopes: Array


@dataclass(frozen=True)
class Walk:
    """The observations of a walk, and the prior values. at: (n, 3), approximate positions of the
    lens in each frame. turn: (n, 3, 3), its approximate rotations from optical frame to world."""

    camera: Camera
    tags: Sequence[Tag]
    at: Array
    turn: Array
    seen: Seen
    reference: KnownPoses | None = None

    @property
    def per_frame(self) -> int:
        """The number of corrections of a frame, twice as many for a rolling shutter."""
        return FRAME * (2 if self.camera.row_time > 0.0 else 1)

    @property
    def frames(self) -> int:
        """Index of the first frame's first correction."""
        return TAGS + TAG * len(self.tags)

    @property
    def size(self) -> int:
        """The number of corrections."""
        return self.frames + self.per_frame * len(self.at)

    @functools.cached_property
    def centres(self) -> Array:
        """The tags' centres as surveyed, (t, 3)."""
        return numpy.array([tag.position for tag in self.tags])

    @functools.cached_property
    def corners(self) -> Array:
        """The tags' surveyed corners, relative to their centres, (t, 4, 3)."""
        return numpy.array([tag.corners() for tag in self.tags]) - self.centres[:, None]

    @functools.cached_property
    def late(self) -> Array:
        """How long after the middle row each corner was read, seconds, (k, 1)."""
        lens = self.camera.lens
        rows: Array = self.seen.pixel[:, 1:]
        return (rows - 0.5 * (lens.height - 1)) * self.camera.row_time


def corrected_lens(lens: Lens, x: Array) -> Lens:
    """Return the lens corrected by `x`."""
    s, cx, cy, k1 = x[:LENS].tolist()
    first, *rest = lens.distortion
    return lens._replace(
        fx=lens.fx * (1.0 + s), fy=lens.fy * (1.0 + s), cx=lens.cx + cx, cy=lens.cy + cy,
        distortion=(first + k1, *rest),
    )  # fmt: skip


def turned(matrix: Array, vector: Array) -> Array:
    """Return `matrix` exp([`vector`]x), for k matrices (k, 3, 3) and vectors (k, 3)."""
    from scipy.spatial.transform import Rotation

    found: Array = matrix @ Rotation.from_rotvec(vector).as_matrix()
    return found


def rotation_vector(matrix: Array) -> Array:
    """Return the rotation vectors of rotation matrices, (k, 3)."""
    from scipy.spatial.transform import Rotation

    vectors: Array = Rotation.from_matrix(matrix).as_rotvec()
    return vectors


def poses(walk: Walk, x: Array) -> tuple[Array, Array, Array]:
    """Return the pose and motion of the lens in each frame: positions (n, 3), rotations from the
    optical frame to the world (n, 3, 3), and velocity and rates (n, 6)."""
    parts = x[walk.frames :].reshape(len(walk.at), walk.per_frame)
    motion = parts[:, FRAME:] if walk.per_frame > FRAME else numpy.zeros((len(parts), FRAME))
    return walk.at + parts[:, :3], turned(walk.turn, parts[:, 3:6]), motion


def mounting(camera: Camera, x: Array) -> tuple[Array, Array]:
    """Return the corrected position of the lens in the body, (3,), and the rotation from its
    optical frame to the body, (3, 3)."""
    first = x[LENS : LENS + MOUNT]
    turn = turned(numpy.eye(3), first[3:]) @ rotation(camera.attitude)
    return numpy.array(camera.position) + first[:3], turn


def blocks(walk: Walk, x: Array, sigma: Mapping[str, float]) -> Iterator[Block]:
    """Yield all residuals. sigma: the standard deviation of each kind, in its unit."""
    yield _corners(walk, x, sigma["corners"])
    if walk.reference is not None:
        yield from _reference(walk, walk.reference, x, sigma)
    yield from _beliefs(walk, x, sigma)


def _corners(walk: Walk, x: Array, sigma: float) -> Block:
    seen, lens = walk.seen, corrected_lens(walk.camera.lens, x)
    shift = x[TAGS : walk.frames].reshape(-1, TAG)[seen.tag]
    cosine, sine = numpy.cos(shift[:, 3]), numpy.sin(shift[:, 3])
    qx, qy, qz = walk.corners[seen.tag, seen.corner].T
    arm = numpy.stack((cosine * qx - sine * qy, sine * qx + cosine * qy, qz), axis=-1)
    at, turn, motion = (part[seen.frame] for part in poses(walk, x))
    at, turn = at + walk.late * motion[:, :3], turned(turn, walk.late * motion[:, 3:])
    c = numpy.einsum("kji,kj->ki", turn, walk.centres[seen.tag] + shift[:, :3] + arm - at)
    depth = numpy.maximum(c[:, 2:], _NEAR)
    flat = c[:, :2] / depth
    focal = numpy.array((lens.fx, lens.fy))
    through = focal[:, None] * numpy.moveaxis(numpy.array(slopes(lens, *flat.T)), -1, 0)
    u = through @ numpy.dstack((_eyes(len(c), 2), -flat[:, :, None])) / depth[:, :, None]
    along = numpy.einsum("kij,klj->kil", u, turn)
    sideways = numpy.stack((-arm[:, 1], arm[:, 0], numpy.zeros(len(arm))), axis=-1)
    pose = numpy.concatenate((-along, u @ skew(c)), axis=-1)
    pixel = distort(lens, flat)
    of_lens = numpy.stack(
        (
            (pixel - (lens.cx, lens.cy)) * (walk.camera.lens.fx / lens.fx),
            *numpy.broadcast_to(numpy.eye(2)[:, None], (2, len(c), 2)),
            focal * flat * (flat**2).sum(axis=1, keepdims=True),
        ),
        axis=-1,
    )
    parts = [of_lens, along, along @ sideways[:, :, None], pose]
    if walk.per_frame > FRAME:
        parts.append(pose * walk.late[:, :, None])
    columns = (
        numpy.broadcast_to(numpy.arange(LENS), (len(c), LENS)),
        _columns(TAGS, TAG, seen.tag),
        _columns(walk.frames, walk.per_frame, seen.frame),
    )
    unit = seen.frame * len(walk.tags) + seen.tag
    jacobian = numpy.concatenate(parts, axis=-1) / sigma
    return Block("corners", (pixel - seen.pixel) / sigma, unit, numpy.hstack(columns), jacobian)


def _reference(
    walk: Walk, known: KnownPoses, x: Array, sigma: Mapping[str, float]
) -> Iterator[Block]:
    at, turn, _ = (part[known.frame] for part in poses(walk, x))
    m, mount = mounting(walk.camera, x)
    offset = x[LENS + MOUNT]
    body = turn @ mount.T
    believed = turned(known.body, offset * known.rates)
    shape = (len(at), 3, 3)
    lever = body @ skew(m)
    moved = at - body @ m - known.position - offset * known.velocity
    turning = rotation_vector(numpy.swapaxes(believed, 1, 2) @ body)
    columns = numpy.hstack(
        (
            numpy.broadcast_to(numpy.arange(LENS, TAGS), (len(at), MOUNT + OFFSET)),
            _columns(walk.frames, walk.per_frame, known.frame)[:, :FRAME],
        )
    )
    position = (-body, -lever, -known.velocity[:, :, None], _eyes(len(at), 3), lever @ mount)
    attitude = (
        numpy.zeros(shape), -_eyes(len(at), 3), -known.rates[:, :, None],
        numpy.zeros(shape), numpy.broadcast_to(mount, shape),
    )  # fmt: skip
    for kind, values, parts in (
        ("reference position", moved, position),
        ("reference attitude", turning, attitude),
    ):
        jacobian = numpy.concatenate(parts, axis=-1) / sigma[kind]
        yield Block(kind, values / sigma[kind], known.frame, columns, jacobian)
    if walk.per_frame > FRAME:
        yield from _reference_motion(walk, known, x, sigma)


def _reference_motion(
    walk: Walk, known: KnownPoses, x: Array, sigma: Mapping[str, float]
) -> Iterator[Block]:
    """Yield the residuals of a rolling shutter's motion relative to the reference's, with the prior
    mount."""
    m, mount = mounting(walk.camera, numpy.zeros(TAGS))
    velocity = known.velocity + numpy.einsum("kij,kj->ki", known.body, numpy.cross(known.rates, m))
    motion = poses(walk, x)[2][known.frame]
    columns = _columns(walk.frames, walk.per_frame, known.frame)
    slope = _eyes(len(columns), 3)
    for kind, believed, first in (
        ("reference velocity", velocity, 0),
        ("reference rates", known.rates @ mount, 3),
    ):
        values = (motion[:, first : first + 3] - believed) / sigma[kind]
        own = columns[:, FRAME + first : FRAME + first + 3]
        yield Block(kind, values, known.frame, own, slope / sigma[kind])


def _beliefs(walk: Walk, x: Array, sigma: Mapping[str, float]) -> Iterator[Block]:
    """Yield the priors as residuals."""
    tags = numpy.arange(TAGS, walk.frames).reshape(-1, TAG)
    kinds = {kind: numpy.array([columns]) for kind, columns in CORRECTIONS.items()} | {
        "survey": tags[:, :3],
        "survey heading": tags[:, 3:],
    }
    frames = numpy.arange(walk.frames, walk.size).reshape(-1, walk.per_frame)
    kinds |= {
        "position": numpy.concatenate((frames[:, :3], tags[:, :3])),
        "attitude": frames[:, 3:FRAME],
        "heading": tags[:, 3:],
    }
    if walk.per_frame > FRAME:
        kinds |= {"velocity": frames[:, FRAME:-3], "rates": frames[:, -3:]}
    for kind, columns in kinds.items():
        unit = numpy.arange(len(columns))
        slope = _eyes(len(columns), columns.shape[1]) / sigma[kind]
        yield Block(kind, x[columns] / sigma[kind], unit, columns, slope)


def skew(vector: Array) -> Array:
    """Return the matrix [v]x of a vector or of an array of vectors, (..., 3, 3)."""
    x, y, z = numpy.moveaxis(vector, -1, 0)
    none = numpy.zeros_like(x)
    rows = ((none, -z, y), (z, none, -x), (-y, x, none))
    return numpy.stack([numpy.stack(row, axis=-1) for row in rows], axis=-2)


def _eyes(count: int, size: int) -> Array:
    return numpy.broadcast_to(numpy.eye(size), (count, size, size))


def _columns(first: int, size: int, which: Array) -> Array:
    """Return the Jacobian's columns of items with `size` corrections each, (k, size)."""
    columns: Array = first + size * which[:, None] + numpy.arange(size)
    return columns
