"""Cars kept safe by trajectories, where there are no lanes (Defs. 19-22)."""
