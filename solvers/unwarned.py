"""Libraries without their warnings, in any number of threads."""

import warnings
from threading import Lock


class _Unwarned:
    """No warnings while any thread is within: Python's filters belong to the whole process.

    The first thread to enter saves the filters, the last one to leave restores them. Were each to
    do so itself, one that leaves late would restore filters that another had changed.
    """

    def __init__(self) -> None:
        self.lock = Lock()  # for what follows
        self.threads = 0  # that are within
        self.before = warnings.catch_warnings()  # the filters that the first thread found

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
