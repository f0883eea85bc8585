"""The output of `kybflow calibrate`: the corrections of a walk with their spreads."""

from __future__ import annotations

from collections.abc import Iterator
from math import degrees
from typing import NamedTuple

from kybflow.vision.calibration.adjust import BELIEVED
from kybflow.vision.calibration.model import CORRECTIONS, LENS, MOUNT, TAGS
from kybflow.vision.calibration.walk import WalkCalibration

_ADVICE = {
    "focal": "tilt the camera by 20 to 30 degrees, to all sides, and change its height",
    "centre": "tilt the camera to all sides, and turn it about the vertical",
    "k1": "let tags appear in the image's corners",
    "mount position": "tilt the body to all sides while its position is known",
    "mount attitude": "tilt the body to all sides while its position is known",
}
"""How to move the camera so that a kind of correction becomes observable."""
_UNKNOWN = "not observable"
_COLUMNS = f"{'now':>12}{'correction':>14}{'spread':>13}"
_LIMITS = {
    "corners": (0.5, "is it this lens, and this `row_time`?"),
    "survey": (0.05, "are `size` and `rows` those of the floor?"),
    "survey heading": (0.1, "are `heading` and `rows` those of the floor?"),
    "reference position": (0.02, "are these the poses of this body on this walk?"),
    "reference attitude": (0.05, "are these the poses of this body on this walk?"),
}
"""For each kind of measurement, the standard deviation (in its unit) above which an uncorrected
error is likely, and a question about the likely cause."""
_METRES = frozenset({"survey", "reference position"})
_SIGMAS = 4.0
"""Standard deviations of the prior above which a correction is reported as doubtful."""
_AMISS = {
    **dict.fromkeys(("focal", "centre", "k1"), "is it this camera?"),
    "mount position": "are the poses those of this body?",
    "mount attitude": "are the poses those of this body, and is `facing` right?",
}


class _Row(NamedTuple):
    """A correction in `unit`. value: the corrected value. off: the correction. digits: decimals.
    is_told: whether the walk improves on the prior. kind: the kind of correction."""

    name: str
    value: float | None
    off: float
    spread: float
    digits: int
    unit: str
    is_told: bool
    kind: str

    def __str__(self) -> str:
        digits, unit = self.digits, self.unit
        value = "" if self.value is None else f"{self.value:.{digits}f} {unit}".rstrip()
        off = f"{self.off:+.{digits}f} {unit}".rstrip()
        spread = f"{max(self.spread, 0.0):.{digits + 1}f} {unit}".rstrip()
        end = "" if self.is_told else f"  {_UNKNOWN}"
        return f"  {self.name:<16}{value:>12}{off:>14}{spread:>13}{end}"


def calibration_lines(found: WalkCalibration, read: int, total: int) -> Iterator[str]:
    """Yield lines about all corrections and doubtful results. read, total: the number of frames
    that were used, and of all frames."""
    walk, adjusted = found.walk, found.adjusted
    seen, name = walk.seen, walk.camera.name
    yield f"frames: {len(walk.at)} of {read} show tags, out of {total}"
    yield f"tags: {len(walk.tags)}, {len(seen.frame)} corners, {adjusted.sigma['corners']:.2f} px"
    used = adjusted.used
    if not used["corners"].all():
        wrong = ~used["corners"]
        sightings = len(set(zip(seen.frame[wrong], seen.tag[wrong], strict=True)))
        yield f"left out: {sightings} sightings of tags that don't fit"
    poses = used.get("reference position")
    if poses is not None and not poses.all():
        yield f"left out: {int((~poses).sum())} of {len(poses)} poses that don't fit"
    if found.ahead is not None:
        yield f"clock: the poses are {found.ahead:+.3f} s ahead of the frames"
    yield ""
    lens = list(_lens(found))
    yield f"{f'lens of `{name}`':<18}{_COLUMNS}"
    yield from map(str, lens)
    yield ""
    if walk.reference is None:
        yield f"mount of `{name}`: not observable from frames alone; give the body's poses:"
        yield "  --poses FILE (motion capture), or --standing (at its start in the first frame)"
    else:
        mount = list(_mount(found))
        lens += mount
        yield f"{f'mount of `{name}`':<18}{_COLUMNS}"
        yield from map(str, mount)
    yield ""
    yield from _map(found)
    for kind in dict.fromkeys(row.kind for row in lens if not row.is_told):
        yield f"{_UNKNOWN}: {kind}; {_ADVICE[kind]}"
    yield from _doubts(found)


def _doubts(found: WalkCalibration) -> Iterator[str]:
    for kind, (limit, question) in _LIMITS.items():
        spread = found.adjusted.sigma[kind]
        if spread > limit:
            unit = "px" if kind == "corners" else "m" if kind in _METRES else "rad"
            yield f"doubtful: {kind}, off by {spread:.2f} {unit}; {question}"
    for kind, columns in CORRECTIONS.items():
        if kind in _AMISS and (abs(found.adjusted.x[columns]) > _SIGMAS * BELIEVED[kind]).any():
            yield f"doubtful: {kind}, far from its prior; {_AMISS[kind]}"


def _lens(found: WalkCalibration) -> Iterator[_Row]:
    before, after, spreads = found.walk.camera.lens, found.camera.lens, found.spreads
    for name, old, new, spread, unit, kind in (
        ("fx", before.fx, after.fx, spreads[0] * before.fx, "px", "focal"),
        ("fy", before.fy, after.fy, spreads[0] * before.fy, "px", "focal"),
        ("cx", before.cx, after.cx, spreads[1], "px", "centre"),
        ("cy", before.cy, after.cy, spreads[2], "px", "centre"),
        ("k1", before.distortion[0], after.distortion[0], spreads[3], "", "k1"),
    ):
        told = found.is_determined(spread / (before.fx if kind == "focal" else 1.0), kind)
        digits = 2 if unit else 4
        yield _Row(name, new, new - old, spread, digits, unit, told, kind)


def _mount(found: WalkCalibration) -> Iterator[_Row]:
    correction = found.adjusted.x[LENS : LENS + MOUNT]
    spreads = found.spreads[LENS : LENS + MOUNT]
    for i, name in enumerate(("x", "y", "z")):
        kind, value = "mount position", 1000.0 * found.camera.position[i]
        told = found.is_determined(spreads[i], kind)
        yield _Row(name, value, 1e3 * correction[i], 1e3 * spreads[i], 1, "mm", told, kind)
    for i, name in enumerate(("roll", "pitch", "yaw"), start=3):
        kind = "mount attitude"
        told = found.is_determined(spreads[i], kind)
        off, spread = degrees(correction[i]), degrees(spreads[i])
        yield _Row(name, None, off, spread, 2, "deg", told, kind)


def _map(found: WalkCalibration) -> Iterator[str]:
    spreads = found.spreads[TAGS : found.walk.frames].reshape(-1, 4)
    title = ("x", "y", "z", "heading", "spread", "")
    yield f"{'map, mm and deg':<18}" + "".join(f"{word:>9}" for word in title).rstrip()
    for tag, shift, spread, wrong in zip(
        found.walk.tags, found.shifts, spreads, found.displaced, strict=True
    ):
        off = "".join(f"{1e3 * metres:>+9.1f}" for metres in shift[:3])
        sure = f"{1e3 * spread[:3].max():>9.1f}{degrees(spread[3]):>9.2f}"
        end = "  lies elsewhere" if wrong else ""
        name = f"{tag.family} {tag.id}"
        yield f"  {name:<16}{off}{degrees(shift[3]):>+9.2f}{sure}{end}"
