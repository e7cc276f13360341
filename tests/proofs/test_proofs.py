"""What can be proved in seconds is proved here, the rest by `make prove`; and the prover itself is tried."""

import pytest

z3 = pytest.importorskip("z3", reason="z3-solver is not installed: pip install 'rss-shield[proofs]'")

from invariants import FORWARD, INVARIANTS, gap, v_front, v_rear  # noqa: E402
from model import C4, TABLE, dt, euler_margin, front, rear  # noqa: E402
from prover import PROVED, REFUTED, find, prove  # noqa: E402
from symbolic import symbolic  # noqa: E402

from rss_shield.shield.definitions.longitudinal import d_min_following  # noqa: E402

QUICK = [invariant for invariant in INVARIANTS if invariant.quick]


@pytest.mark.parametrize("invariant", QUICK, ids=[invariant.name for invariant in QUICK])
def test_it_holds_for_all_real_numbers(invariant):
    for statement in invariant.statements():
        assert prove(statement.given, statement.goal).status == PROVED, statement.part


@pytest.mark.parametrize("invariant", INVARIANTS, ids=[invariant.name for invariant in INVARIANTS])
def test_no_statement_is_true_only_because_its_assumptions_contradict_each_other(invariant):
    for statement in invariant.statements()[:6]:
        assert find(statement.given) is not None, statement.part


def test_what_does_not_hold_is_refuted_by_numbers_for_which_it_does_not():
    answer = prove([*TABLE, v_rear >= 0], euler_margin(v_rear, rear.a_min_brake, dt) < 1)
    assert answer.status == REFUTED
    values = [float(answer.model[one].as_fraction()) for one in (v_rear, rear.a_min_brake, dt)]
    assert values[0] * values[2] / 2 + values[1] * values[2] ** 2 / 8 >= 1


@pytest.mark.parametrize("slack", [0, 1])
def test_every_case_of_an_if_counts(slack):
    x = z3.Real("x")
    size = z3.If(x < 0, -x, x)
    assert prove([], size + slack > 0).status == (PROVED if slack else REFUTED)  # 0 for x = 0 alone


def test_half_the_margin_for_frames_is_too_little():
    required = symbolic(d_min_following, *TABLE, *C4)(v_rear, v_front, rear, front)
    safe = gap >= required + euler_margin(v_rear - v_front, rear.a_min_brake, dt) / 2
    start = next(one for one in INVARIANTS[1].statements() if one.part == "start")
    given = [*TABLE, *C4, *FORWARD, gap > 0]
    assert prove([*given, safe], start.goal).status == REFUTED
