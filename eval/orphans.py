"""For the server that workers are forked from: importing this lets orphans end without a word.

A worker that is still starting when a run is stopped looks for locks that have ended with the run.
"""

import sys
import traceback
from types import TracebackType

_complain = sys.excepthook


def _complain_unless_orphaned(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    frames = traceback.extract_tb(trace)
    lock_is_gone = issubclass(kind, FileNotFoundError) and frames and frames[-1].name == "__setstate__"
    if not lock_is_gone:
        _complain(kind, error, trace)


sys.excepthook = _complain_unless_orphaned
