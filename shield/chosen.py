"""Which of several road users are meant: those of a list, or everybody."""

from rss_shield.shield._numba.compiled import inner


@inner
def how_many(who, users):
    """Length of the list `who`, `[K]` indices or None = everybody in `users` `[N]`."""
    if who is None:
        return len(users)
    return len(who)


@inner
def which(who, a):
    """Index of number `a` on the list."""
    if who is None:
        return a
    return who[a]
