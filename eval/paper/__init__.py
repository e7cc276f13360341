"""The report of runs and sweeps: one page to read, the same as Markdown, tables for LaTeX, figures for print."""
