"""Road users kept safe by plans, where roads cross."""
