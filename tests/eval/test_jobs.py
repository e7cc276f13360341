"""Jobs in worker processes: all are done, and an error stops them all."""

import contextlib
import os
import signal
import time
from concurrent.futures.process import BrokenProcessPool
from functools import partial

import pytest

from rss_shield.eval.jobs import Job, run_jobs


def write(path, number, progress):
    for done in range(1, number + 1):
        progress(done)
    path.write_text(f"{number} {os.getpid()}")


def fail(progress):
    progress(1)
    raise ZeroDivisionError("on purpose")


def go_on_for_ever(progress):
    while True:
        progress(1)
        time.sleep(0.01)


def fail_soon(progress):
    time.sleep(0.5)
    raise ZeroDivisionError("on purpose")


def sleep_for_ever(progress):
    progress(1)
    time.sleep(1000)


def compute_for_ever(progress):
    while True:
        sum(range(1000))


def say_nothing(progress):
    with contextlib.suppress(BaseException):
        time.sleep(1000)


@pytest.mark.parametrize("n_workers", [1, 2, 5])
def test_every_job_is_done_once(tmp_path, n_workers):
    jobs = [Job(f"job {i}", i, "thing", partial(write, tmp_path / str(i), i)) for i in range(1, 5)]
    run_jobs(jobs, n_workers)
    numbers, processes = zip(*((tmp_path / str(i)).read_text().split() for i in range(1, 5)), strict=True)
    assert numbers == ("1", "2", "3", "4")
    assert (str(os.getpid()) in processes) == (n_workers == 1)


@pytest.mark.parametrize("n_workers", [1, 2])
def test_an_error_in_a_job_is_raised_here_and_stops_the_others(n_workers):
    jobs = [Job("fails", 2, "thing", fail), Job("goes on for ever", 2, "thing", go_on_for_ever)]
    with pytest.raises(ZeroDivisionError, match="on purpose"):
        run_jobs(jobs, n_workers)


@pytest.mark.parametrize("busy", [sleep_for_ever, compute_for_ever, say_nothing])
def test_what_a_job_does_is_stopped_at_once_wherever_it_is(busy):
    jobs = [Job("fails", 2, "thing", fail_soon), Job("busy", 2, "thing", busy)]
    began = time.perf_counter()
    with pytest.raises(ZeroDivisionError, match="on purpose"):
        run_jobs(jobs, 2)
    assert time.perf_counter() - began < 20


def kill_the_worker(progress):
    progress(1)
    time.sleep(0.5)  # by then every worker waits to be told to stop
    os.kill(os.getpid(), signal.SIGKILL)


@pytest.mark.parametrize("killed", [0, 1], ids=["the first worker", "the last worker"])
def test_a_worker_that_is_killed_is_an_error_and_stops_the_others_at_once(killed):
    jobs = [Job("busy", 2, "thing", sleep_for_ever)]
    jobs.insert(killed, Job("is killed", 2, "thing", kill_the_worker))
    began = time.perf_counter()
    with pytest.raises(BrokenProcessPool):
        run_jobs(jobs, 2)
    assert time.perf_counter() - began < 20


def test_no_jobs_are_no_work():
    run_jobs([], 2)
