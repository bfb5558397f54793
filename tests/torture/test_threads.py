"""A few cells of scene, form and solver, cold in many threads; `make torture` runs all of them."""

from torture.threads import threaded


def test_cold_threads_give_the_bits_of_one_thread():
    assert threaded(seed=1, rounds=1, every=67) == []
