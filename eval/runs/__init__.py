"""Experiments as files, their tasks, and what runs them: this process, several, or a Ray cluster."""
