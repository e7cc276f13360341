"""Modules of users, in the folder where they are."""

import os
import sys


def look_here() -> None:
    """Let modules be found in the folder where we are, too, after all others: environments as "module:my-road-v0"."""
    here = os.getcwd()
    if here not in sys.path:
        sys.path.append(here)
