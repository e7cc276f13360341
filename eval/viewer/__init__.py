"""A page on which a person sees what happened in an episode."""
