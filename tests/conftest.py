"""Applies to every test: a floating-point error that numpy would only warn about is a failure."""

import numpy as np

np.seterr(divide="raise", over="raise", invalid="raise")
