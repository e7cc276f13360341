"""Ctrl-C once, twice or held down: the process stops within seconds.

This module imports nothing slow, so that a script can call `stop_on_interrupt` before anything else.
"""

import atexit
import os
import signal
import socket
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import TracebackType

GRACE = 5.0  # seconds to stop in an orderly way
EXIT_CODE = 130


def stop_on_interrupt(message: str) -> None:
    """Make the first SIGINT say `message` and raise KeyboardInterrupt, and the next ones change nothing.

    Whoever has not ended after GRACE is ended. The system's handler wakes a thread for that, because Python's own
    has to wait until compiled code returns, and an exception can get lost in a callback. What is written must
    survive a kill at any moment.
    """
    reader, writer = socket.socketpair()
    writer.setblocking(False)
    signal.set_wakeup_fd(writer.detach(), warn_on_full_buffer=False)
    say = _Once(message)

    def interrupt(signum: int, frame: object) -> None:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        say()
        raise KeyboardInterrupt

    signal.signal(signal.SIGINT, interrupt)
    sys.excepthook = _without_traceback
    threading.Thread(target=_end, args=(reader, say), daemon=True).start()


class _Once:
    """Says something when it is called for the first time. Nobody goes on before it is said."""

    def __init__(self, message: str) -> None:
        self.text = f"\n{message}\n".encode()
        self.lock = threading.Lock()

    def __call__(self) -> None:
        with self.lock:
            os.write(2, self.text)  # a signal may have come in the midst of a print
            self.text = b""


def _without_traceback(kind: type[BaseException], error: BaseException, traceback: TracebackType | None) -> None:
    """An interrupt needs no more words than the message. To take compilers and networks apart takes seconds."""
    if issubclass(kind, KeyboardInterrupt):
        atexit._run_exitfuncs()
        os._exit(EXIT_CODE)
    sys.__excepthook__(kind, error, traceback)


def _end(reader: socket.socket, say: Callable[[], None]) -> None:
    while signal.SIGINT not in reader.recv(64):  # one byte a signal
        pass
    say()
    time.sleep(GRACE)
    os._exit(EXIT_CODE)


@contextmanager
def children_ignore_interrupts() -> Iterator[None]:
    """Processes that are started here never see SIGINT, not even while they start. This one misses none."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
