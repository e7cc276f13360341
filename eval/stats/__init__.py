"""Statistics of episodes, seeds and arms: intervals that say over what.

Two levels of chance are kept apart. *Episodes*: the agents are given, other test episodes would give other values.
*Seeds and episodes*: other training seeds would give other agents, too. A claim about a method needs the second.
"""

from rss_shield.eval.stats.censored import completion_weights, weighted_mean, weighted_rate
from rss_shield.eval.stats.clusters import cluster_bootstrap, cluster_difference, pooled_bootstrap
from rss_shield.eval.stats.corrections import benjamini_hochberg, holm
from rss_shield.eval.stats.interval import EPISODES, RUNS, SEEDS, Interval
from rss_shield.eval.stats.means import MANY, bootstrap_mean, bootstrap_median, paired_difference, student
from rss_shield.eval.stats.paired import Discordant, mcnemar
from rss_shield.eval.stats.pareto import pareto_front
from rss_shield.eval.stats.rates import clopper_pearson, wilson
from rss_shield.eval.stats.runs import (
    interquartile_mean,
    performance_profile,
    probability_of_improvement,
)

__all__ = [
    "EPISODES",
    "MANY",
    "RUNS",
    "SEEDS",
    "Discordant",
    "Interval",
    "benjamini_hochberg",
    "bootstrap_mean",
    "bootstrap_median",
    "clopper_pearson",
    "cluster_bootstrap",
    "cluster_difference",
    "completion_weights",
    "holm",
    "interquartile_mean",
    "mcnemar",
    "paired_difference",
    "pareto_front",
    "performance_profile",
    "pooled_bootstrap",
    "probability_of_improvement",
    "student",
    "weighted_mean",
    "weighted_rate",
    "wilson",
]
