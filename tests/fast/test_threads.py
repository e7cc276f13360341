"""Sharing a batch among threads."""

import threading
import time

import pytest

from rss_shield.envs.fast.threads import Crew


@pytest.fixture(params=[1, 2, 5])
def crew(request):
    crew = Crew(request.param)
    yield crew
    crew.close()


@pytest.mark.parametrize("size", [0, 1, 7, 64, 1000])
def test_every_item_is_worked_off_once(crew, size):
    done = []
    crew.work(size, lambda thread, first, last: done.extend(range(first, last)))
    assert sorted(done) == list(range(size))


def test_no_two_tasks_share_a_thread_at_a_time(crew):
    """They would share its working memory."""
    busy, lock, clashes = set(), threading.Lock(), []

    def task(thread, first, last):
        with lock:
            clashes.extend({thread} & busy)
            busy.add(thread)
        time.sleep(1e-4)
        with lock:
            busy.remove(thread)

    crew.work(2000, task)
    assert not clashes and not busy


def test_a_thread_that_is_held_up_does_not_hold_up_the_others():
    crew, done = Crew(2), [0, 0]

    def task(thread, first, last):
        done[thread] += last - first
        if thread == 1:
            time.sleep(0.2)

    crew.work(1000, task)
    crew.close()
    assert sum(done) == 1000 and done[0] > 800


@pytest.mark.parametrize("culprit", [0, 1])
def test_an_error_reaches_the_caller_when_nobody_works_any_more(culprit):
    crew, working = Crew(2), []

    def task(thread, first, last):
        working.append(thread)
        if thread == culprit:
            working.pop()
            raise ValueError("broken")
        time.sleep(0.01)
        working.pop()

    with pytest.raises(ValueError, match="broken"):
        crew.work(1000, task)
    assert not working
    crew.close()
