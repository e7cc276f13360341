"""Safety-performance points of an experiment: a row per point, with intervals, and which are on the Pareto front."""

from collections.abc import Collection, Iterable
from typing import Any

import numpy as np
import pandas as pd

from rss_shield.eval.metrics import METRICS, Metric, metrics_in, with_outcomes
from rss_shield.eval.stats import (
    Interval,
    bootstrap_mean,
    bootstrap_median,
    clopper_pearson,
    pareto_front,
    pooled_bootstrap,
)


def metric_named(name: str) -> Metric:
    """A metric of the tables.

    Raises:
      ValueError: unknown.
    """
    for metric in METRICS:
        if metric.name == name:
            return metric
    raise ValueError(f"metric = {name!r}: expected one of {', '.join(metric.name for metric in METRICS)}")


def check_there(metrics: Iterable[str], columns: Collection[str], of: str) -> None:
    """Do episodes, or points, have the metrics that are asked for?

    Raises:
      ValueError: names one that they have not, and those that they have.
    """
    for name in metrics:
        if name not in columns:
            there = ", ".join(metric.name for metric in metrics_in(columns))
            raise ValueError(f"metric = {name!r}: {of} have none; expected one of {there}")


def point_row(
    point: dict[str, Any], episodes: dict[int, pd.DataFrame], *, pooled: bool = False
) -> list[dict[str, Any]]:
    """Every metric of one point.

    Args:
      point: column -> value.
      episodes: of each seed.
      pooled: seeds only name more episodes of one fixed policy; nothing was trained.

    Returns:
      Rows of the point's columns and metric, value, low, high, n, over: values are means or medians of the episodes of
      all seeds, as in `eval.metrics.summarise`. With one seed the interval is over episodes (rates: Clopper-Pearson),
      else over seeds and episodes (`eval.stats.pooled_bootstrap`). Equal values of two metrics have equal intervals.
    """
    tables = [with_outcomes(frame) for frame in episodes.values()]
    if pooled:
        tables = [pd.concat(tables, ignore_index=True)]
    names = set.intersection(*(set(table.columns) for table in tables))
    rows = []
    for metric in metrics_in(names):
        samples = [table[metric.name].astype(float).dropna().to_numpy() for table in tables]
        rows.append({**point, "metric": metric.name, **_interval(metric, samples, np.random.default_rng(0))._asdict()})
    return rows


def _interval(metric: Metric, samples: list[np.ndarray], rng: np.random.Generator) -> Interval:
    known = [sample for sample in samples if sample.size]
    if len(known) > 1:
        statistic = np.median if metric.statistic == "median" else np.mean
        interval = pooled_bootstrap(known, rng, statistic)
        low, high = max(interval.low, metric.limits[0]), min(interval.high, metric.limits[1])
        if metric.statistic == "rate":  # seeds that agree, as in no crash at all, know no more than their episodes
            pooled = np.concatenate(known)
            exact = clopper_pearson(int(pooled.sum()), pooled.size)
            low, high = min(low, exact.low), max(high, exact.high)
        return interval._replace(low=low, high=high)
    sample = known[0] if known else np.zeros(0)
    if metric.statistic == "rate":
        return clopper_pearson(int(sample.sum()), sample.size)
    return (bootstrap_median if metric.statistic == "median" else bootstrap_mean)(sample, rng)


APART = ("environment", "policy", "test")  # points that differ in these do not compete


def with_front(wide: pd.DataFrame, safety: str, performance: str) -> pd.DataFrame:
    """Add a column "front": is the point on the Pareto front of both metrics, in its environment, with its policy?

    Args:
      wide: a row per point; columns of the metrics' values.

    Raises:
      ValueError: one of the metrics is no column.
    """
    check_there((safety, performance), wide.columns, "these points")
    metrics = (metric_named(name) for name in (safety, performance))
    costs = np.column_stack([wide[metric.name] * (1.0 if metric.less_is_better else -1.0) for metric in metrics])
    front = np.zeros(len(wide), bool)
    for _, rows in groups_of(wide):
        front[rows] = pareto_front(costs[rows])
    return wide.assign(front=front)


def groups_of(wide: pd.DataFrame) -> list[tuple[str, np.ndarray]]:
    """Label and row numbers of the points that compete with each other."""
    columns = [name for name in APART if name in wide]
    labels = wide[columns].astype(str).agg(", ".join, axis=1) if columns else pd.Series([""] * len(wide))
    return [(str(label), np.flatnonzero(labels == label)) for label in dict.fromkeys(labels)]
