"""Run tasks: in this process, in several, or on a Ray cluster. Whoever is killed on the way costs its task only."""

import logging
import multiprocessing
import os
import signal
import threading
import traceback
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from functools import partial
from typing import Any, NamedTuple

from rss_shield.eval.interrupt import children_ignore_interrupts
from rss_shield.eval.runs.store import Files
from rss_shield.eval.runs.tasks import Task

Work = Callable[[dict[str, Any]], Files]  # configuration -> files; picklable, and imported by every worker
BACKENDS = ("local", "ray")
ATTEMPTS = 3  # of one task, whose worker may be killed; what it raises is final at once


class Outcome(NamedTuple):
    """What became of one task."""

    task: Task
    files: Files | None  # None: it failed
    error: str = ""


def run_tasks(
    tasks: Sequence[Task], work: Work, *, backend: str = "local", workers: int = 1, address: str = ""
) -> Iterator[Outcome]:
    """Yield the outcome of every task, in the order in which they end.

    Args:
      work: does a task; its result depends on the configuration alone.
      backend: "local" or "ray".
      workers: processes; with "local" and 1, this one.
      address: of a running Ray cluster; "" starts one on this machine.

    Raises:
      ValueError: an unknown backend, or ray is not installed.
    """
    if backend not in BACKENDS:
        raise ValueError(f"backend = {backend!r}: expected one of {', '.join(BACKENDS)}")
    if not tasks:
        return
    if backend == "ray":
        yield from _on_ray(tasks, work, workers, address)
    elif workers == 1:
        for task in tasks:
            yield _done(task, partial(work, task.config))
    else:
        yield from _in_processes(tasks, work, min(workers, len(tasks)))


def _done(task: Task, result: Callable[[], Files]) -> Outcome:
    try:
        return Outcome(task, result())
    except Exception:
        return Outcome(task, None, traceback.format_exc())


# ---------------------------------------------------------------- processes of this machine


def _in_processes(tasks: Sequence[Task], work: Work, workers: int) -> Iterator[Outcome]:
    """Every worker is a pool of one: when it is killed, no other breaks with it."""
    methods = multiprocessing.get_all_start_methods()
    context: Any = multiprocessing.get_context("forkserver" if "forkserver" in methods else "spawn")
    # when this end is closed, or this process is killed, every worker ends; an event would wait for dead ones
    worker_end, own_end = context.Pipe(duplex=False)
    upcoming = deque((task, 1) for task in tasks)
    running: dict[Future, tuple[ProcessPoolExecutor, Task, int]] = {}
    idle: list[ProcessPoolExecutor] = []

    def start(pool: ProcessPoolExecutor) -> None:
        if upcoming:
            task, attempt = upcoming.popleft()
            running[pool.submit(work, task.config)] = pool, task, attempt
        else:
            idle.append(pool)

    def new_pool() -> ProcessPoolExecutor:
        return ProcessPoolExecutor(1, context, _start_worker, (worker_end,))

    try:
        with children_ignore_interrupts():
            for _ in range(workers):
                start(new_pool())
        while running:
            finished, _ = wait(running, return_when=FIRST_COMPLETED)
            for future in finished:
                pool, task, attempt = running.pop(future)
                if isinstance(future.exception(), BrokenProcessPool):
                    pool.shutdown()
                    pool = new_pool()
                    if attempt < ATTEMPTS:
                        upcoming.appendleft((task, attempt + 1))
                    else:
                        yield Outcome(task, None, f"its worker was killed {ATTEMPTS} times")
                else:
                    yield _done(task, future.result)
                with children_ignore_interrupts():
                    start(pool)
    finally:
        own_end.close()  # first of all: then no worker is still to be waited for
        for pool in [*idle, *(pool for pool, _, _ in running.values())]:
            pool.shutdown(cancel_futures=True)


def _start_worker(end: Any) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's business
    threading.Thread(target=_exit_at, args=(end,), daemon=True).start()


def _exit_at(end: Any) -> None:
    """Exit when the other end of a pipe is closed."""
    with suppress(EOFError, OSError):
        end.recv()
    os._exit(1)


# ---------------------------------------------------------------- Ray


def _on_ray(tasks: Sequence[Task], work: Work, workers: int, address: str) -> Iterator[Outcome]:
    with _cluster(workers, address) as ray:
        remote = ray.remote(num_cpus=1, max_retries=ATTEMPTS - 1, retry_exceptions=False)(_call)
        running = {remote.remote(work, task.config): task for task in tasks}
        while running:
            (first, *_), _ = ray.wait(list(running))
            yield _done(running.pop(first), partial(ray.get, first))


def _call(work: Work, config: dict[str, Any]) -> Files:
    return work(config)


@contextmanager
def _cluster(workers: int, address: str) -> Iterator[Any]:
    """A connection to a cluster, or a cluster of so many workers on this machine."""
    try:
        import ray
    except ModuleNotFoundError:
        raise ValueError("backend = 'ray' needs the package ray: pip install 'rss-shield[ray]'") from None
    where: dict[str, Any] = {"address": address} if address else {"num_cpus": workers, "include_dashboard": False}
    ray.init(log_to_driver=False, configure_logging=True, logging_level=logging.ERROR, **where)
    try:
        yield ray
    finally:
        ray.shutdown()
