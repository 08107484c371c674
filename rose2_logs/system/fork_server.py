"""Imported last by the process that workers are forked from: from then on Ctrl-C reaches it as usual.

It starts with Ctrl-C blocked, see `workers`, because one that comes while it imports would end it with a
traceback. What has come in the meantime is dropped: the process that started it was told as well.
"""

from __future__ import annotations

import signal
import sys

if sys.platform != "win32" and signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, []):
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])
    signal.signal(signal.SIGINT, signal.default_int_handler)
