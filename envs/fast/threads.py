"""How a batch is shared among threads."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait

_PARTS = 16  # per thread
_SMALLEST = 8  # environments in a part


class Crew:
    """Threads, the caller's among them, that work off a batch part by part.

    Parts are small and each thread takes the next one: a thread that the machine holds up for a while does not
    hold up the others.

    Args:
      threads: how many, the caller's included.
    """

    def __init__(self, threads: int) -> None:
        self._threads = threads
        self._pool = ThreadPoolExecutor(threads - 1) if threads > 1 else None

    def work(self, size: int, task: Callable[[int, int, int], None]) -> None:
        """Call `task(thread, first, last)` for parts that make up `size` items, no thread twice at a time."""
        length = max(size, 1) if self._pool is None else max(-(-size // (_PARTS * self._threads)), _SMALLEST)
        starts = range(0, size, length)
        parts = iter([(first, min(first + length, size)) for first in starts])
        helping = range(1, min(self._threads, len(starts)))  # nobody is woken for nothing

        def take_parts(thread: int) -> None:
            for first, last in parts:  # the interpreter lock makes it safe to share
                task(thread, first, last)

        helpers = [self._pool.submit(take_parts, thread) for thread in helping] if self._pool else []
        try:
            take_parts(0)
        finally:
            wait(helpers)
        for helper in helpers:
            helper.result()

    def __deepcopy__(self, memo: dict) -> "Crew":
        """As many threads of its own."""
        return Crew(self._threads)

    def close(self) -> None:
        """Give the threads back."""
        if self._pool is not None:
            self._pool.shutdown()
