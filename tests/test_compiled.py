"""How functions are compiled."""

import pytest

from envs.fast.floats import norm
from shield.compiled import inner, inner_merged
from shield.plans import step


@inner
def _twice(x):
    return 2.0 * x


@inner_merged
def _thrice(x):
    return 3.0 * x


@pytest.mark.parametrize("function", [_twice, _thrice, step, norm])
def test_functions_for_compiled_callers_say_so(function):
    with pytest.raises(TypeError, match=f"{function.py_func.__name__} can only be called from compiled code"):
        function(1.0)
