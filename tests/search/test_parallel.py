"""Calls in parallel: their order, their threads, their errors."""

import threading
from functools import partial

import pytest

from brightgrey.search.parallel import simultaneous
from brightgrey.simulation import shared_cores


def test_simultaneous__no_idle_core__in_order_on_one_thread():
    found = simultaneous([partial(lambda number: (number, threading.get_ident()), number) for number in range(4)])
    assert found == [(number, threading.get_ident()) for number in range(4)]


def test_simultaneous__idle_core__a_call_waits_for_a_later_one_and_results_stay_in_order():
    later = threading.Event()
    with shared_cores(2):
        assert simultaneous([lambda: later.wait(60.0), lambda: later.set() or "later"]) == [True, "later"]


def test_simultaneous__no_calls__nothing():
    assert simultaneous([]) == []


def test_simultaneous__a_call_fails__raises():
    def fail():
        raise ZeroDivisionError

    with shared_cores(2), pytest.raises(ZeroDivisionError):
        simultaneous([lambda: 1, fail, lambda: 2])
