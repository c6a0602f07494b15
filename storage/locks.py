"""One process at a time on one key. The kernel holds the lock, so a killed holder releases it at once.

A lock file is never deleted: a name that is removed while somebody waits on it would be two locks.
"""

import logging
import os
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from storage.contract import Store, check_key
from storage.errors import StoreNotWritable

log = logging.getLogger(__name__)
POLL = 0.05  # seconds between looks, short against any step worth locking


@contextmanager
def step_lock(store: Store, key: str, *, on_wait: Callable[[str], None] = log.info) -> Iterator[None]:
    """Hold `key` alone among the processes and threads of this machine that share a local store.

    When somebody else holds it, `on_wait` is told so once, in a sentence, and we wait. Not re-entrant. On other
    stores this does nothing: there, the epoch of a checkpoint writer decides (see checkpoints).
    Raises: StoreNotWritable.
    """
    path = store.local_path(f"locks/{check_key(key)}.lock")
    with ExitStack() as held:
        try:
            if path is not None:
                path.parent.mkdir(parents=True, exist_ok=True)
                waiting = f"Another process is working on {key}: waiting for it to finish."
                held.enter_context(flock(path, on_wait=lambda: on_wait(waiting)))
        except OSError as problem:
            raise StoreNotWritable(f"Expected to lock {path}, but '{problem.strerror}': choose a folder that you may write.") from problem
        yield


@contextmanager
def flock(path: Path, *, on_wait: Callable[[], None] = lambda: None) -> Iterator[None]:
    """Hold an exclusive lock on the file `path`. Raises: OSError when the file cannot be opened or locked."""
    import fcntl  # only where it exists: everything else here works on any system

    descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
    waited = False
    try:
        while True:
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except BlockingIOError:
                if not waited:
                    waited = True
                    on_wait()
                time.sleep(POLL)  # polled, not blocked: Ctrl-C and cancellation get through
        yield
    finally:
        os.close(descriptor)
