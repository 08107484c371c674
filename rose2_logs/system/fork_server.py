"""Imported last by the process that workers are forked from: from then on signals reach it as usual.

It starts with those that stop a program blocked, see `workers`, because one that comes while it imports would
end it with a traceback, or without its workers. What has come in the meantime is dropped: the process that
started it was told as well, and ends it and the workers itself.
"""

from __future__ import annotations

import gc
import signal
import sys

from rose2_logs.system.signals import STOPPING, ignore

if sys.platform != "win32" and signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, []):
    ignore()
    signal.pthread_sigmask(signal.SIG_UNBLOCK, STOPPING)
    signal.signal(signal.SIGINT, signal.default_int_handler)

# Workers need not look for garbage in all that was imported, nor get copies of the pages that hold it.
gc.freeze()
