"""`airframes.NAME.cameras` to the cameras that it means."""

from __future__ import annotations

from math import tan

from kybflow.core.geometry import Quat, from_axes, from_euler, multiply
from kybflow.dsl.diagnostics.diagnostic import Diagnosed, Diagnostic, every
from kybflow.dsl.document import CameraEntry
from kybflow.dsl.reading.calibration import read_calibration
from kybflow.dsl.reading.nodes import Mapping, MappingEntry, Node, entries_of
from kybflow.dsl.schema.world import AirframeCameraParams
from kybflow.dsl.shaping.parts import params_of
from kybflow.world.cameras import DOWN, Camera, Lens

CODES = {
    "KYB385": "A camera whose lens is not described, or twice in one place: it has `calibration`, "
    "or `width`, `height` and `field_of_view`. Of what came through `like`, the nearer one counts.",
}
_LENS = ("width", "height", "field_of_view")


_DOWNWARD = (0.0, 0.0, -1.0)
FACING: dict[str, Quat] = {
    "down": DOWN,
    "up": from_axes((0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
    "forward": from_axes((0.0, -1.0, 0.0), _DOWNWARD, (1.0, 0.0, 0.0)),
    "backward": from_axes((0.0, 1.0, 0.0), _DOWNWARD, (-1.0, 0.0, 0.0)),
    "left": from_axes((1.0, 0.0, 0.0), _DOWNWARD, (0.0, 1.0, 0.0)),
    "right": from_axes((-1.0, 0.0, 0.0), _DOWNWARD, (0.0, -1.0, 0.0)),
}
"""Optical frame to body. Down and up have the image's upper edge forward, the others up."""


def without_cameras(airframe: Mapping) -> Mapping:
    """The airframe's entries but for `cameras`."""
    own = {key: entry for key, entry in airframe.entries.items() if key != "cameras"}
    return Mapping(own, airframe.span)


def cameras_of(airframe: Node | None) -> Diagnosed[tuple[CameraEntry, ...]]:
    """The cameras of an airframe; one with errors is left out."""
    cameras = airframe.get("cameras") if isinstance(airframe, Mapping) else None
    found = yield from every(_camera(entry) for entry in entries_of(cameras).values())
    return tuple(camera for camera in found if camera is not None)


def _camera(entry: MappingEntry) -> Diagnosed[CameraEntry | None]:
    if not isinstance(entry.value, Mapping):
        return None
    name, body = entry.key, _with_nearest_lens(entry.value)
    params = yield from params_of(AirframeCameraParams, body, "camera", name.span)
    lens = None if params is None else (yield from _lens(params, entry, body))
    if params is None or lens is None:
        return None
    trim = from_euler(params.roll, params.pitch, params.yaw)
    attitude = multiply(trim, FACING[params.facing])
    camera = Camera(name.text, lens, params.at, attitude, params.rate, params.row_time)
    spans = {key: own.value.span for key, own in body.entries.items()}
    return CameraEntry(name.as_text, params, camera, name.span, spans)


def _with_nearest_lens(body: Mapping) -> Mapping:
    """A calibration takes the place of the lens that the camera was `like`, and the other way
    round."""
    lens = [body.entries[key] for key in _LENS if body.get(key) is not None]
    if not lens or body.get("calibration") is None:
        return body
    own, other = body.entries["calibration"].depth, min(entry.depth for entry in lens)
    passed = _LENS if own < other else ("calibration",) if own > other else ()
    return Mapping({k: e for k, e in body.entries.items() if k not in passed}, body.span)


def _lens(
    params: AirframeCameraParams, entry: MappingEntry, body: Mapping
) -> Diagnosed[Lens | None]:
    written = [key for key in _LENS if getattr(params, key) is not None]
    missing = [key for key in _LENS if key not in written]
    if params.calibration is not None and written:
        depth = body.entries["calibration"].depth
        written = [key for key in written if body.entries[key].depth == depth]
        message = f"the calibration of `{entry.key.text}` says its {' and '.join(written)} already"
        span, hint = body.entries[written[0]].key.span, "write one of both"
        yield Diagnostic("KYB385", message.replace("_", " "), span, help=hint)
        return None
    if params.calibration is not None:
        return read_calibration(params.calibration)
    if params.width is None or params.height is None or params.field_of_view is None:
        message = f"the camera `{entry.key.text}` needs `{missing[0]}`"
        hint = "write `width`, `height` and `field_of_view`, or `calibration: FILE`"
        yield Diagnostic("KYB385", message, entry.key.span, help=hint)
        return None
    return pinhole(params.width, params.height, params.field_of_view)


def pinhole(width: int, height: int, field_of_view: float) -> Lens:
    """A lens without distortion, square pixels, its axis through the middle of the image;
    field_of_view: angle between the image's left and right edges."""
    focal = 0.5 * width / tan(0.5 * field_of_view)
    return Lens(width, height, focal, focal, 0.5 * (width - 1), 0.5 * (height - 1))
