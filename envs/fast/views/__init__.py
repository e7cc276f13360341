"""What agents see: one file per kind of observation of highway-env.

`view` turns a configuration into numbers. Observations of the usual kinds are made inside the engine's kernel; the
others by kernels of their own between two calls of it (`apart`), so that nobody compiles what nobody looks at.
"""
