"""What came out of a run, in sentences. Each number is in a table as well."""

import pandas as pd

from rss_shield.eval.arms import arm_called
from rss_shield.eval.metrics import Metric, with_outcomes
from rss_shield.eval.runs.points import metric_named
from rss_shield.eval.runs.tables import plain
from rss_shield.eval.stats import clopper_pearson
from rss_shield.eval.table import rounded


def of_run(episodes: pd.DataFrame, summary: pd.DataFrame, compared: pd.DataFrame) -> list[str]:
    """The paragraphs of a run of `rss-shield train` or `test`.

    Args:
      episodes: all test episodes.
      summary: as of `eval.metrics.summarise`.
      compared: as of `eval.paper.compared.comparisons`.
    """
    outcomes = with_outcomes(episodes)
    cells = len(summary[["train", "test"]].drop_duplicates())
    seeds = episodes.loc[~episodes["train"].map(_is_scripted), "train_seed"].nunique()
    over = f", {seeds} training seed{'s' if seeds > 1 else ''}" if seeds else ""
    paragraphs = [
        f"{cells} cell{'s' if cells > 1 else ''} (an arm, tested one way), {len(episodes)} test episodes{over}."
    ]
    for test, where in (("on", "with the shield on"), ("off", "with the shield off")):
        tested = outcomes[outcomes["test"] == test]
        if len(tested):
            paragraphs.append(_faults(tested, where))
    values = summary.pivot_table(index=["train", "test"], columns="metric", values="value", sort=False, observed=True)
    best = values["return"].idxmax()
    paragraphs.append(f"Highest return: {_cell(best)}, {values.loc[best, 'return']:.1f} per episode.")
    harmless = values[values["at_fault"] == 0]
    if len(harmless) and harmless["return"].idxmax() != best:
        safest = harmless["return"].idxmax()
        paragraphs.append(
            f"Highest return without a fault of the ego: {_cell(safest)}, {values.loc[safest, 'return']:.1f}."
        )
    if "override_share" in values:
        on = values[[test == "on" for _, test in values.index]]
        if len(on):
            most, least = on["override_share"].idxmax(), on["override_share"].idxmin()
            shares = 100 * on["override_share"]
            text = f"Most frames overridden: {shares[most]:.1f} % ({_cell(most)})"
            paragraphs.append(text + (f"; fewest: {shares[least]:.1f} % ({_cell(least)})." if most != least else "."))
    tests = compared[compared["p_holm"].notna()]
    if len(tests):
        beyond = int((tests["p_holm"] < 0.05).sum())
        paragraphs.append(
            f"Of {len(tests)} paired comparisons of crash and fault with the first cell, {beyond} differ by more than "
            "chance (McNemar, p < 0.05 after Holm's correction; over episodes of these models, not over seeds)."
        )
    return paragraphs


def _is_scripted(train: str) -> bool:
    arm = arm_called(train)
    return arm is not None and arm.scripted


def _faults(tested: pd.DataFrame, where: str) -> str:
    n, faults, crashes = len(tested), int(tested["at_fault"].sum()), int(tested["crash"].sum())
    bound = clopper_pearson(faults, n)
    text = f"Tested {where}: {crashes} contacts in {n} episodes, {faults} of them the ego's fault "
    text += (
        f"({_percent(bound.value)} %, 95 % interval {_percent(bound.low)} to {_percent(bound.high)} %, over episodes"
    )
    rates = tested.groupby("train", sort=False)["at_fault"].mean()
    if len(rates) > 1 and faults:
        low, high = (f"{100 * rates[arm]:.0f} % ({arm})" for arm in (rates.idxmin(), rates.idxmax()))
        text += f"; by training from {low} to {high}"
    unexplained = int(tested["none"].sum())
    return (
        text + ")" + (f"; {unexplained} that nobody's duty explains, which would be a bug" if unexplained else "") + "."
    )


def _percent(share: float) -> str:
    """Two digits; 100, and not 1e+02, of what is nearly all."""
    return f"{100 * share:.2g}" if share < 0.995 else "100"


def _cell(cell: tuple[str, str]) -> str:
    train, test = cell
    trained = {"on": "trained with the shield", "off": "trained without the shield"}.get(train, train)
    return f"{trained}, tested with it {test}"


def of_sweep(
    table: pd.DataFrame, axes: list[str], groups: list[tuple[str, list[int]]], safety: str, performance: str
) -> list[str]:
    """The paragraphs of a sweep.

    Args:
      table: as of `eval.runs.points.with_front`.
      axes: columns that tell points apart.
      groups: label and rows of the points that compete.
    """
    paragraphs, across, up = [], metric_named(performance), metric_named(safety)
    x, y = across.label, up.label
    for label, rows in groups:
        points = table.iloc[rows]
        where = f"{label}: " if label else ""
        front = points[points["front"]].sort_values(performance, ascending=across.less_is_better)
        if front.empty:
            paragraphs.append(f"{where}None of {len(points)} points has both {x} and {y}.")
            continue
        best = front.iloc[0]
        reached, paid = _told(across, best[performance]), _told(up, best[safety])
        if len(points) == 1:
            paragraphs.append(f"{where}One point: {x} {reached}, {y} {paid}.")
            continue
        named = f" ({', '.join(f'{name} = {plain(best[name])}' for name in axes)})" if axes else ""
        paragraphs.append(
            f"{where}{len(front)} of {len(points)} points are on the Pareto front of {y} and {x}. "
            f"The best {x} there is {reached}, with {y} {paid}{named}."
        )
    return paragraphs


def _told(metric: Metric, value: float) -> str:
    """As tables have it: 0.075 of a rate is 8 %."""
    limits = tuple(metric.scale * limit for limit in metric.limits)
    return f"{rounded(metric.scale * value, metric.digits, limits)} {metric.unit}".strip()
