"""Everything that knows stable-baselines3 and torch."""
