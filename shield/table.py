"""The table that a shield and a judge go by, for frames of a given length."""

from rss_shield.shield.params import Preset, Rules, Table
from rss_shield.shield.sampling import frames_for


def table_for(params: Preset, rules: Rules, dt: float) -> Table:
    """A published table for frames of `dt` [s]: response times are rounded up to whole frames (condition C2).

    Raises:
      ValueError: the ego would have to respond within a frame.
    """
    rho = params.ego.response_time
    if rho < dt - 1e-9 and not params.per_frame:
        raise ValueError(
            f"response_time = {rho:g} s of the ego is shorter than one simulation frame; expected >= {dt:g} s"
        )
    ego = params.ego._replace(response_time=float(frames_for(max(rho, dt), dt) * dt))
    other = params.other._replace(response_time=float(frames_for(params.other.response_time, dt) * dt))
    return Table(ego, other, rules, dt)


def below(table: Table, limit: float) -> Table:
    """The same table where nobody accelerates beyond the highest speed limit of the roads [m/s] (rule J13).

    What plans through junctions expect of others, the judge has to hold them to; and the ego keeps it, too, because
    other egos expect it.
    """
    ego, other = (one._replace(v_cap=min(one.v_cap, limit)) for one in (table.ego, table.other))
    return table._replace(ego=ego, other=other)
