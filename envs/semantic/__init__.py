"""Semantic actions on roads that can be driven: what they are, where they lead, what that is worth.

What both simulators need lies here; `envs.highway.semantic` and `envs.fast.semantic` carry them out.
"""
