"""What the engine computes as numpy does, to the last bit."""
