"""From rollouts to tables, intervals and plots. Knows no simulator and no learning library."""
