"""Signals are counted, and given back."""

from __future__ import annotations

import signal
from types import SimpleNamespace

import pytest

from kybflow.runtime.interrupts import DEBOUNCE_S, Interrupts


def test_what_a_closed_terminal_sends_at_once_is_one_interrupt_and_a_later_one_another():
    engine, clock = SimpleNamespace(interrupts=0), [100.0]
    before = signal.getsignal(signal.SIGTERM)
    with Interrupts(engine, lambda: clock[0]):
        signal.raise_signal(signal.SIGHUP)
        signal.raise_signal(signal.SIGTERM)
        assert engine.interrupts == 1
        clock[0] += DEBOUNCE_S
        signal.raise_signal(signal.SIGINT)
        assert engine.interrupts == 2
    assert signal.getsignal(signal.SIGTERM) is before


def test_ctrl_backslash_is_an_interrupt():
    engine = SimpleNamespace(interrupts=0)
    with Interrupts(engine):
        signal.raise_signal(signal.SIGQUIT)
    assert engine.interrupts == 1


@pytest.mark.parametrize("number", [signal.SIGUSR1, signal.SIGUSR2])
def test_a_signal_without_a_meaning_is_none_and_is_given_back(number: signal.Signals):
    engine, before = SimpleNamespace(interrupts=0), signal.getsignal(number)
    with Interrupts(engine):
        signal.raise_signal(number)
    assert engine.interrupts == 0
    assert signal.getsignal(number) is before
