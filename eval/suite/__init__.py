"""What needs environments and agents to be evaluated: the only part of `eval` that imports them."""
