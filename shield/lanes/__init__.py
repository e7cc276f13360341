"""Road users kept safe by distances along and across lanes."""
