"""The comparison of arms that `train.py` makes, step by step: options, environments, jobs, and what is recorded."""
