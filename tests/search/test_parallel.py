"""Calls in parallel: their order, their threads, their errors."""

import threading
from functools import partial

import pytest

from brightgrey.search.parallel import simultaneous
from brightgrey.simulation import shared_cores


def slow_first(number):
    threading.Event().wait(0.05 if number == 0 else 0.0)
    return number, threading.get_ident()


@pytest.mark.parametrize("cores", [1, 2, 4])
def test_simultaneous__results_in_order_on_no_more_threads_than_cores(cores):
    with shared_cores(cores):
        found = simultaneous([partial(slow_first, number) for number in range(8)])
    assert [number for number, _ in found] == list(range(8))
    assert (1 if cores == 1 else 2) <= len({thread for _, thread in found}) <= cores


def test_simultaneous__no_calls__nothing():
    assert simultaneous([]) == []


def test_simultaneous__a_call_fails__raises():
    def fail():
        raise ZeroDivisionError

    with shared_cores(2), pytest.raises(ZeroDivisionError):
        simultaneous([lambda: 1, fail, lambda: 2])
