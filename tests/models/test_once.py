import gc
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from threading import Barrier, Event, Thread
from weakref import ref

import numpy as np
import pytest

from polhode.models.once import Once, OncePerThread, once
from polhode.models.own_function import OwnField, own_field
from polhode.models.problem import Problem
from polhode.solvers.compile import c_callback

THREADS = 8


def together(function):
    """What a function returns in several threads at the same time."""
    barrier = Barrier(THREADS)

    def call(number: int):
        barrier.wait()
        return function(number)

    with ThreadPoolExecutor(THREADS) as pool:
        return list(pool.map(call, range(THREADS)))


def test_threads_share_one_computation():
    calls = []

    @once()
    def slow(key: int) -> object:
        calls.append(key)
        time.sleep(0.02)
        return object()

    assert len(set(together(lambda number: slow(1)))) == 1
    assert calls == [1]


def test_different_results_are_computed_side_by_side():
    barrier = Barrier(THREADS, timeout=10)

    @once()
    def waiting(key: int) -> int:
        barrier.wait()
        return -key

    assert together(waiting) == [-number for number in range(THREADS)]


def test_an_exception_is_raised_and_not_cached():
    fails = [True]

    @once()
    def sometimes(key: int) -> int:
        if fails[0]:
            raise ValueError("not yet")
        return key

    with pytest.raises(ValueError, match="not yet"):
        sometimes(3)
    fails[0] = False
    assert sometimes(3) == 3


@pytest.mark.parametrize("cleared", [False, True])
def test_an_exception_or_a_cleared_cache_starts_no_second_computation(cleared: bool):
    """The first computation is disturbed while another thread waits for its result; then a third asks."""
    running = []
    most_running = []
    disturbed = Event()

    @once()
    def slow(key: int) -> object:
        running.append(key)
        most_running.append(len(running))
        first = len(most_running) == 1
        try:
            if first:
                disturbed.wait(10)
            else:
                time.sleep(0.2)
            if first and not cleared:
                raise ValueError("not yet")
            return object()
        finally:
            running.pop()

    with ThreadPoolExecutor(3) as pool:
        first = pool.submit(slow, 1)
        while not most_running:
            time.sleep(0.001)
        second = pool.submit(slow, 1)
        time.sleep(0.05)
        if cleared:
            slow.cache_clear()
            third = pool.submit(slow, 1)
            time.sleep(0.05)
            disturbed.set()
        else:
            disturbed.set()
            with pytest.raises(ValueError, match="not yet"):
                first.result()
            third = pool.submit(slow, 1)
        results = {second.result(), third.result()}
    assert max(most_running) == 1
    assert results == {slow(1)}
    assert len(most_running) == (1 if cleared else 2)


def test_results_not_used_for_the_longest_time_go_first():
    calls = []

    @once(size=2)
    def recorded(key: int) -> int:
        calls.append(key)
        return key

    for key in (1, 2, 1, 3, 1, 2):
        assert recorded(key) == key
    assert calls == [1, 2, 3, 2]
    assert len(recorded) == 2


def test_names_of_arguments_belong_to_the_key():
    @once()
    def named(key: int, *, double: bool = False) -> int:
        return key * (1 + double)

    assert [named(2), named(2, double=True), named(2)] == [2, 4, 2]


def test_a_result_per_thread():
    @OncePerThread
    def own(key: int) -> object:
        return object()

    results = together(lambda number: (own(1), own(1)))
    assert all(first is second for first, second in results)
    assert len({first for first, _ in results}) == THREADS


def closure(number: float):
    """A field of a function that holds a large array, and a weak reference to that function."""
    captured = np.full(1000, number)

    def rates(t, y):
        return [-captured[0] * y[1], captured[0] * y[0]]

    _, field = own_field(rates, [1.0, 0.0], (0.0, 1.0), ())
    return field, ref(rates)


def test_a_freed_function_frees_its_result_and_what_it_captured():
    compiled: Once = Once(lambda field: bytearray(10))
    field, function = closure(2.0)
    same = replace(field)
    assert compiled(field) is compiled(same)
    assert len(compiled) == 1
    del field, same
    gc.collect()
    assert function() is None
    assert len(compiled) == 0


def test_a_method_of_an_object_is_found_again_and_freed_with_the_object():
    class Rotor:
        def rates(self, t, y):
            return [-y[1], y[0]]

    compiled: Once = Once(lambda field: bytearray(10))
    rotor = Rotor()
    first, second = (own_field(rotor.rates, [1.0, 0.0], (0.0, 1.0), ())[1] for _ in range(2))
    assert compiled(first) is compiled(second)
    del rotor, first, second
    gc.collect()
    assert len(compiled) == 0


def test_fields_of_one_function_and_other_times_are_different():
    compiled: Once = Once(lambda field: object())
    field, _ = closure(2.0)
    later = OwnField(field.function, True, 1.0, 2.0)
    assert compiled(field) is not compiled(later)
    assert compiled(field) is compiled(field)


def test_functions_may_die_while_others_are_looked_up():
    compiled: Once = Once(lambda field: object(), size=3)
    kept, _ = closure(0.0)
    stop = []

    def look():
        while not stop:
            assert compiled(kept) is not None

    threads = [Thread(target=look) for _ in range(2)]
    for thread in threads:
        thread.start()
    for number in range(200):
        compiled(closure(float(number))[0])
    stop.append(True)
    for thread in threads:
        thread.join()
    gc.collect()
    assert len(compiled) == 1


def test_machine_code_lives_as_long_as_it_is_held():
    # A full cache would drop another entry for this one.
    c_callback.cache_clear()
    before = len(c_callback)
    problem = Problem.from_function(lambda t, y: [-y[1], y[0]], [1.0, 0.0], 1.0)
    code = c_callback(problem.field, 2, 0)
    assert len(c_callback) == before + 1
    engine = ref(code.engine)
    del problem
    gc.collect()
    assert len(c_callback) == before
    assert engine() is not None
    del code
    gc.collect()
    assert engine() is None


def test_a_function_that_survives_asking_for_its_own_result_ends():
    @once()
    def own(number: int) -> int:
        try:
            return own(number)
        except RecursionError:
            return number

    assert own(3) == 3
