"""Signals are counted, and given back."""

from __future__ import annotations

import signal
from types import SimpleNamespace

from kybflow.runtime.interrupts import DEAF, Interrupts


def test_what_a_closed_terminal_sends_at_once_is_one_interrupt_and_a_later_one_another():
    engine, clock = SimpleNamespace(interrupts=0), [100.0]
    before = signal.getsignal(signal.SIGTERM)
    with Interrupts(engine, lambda: clock[0]):
        signal.raise_signal(signal.SIGHUP)
        signal.raise_signal(signal.SIGTERM)
        assert engine.interrupts == 1
        clock[0] += DEAF
        signal.raise_signal(signal.SIGINT)
        assert engine.interrupts == 2
    assert signal.getsignal(signal.SIGTERM) is before
