"""Applies to every test: a floating-point error that numpy would only warn about is a failure.

And an intersection, which changes the class of all traffic in the process, changes it for its own test only.
"""

import numpy as np
import pytest

from rss_shield.envs.stock import drivers_unchanged

np.seterr(divide="raise", over="raise", invalid="raise")


@pytest.fixture(autouse=True, scope="module")
def _modules_leave_drivers_unchanged():
    with drivers_unchanged():
        yield


@pytest.fixture(autouse=True)
def _tests_leave_drivers_unchanged():
    with drivers_unchanged():
        yield
