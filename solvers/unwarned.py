"""Libraries without their warnings, in any number of threads."""

import warnings
from threading import Lock


class _Unwarned:
    """No warnings while any thread is within: Python's filters belong to the whole process."""

    def __init__(self) -> None:
        self.lock = Lock()
        self.threads = 0
        self.before = warnings.catch_warnings()

    def __enter__(self) -> None:
        with self.lock:
            self.threads += 1
            if self.threads == 1:
                self.before = warnings.catch_warnings()
                self.before.__enter__()
                warnings.simplefilter("ignore")

    def __exit__(self, *_: object) -> None:
        with self.lock:
            self.threads -= 1
            if self.threads == 0:
                self.before.__exit__(None, None, None)


UNWARNED = _Unwarned()
