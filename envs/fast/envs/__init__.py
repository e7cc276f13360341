"""One file per environment: its part of the configuration, the scene that episodes start from, and its reward.

Each has `REWARDS`, the names of the components of its reward in highway-env's order, `describe`, which turns a
configuration of highway-env into numbers, and compiled `make_scene` and `rate`. `tasks` puts them together.
"""
