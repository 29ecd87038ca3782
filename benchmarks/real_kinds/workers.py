"""Worker processes that do not outlive the run that started them, whichever way it ends."""

import os
import threading
from multiprocessing import get_context, parent_process


def pool(workers):
    """Return a pool of fresh interpreters for so many workers."""
    return get_context("spawn").Pool(workers, initializer=end_with_parent, maxtasksperchild=4)


def end_with_parent():
    """End this process as soon as its parent is gone: a killed parent does not end its workers."""
    threading.Thread(target=_watch, args=(parent_process(),), daemon=True).start()


def _watch(parent):
    parent.join()
    os._exit(1)
