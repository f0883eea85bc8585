"""Draws random true calibrations of cameras and tags around the assumed ones.

Each error is normal, with its standard deviation from `CalibrationErrors`. It depends only on the
seed and on the tag's family and number or the camera's name, so that the same seed gives the same
errors, whatever else is in the lab. Localization keeps using the assumed calibration.
"""

from __future__ import annotations

import random
from typing import NamedTuple

import numpy

from kybflow.core.geometry import add, from_axes, from_heading, multiply
from kybflow.vision.calibration.model import corrected_lens, mounting
from kybflow.world.cameras import CalibrationErrors, Camera, share_of
from kybflow.world.tags import Tag, TagMap


class Setup(NamedTuple):
    """The calibration of a lab. stamps: error of the frames' time stamps, seconds."""

    tags: TagMap
    cameras: tuple[Camera, ...]
    stamps: float


def miscalibrated(believed: Setup, errors: CalibrationErrors, seed: int) -> Setup:
    """Return the true setup, given the assumed one."""
    stamps = random.Random(f"{seed}/stamps").gauss(0.0, errors.stamp_error)
    tags: list[Tag] = []
    for tag in believed.tags:
        gauss = random.Random(f"{seed}/laid/{tag.family}/{tag.id}").gauss
        share = share_of(tag.size)
        across, up = share * errors.survey_error, share * errors.height_error
        at = add(tag.position, (gauss(0.0, across), gauss(0.0, across), gauss(0.0, up)))
        turned = multiply(from_heading(gauss(0.0, errors.survey_turn)), tag.attitude)
        tags.append(tag._replace(position=at, attitude=turned))
    cameras: list[Camera] = []
    for camera in believed.cameras:
        gauss = random.Random(f"{seed}/mounted/{camera.name}").gauss
        spreads = [errors.focal_error, 0.0, 0.0, errors.k1_error]
        spreads += [errors.mount_error] * 3 + [errors.mount_misalignment] * 3
        corrections = numpy.array([gauss(0.0, spread) for spread in spreads])
        lens = corrected_lens(camera.lens, corrections)
        position, turn = mounting(camera, corrections)
        (mx, my, mz), (x, y, z) = position.tolist(), turn.T.tolist()
        attitude = from_axes(tuple(x), tuple(y), tuple(z))
        cameras.append(camera._replace(lens=lens, position=(mx, my, mz), attitude=attitude))
    return Setup(TagMap(tags), tuple(cameras), believed.stamps + stamps)
