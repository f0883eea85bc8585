"""Video frames out of a stream."""

from __future__ import annotations

import pytest
from ardrone_recordings import recording
from hypothesis import given
from hypothesis import strategies as st

from kybflow.vision.video.pave import FrameCutter, VideoFrame, write_frame

FRAMES = [VideoFrame(4, 640, 360, n, 33 * n, 1 if n == 0 else 3, bytes([n]) * 50) for n in range(5)]


@given(st.integers(1, 200))
def test_frames_come_out_of_chunks_of_any_size(size):
    stream, cutter = b"".join(map(write_frame, FRAMES)), FrameCutter()
    found = []
    for at in range(0, len(stream), size):
        found += cutter.take(stream[at : at + size])
    assert found == FRAMES
    assert cutter.skipped == 0


def test_what_is_no_frame_is_skipped():
    cutter = FrameCutter()
    assert cutter.take(b"junk" + write_frame(FRAMES[0]) + b"PaVE" + b"\xff" * 100) == FRAMES[:1]
    assert cutter.take(write_frame(FRAMES[1])) == FRAMES[1:2]
    assert cutter.skipped > 4


@given(st.binary(max_size=500))
def test_no_bytes_raise(data):
    cutter = FrameCutter()
    cutter.take(data)
    cutter.take(b"PaVE" + data)


@pytest.mark.parametrize(("name", "count"), [("pave.bin", 20), ("pave-68.bin", None)])
def test_frames_of_a_real_drone(name, count):
    data, cutter = recording(name), FrameCutter()
    frames = [
        frame for at in range(0, len(data), 1000) for frame in cutter.take(data[at : at + 1000])
    ]
    assert cutter.skipped == 0
    assert frames
    assert count in (None, len(frames))
    assert {(frame.codec, frame.width, frame.height) for frame in frames} == {(4, 640, 360)}
    assert all(frame.payload.startswith(b"\0\0\0\1") for frame in frames)
