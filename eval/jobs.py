"""Run jobs in worker processes, each with a progress bar."""

import multiprocessing
import os
import queue
import signal
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from multiprocessing.connection import Connection
from typing import Any, NamedTuple

from tqdm import tqdm

from rss_shield.eval.interrupt import children_ignore_interrupts
from rss_shield.eval.progress import move_to, progress_bar

_TICK = 0.2  # seconds between two looks at the news


class Job(NamedTuple):
    """Something to do that says how far it is."""

    description: str
    total: int  # what is to be done, in units
    unit: str
    work: Callable[..., Any]  # called with `progress`, a function of the units done; picklable


def run_jobs(jobs: Sequence[Job], n_workers: int) -> None:
    """Do all jobs, `n_workers` at a time (1: in this process).

    Whatever a job raises is raised here, and so is KeyboardInterrupt; what the other jobs were doing is
    stopped at once, wherever it is.
    """
    if n_workers == 1 or len(jobs) <= 1:
        for job in jobs:
            with progress_bar(job.total, job.description, job.unit) as bar:
                job.work(progress=lambda done, bar=bar: move_to(bar, done))
        return
    # forked or spawned from a clean process: this one may hold threads and a GPU
    methods = multiprocessing.get_all_start_methods()
    context: Any = multiprocessing.get_context("forkserver" if "forkserver" in methods else "spawn")
    # a worker that waits for an event would never let it be set once it was killed; the end of a pipe waits for nobody
    news, (ends, goes_on) = context.Queue(), context.Pipe(duplex=False)
    bars: dict[int, tqdm] = {}
    pool = ProcessPoolExecutor(min(n_workers, len(jobs)), context, _start_worker, (news, ends))
    try:
        with children_ignore_interrupts():
            left = {pool.submit(_run_in_worker, i, job.work) for i, job in enumerate(jobs)}
            # a pool is woken by what it is given before it starts the process for it: that of the last job would be
            # watched from the next news on only, and if it was killed before these came, waited for without end
            pool.submit(_nothing)
        while left:
            finished, left = wait(left, _TICK, FIRST_COMPLETED)
            _show(news, jobs, bars)
            for done in finished:
                done.result()
        _show(news, jobs, bars)
    finally:
        goes_on.close()  # first of all: then nothing that is still to be waited for takes long
        pool.shutdown(cancel_futures=True)
        ends.close()
        for bar in bars.values():
            bar.close()


def _show(news: Any, jobs: Sequence[Job], bars: dict[int, tqdm]) -> None:
    """Move the bars to where the jobs are. A bar appears when its job says something."""
    while True:
        try:
            i, done = news.get_nowait()
        except queue.Empty:
            return
        if i not in bars:
            bars[i] = progress_bar(jobs[i].total, jobs[i].description, jobs[i].unit)
        move_to(bars[i], done)
        if done >= jobs[i].total:
            bars[i].close()


_worker: dict[str, Any] = {}  # how a worker process reports


def _start_worker(news: Any, ends: Connection) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's business
    threading.Thread(target=_exit_after, args=(ends,), daemon=True).start()
    _worker["news"] = news


def _exit_after(ends: Connection) -> None:
    """A worker must not go on for ever when its parent was killed, nor to the end of its job when it must stop."""
    ends.poll(None)  # nothing is ever sent: it ends when the parent closes the other end, or is gone
    os._exit(1)


def _nothing() -> None:
    """A job that only wakes the pool."""


def _run_in_worker(i: int, work: Callable[..., Any]) -> None:
    work(progress=lambda done: _worker["news"].put((i, done)))
