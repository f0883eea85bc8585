"""The stream of setpoints: its rate, and its end."""

from __future__ import annotations

from scripted_autopilot import at

from kybflow.core.signals import NS
from kybflow.drivers.mavlink.control.setpoints import SetpointStream

MS = NS // 1000


def sent(stream, start, end, step=4, feeds=None):
    """When (ms) something was due."""
    times = []
    for ms in range(start, end, step):
        if feeds is not None:
            stream.feed(feeds, ms * MS)
        if stream.due(ms * MS) is not None:
            times.append(ms)
    return times


def test_set_points_go_out_at_their_own_rate():
    times = sent(SetpointStream(50.0), 0, 1000, feeds=at((0.0, 0.0, 1.0)))
    assert times == list(range(0, 1000, 20))


def test_a_rate_that_does_not_divide_the_tick_is_kept_on_average():
    times = sent(SetpointStream(30.0), 0, 10_000, feeds=at((0.0, 0.0, 1.0)))
    assert len(times) == 300


def test_the_newest_command_is_resent_until_it_is_250_ms_old():
    stream = SetpointStream(50.0)
    stream.feed(at((0.0, 0.0, 1.0)), 0)
    assert sent(stream, 0, 2000)[-1] == 240
    assert stream.flows(2000 * MS) == 0.0


def test_a_late_tick_is_not_caught_up_by_a_burst():
    stream = SetpointStream(50.0)
    command = at((0.0, 0.0, 1.0))
    sent(stream, 0, 100, feeds=command)
    stream.feed(command, 300 * MS)
    assert len(sent(stream, 300, 340)) == 2


def test_a_stream_that_stopped_begins_anew():
    stream = SetpointStream(50.0)
    sent(stream, 0, 2000, feeds=at((0.0, 0.0, 1.0)))
    stream.stop()
    assert stream.due(2000 * MS) is None
    stream.feed(at((0.0, 0.0, 1.0)), 3000 * MS)
    assert stream.flows(3500 * MS) == 0.5
