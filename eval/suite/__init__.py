"""Where simulators, agents and statistics meet: the only part of `rss_shield.eval` that knows all of them."""
