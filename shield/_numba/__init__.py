"""How functions are compiled: private, checked when it is imported."""
