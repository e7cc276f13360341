"""Filters of the literature behind the shield's interface, for comparison: none of them keeps what RSS proves."""
