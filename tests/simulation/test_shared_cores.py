"""Simulations on the cores that other threads leave idle: the same bits, and no more threads than cores."""

import threading
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from importlib import import_module

import numpy as np
import pytest

from brightgrey.excitation import PAPER_EXPERIMENT as E
from brightgrey.excitation.random_drives import random_values
from brightgrey.kit import PAPER, assemble
from brightgrey.simulation import Settings, response, shared_cores
from brightgrey.simulation.response import squares
from brightgrey.simulation.shared_cores import on_idle_cores

SETS = 40
OUTPUTS = ("position", "velocity", "acceleration")


def counted(most):
    """Number of threads on which a part runs at the same time, where up to `most` idle cores are asked for."""
    running, threads = threading.Barrier(max(1 + most, 1)), set()

    def part(numbers):
        threads.add(threading.get_ident())
        with suppress(threading.BrokenBarrierError):
            running.wait(0.2)

    on_idle_cores(part, (), most)
    return len(threads)


def test_on_idle_cores__no_cores_offered__here_alone():
    assert counted(2) == 1


@pytest.mark.parametrize(("cores", "most", "threads"), [(1, 3, 1), (2, 3, 2), (4, 3, 4), (8, 1, 2), (4, -1, 1)])
def test_on_idle_cores__offered_cores__so_many_threads(cores, most, threads):
    with shared_cores(cores):
        assert counted(most) == threads
    assert counted(most) == 1


def test_on_idle_cores__other_threads_at_work__takes_what_they_leave():
    inside, done = threading.Barrier(3), threading.Event()

    def work():
        on_idle_cores(lambda numbers: (inside.wait(10.0), done.wait(10.0)), (), 0)

    with shared_cores(4), ThreadPoolExecutor(2) as pool:
        busy = [pool.submit(work) for _ in range(2)]
        inside.wait(10.0)
        assert counted(3) == 2
        done.set()
        for each in busy:
            each.result()
        assert counted(3) == 4


def test_on_idle_cores__part_fails__others_end_what_they_have_begun_and_no_more():
    own, begun, failed, ended = threading.get_ident(), threading.Event(), threading.Event(), []

    def part(numbers):
        if threading.get_ident() == own:
            assert begun.wait(10.0)
            failed.set()
            raise KeyboardInterrupt
        for number in numbers:
            begun.set()
            assert failed.wait(10.0)
            threading.Event().wait(0.05)  # until the error is known
            ended.append(number)

    with shared_cores(2):
        with pytest.raises(KeyboardInterrupt):
            on_idle_cores(part, range(1000), 1)
        assert ended == [0]
        assert counted(1) == 2


def test_on_idle_cores__within_a_part__thread_has_its_core_already():
    found = []
    with shared_cores(2):
        on_idle_cores(lambda numbers: found.append(counted(1)), (), 0)
    assert found == [2]


def test_on_idle_cores__more_parts_within_parts_than_threads__ends():
    def inner(numbers):
        for _ in numbers:
            threading.Event().wait(1e-3)

    def outer(numbers):
        for _ in numbers:
            on_idle_cores(inner, range(4), 3)

    with shared_cores(200):
        on_idle_cores(outer, range(100), 99)


@pytest.mark.parametrize("name", ["two_mass+coulomb+viscous+backlash", "three_mass+stribeck+delay"])
@pytest.mark.parametrize("group", [1, 5, 20])
def test_response__idle_cores__same_bits(name, group, monkeypatch):
    structure, u = PAPER.parse(name), E.torque()
    values = random_values(structure.parameters, np.random.default_rng(3))
    sets = {n: value * (1.0 + 1e-3 * np.arange(SETS)) for n, value in values.items()}
    system, how = assemble(structure, sets, E.f_tanh, OUTPUTS), Settings(E.f_tanh, E.speed, "fast")
    x0 = system.rest(u=u[0])
    y = response(system, u, E.dt, x0, how, group=group).y
    weights, none, limits = np.ones(3), np.zeros(SETS), np.full(SETS, np.inf)
    cost = squares(system, u, E.dt, x0, how, 0.5 * y[:, :, 0], weights, sums=none, upper_limits=limits)
    asked = []
    monkeypatch.setattr(
        import_module("brightgrey.simulation.response"),  # the package has a function of this name
        "on_idle_cores",
        lambda part, numbers, most: (asked.append(most), on_idle_cores(part, numbers, most)),
    )
    with shared_cores(3):
        np.testing.assert_array_equal(response(system, u, E.dt, x0, how, group=group).y, y)
        again = squares(system, u, E.dt, x0, how, 0.5 * y[:, :, 0], weights, sums=none, upper_limits=limits)
    np.testing.assert_array_equal(again, cost)
    assert min(asked) >= 1  # or it would say nothing
