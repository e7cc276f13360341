"""Learners beside PPO, one file each: `learner(**settings)` returns a `Learner`."""
