"""How the engine is compiled, and when again."""

from hashlib import sha256
from pathlib import Path

import shield
from numba import njit

# Inner functions allocate nothing, so numba need not count references to the arrays they are handed.
# Counting would cost far more than what they compute. They are compiled into the kernel, which alone
# is cached.
compiled = njit(_nrt=False, error_model="numpy")


def fingerprint() -> int:
    """A number that changes with every source file that the kernel is made of.

    numba looks only at the file of a cached function itself; without this the kernel would go on
    with old versions of the functions it calls.
    """
    sources = [*Path(__file__).parent.glob("*.py"), *Path(shield.__file__).parent.glob("*.py")]
    sources.append(Path(__file__).parent.parent / "highway.py")
    digest = sha256()
    for source in sorted(sources):
        digest.update(source.name.encode() + source.read_bytes())
    return int.from_bytes(digest.digest()[:7])
