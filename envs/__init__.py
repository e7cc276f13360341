"""Everything that knows a simulator."""
