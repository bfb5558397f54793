"""Results that are computed once, whatever the number of threads that ask for them.

The latest ones are cached.

A call that finds its result takes no lock. Threads that miss the same result wait for the one that
computes it, those that miss others do not. A result may leave the cache at any time. For machine
code that is safe: callers keep the object that owns the code.
"""

from collections.abc import Callable
from functools import update_wrapper
from itertools import count
from threading import RLock, local
from typing import Any, Generic, ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")

# Results of one function that are cached. An estimate that bounds memory: a compiled field takes
# 0.8 MB. A user who goes through more fields than this by turns waits for each again.
_MAX_CACHED = 64
# The same for one thread: an integrator of heyoka takes 0.2 to 0.7 MB.
_MAX_CACHED_IN_THREAD = 16

# Counts the uses of all results, so that the latest use has the largest number.
_clock = count()


class _Entry:
    """A result, or the place where it will be."""

    __slots__ = ("failed", "last_use", "lock", "ready", "value")

    def __init__(self) -> None:
        # Held by the thread that computes the result. A function that asks for the very result that it
        # computes gets a RecursionError; with a plain Lock it would wait for itself without end.
        self.lock = RLock()
        self.ready = False
        # The computation raised an exception, and the entry has left the cache.
        self.failed = False
        self.value: Any = None
        self.last_use = next(_clock)


class Once(Generic[P, R]):
    """A function whose results are computed once; see `once`."""

    def __init__(self, function: Callable[P, R], size: int = _MAX_CACHED) -> None:
        self.function = function
        self.size = size
        self._entries: dict[tuple[Any, ...], _Entry] = {}
        # Held while entries are added, or dropped by `_trim` and `cache_clear`. Results are computed
        # under the entry's lock. Meanwhile the garbage collector may run a finaliser that asks for a
        # result in the same thread, which a plain Lock would stop for good.
        self._lock = RLock()
        # `update_wrapper` sets both again, where type checkers do not see it.
        self.__wrapped__ = function
        self.__qualname__ = function.__qualname__
        update_wrapper(self, function)

    def __call__(self, *arguments: P.args, **named: P.kwargs) -> R:
        """The result for the arguments."""
        key = (*arguments, *sorted(named.items())) if named else arguments
        entry = self._entries.get(key)
        if entry is None or not entry.ready:
            entry = self._computed(key, *arguments, **named)
        entry.last_use = next(_clock)
        return entry.value

    def __reduce__(self) -> str:
        # Pickled by its name, as functions are.
        return self.__qualname__

    def __len__(self) -> int:
        """Number of results that are cached now, those included that a thread is computing."""
        return len(self._entries)

    def cache_clear(self) -> None:
        """Forget all results, but for those that a thread is computing: these will be cached."""
        with self._lock:
            for key, entry in self._entries.copy().items():
                if entry.ready:
                    self._entries.pop(key, None)

    def _computed(self, key: tuple[Any, ...], *arguments: P.args, **named: P.kwargs) -> _Entry:
        """The entry of a key with its result, computed here unless another thread does or did."""
        entry = self._entry(key)
        while not entry.ready:
            with entry.lock:
                if not (entry.ready or entry.failed):
                    self._compute(entry, key, *arguments, **named)
            if entry.failed and not entry.ready:
                # The thread that this one waited for has failed: this one tries, as another may.
                entry = self._entry(key)
        self._trim()
        return entry

    def _entry(self, key: tuple[Any, ...]) -> _Entry:
        """The entry of a key in the cache, added if there is none."""
        with self._lock:
            entry = self._entries.get(key)
            if entry is None:
                stored = tuple(map(self._stored, key))
                entry = self._entries[stored] = _Entry()
            return entry

    def _compute(
        self, entry: _Entry, key: tuple[Any, ...], *arguments: P.args, **named: P.kwargs
    ) -> None:
        """Compute an entry's result. An exception is not cached: the entry leaves the cache."""
        try:
            entry.value = self.function(*arguments, **named)
        except BaseException:
            entry.failed = True
            self._entries.pop(key, None)
            raise
        entry.ready = True

    def _stored(self, part: Any) -> Any:
        """An argument as the cache holds it.

        An argument with a method `weakly` (`own_function.OwnField`) is held by a weak reference; when
        it dies its results are dropped.
        """
        weakly = getattr(part, "weakly", None)
        return part if weakly is None else weakly(self._forget)

    def _forget(self, dead: Any) -> None:
        """Drop the results whose key holds an argument that has died.

        Any thread may call this at any time.
        """
        for key in self._entries.copy():
            if any(part is dead for part in key):
                self._entries.pop(key, None)

    def _trim(self) -> None:
        """Drop the results beyond the number allowed that were unused for the longest time."""
        if len(self._entries) <= self.size:
            return
        with self._lock:
            ready = [
                (entry.last_use, key) for key, entry in self._entries.copy().items() if entry.ready
            ]
            ready.sort(key=lambda pair: pair[0])
            for _, key in ready[: max(0, len(ready) - self.size)]:
                self._entries.pop(key, None)


def once(size: int = _MAX_CACHED) -> Callable[[Callable[P, R]], Once[P, R]]:
    """Cache at most `size` results of a function; no two threads compute one result at once.

    Arguments are hashable. One that has a method ``weakly(forget)`` is cached as what that returns:
    an object that equals it, does not keep it alive, and is given to `forget` when it dies.
    """
    return lambda function: Once(function, size)


class OncePerThread(Generic[P, R], local):
    """A function whose results are cached per thread: objects that hold the state of a run."""

    def __init__(self, function: Callable[P, R], size: int = _MAX_CACHED_IN_THREAD) -> None:
        # `local` calls this in every thread that uses the object.
        self.cached = Once(function, size)

    def __call__(self, *arguments: P.args, **named: P.kwargs) -> R:
        """The result for the arguments, computed in this thread."""
        return self.cached(*arguments, **named)

    def cache_clear(self) -> None:
        """Forget all results of this thread."""
        self.cached.cache_clear()
