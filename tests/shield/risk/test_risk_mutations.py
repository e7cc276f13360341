"""A change of any rule beside the formulas breaks a test of that rule. For the formulas see `test_risk_examples.py`."""

import pytest
import test_risk_classes
import test_risk_markings
import test_risk_scene
import test_risk_stays
import test_risk_surrogates
from mutants import interpreted

CLASSES, MARKINGS, SCENE = test_risk_classes, test_risk_markings, test_risk_scene
STAYS, SURROGATES = test_risk_stays, test_risk_surrogates

# module with the test, the test and its arguments, what is changed in which function that it calls
MUTATIONS = {
    "the upper threshold is unsafe": (
        *(CLASSES, "test_both_thresholds_belong_to_the_unknown", (1.0, 1)),
        *("classify", "classify", "rdsi > upper", "rdsi >= upper"),
    ),
    "the lower threshold is safe": (
        *(CLASSES, "test_both_thresholds_belong_to_the_unknown", (0.5, 1)),
        *("classify", "classify", "rdsi >= lower", "rdsi > lower"),
    ),
    "noise goes to the class after it": (
        *(CLASSES, "test_short_stays_are_noise", ([0, 0, 2, 1, 1, 2, 2], [0, 0, 0, 1, 1, 2, 2])),
        *("steady", "steady", "np.arange(kept.size), -1", "np.arange(kept.size), kept.size - 1"),
    ),
    "markings reach farther": (
        *(MARKINGS, "test_half_a_lane_away_there_is_none", (2.5,)),
        *("marking_risk", "marking_risk", "u <= 0.0", "u <= -1.0"),
    ),
    "leaving a marking is good": (
        *(MARKINGS, "test_leaving_a_line_is_no_negative_risk", (-0.5,)),
        *("marking_risk", "marking_risk", "rate, 0.0)", "rate, -9.0)"),
    ),
    "markings count in the half of a lane": (
        *(MARKINGS, "test_the_marking_of_the_lane_change_has_the_digits_given", ("iso",)),
        *("marking_risk", "marking_risk", "2.0 * line.distance / line", "line.distance / line"),
    ),
    "whoever is far counts": (
        *(SCENE, "test_an_empty_road_is_safe", ()),
        *("scene_risk", "_is_far", "> settings.farthest", "> 4 * settings.farthest"),
    ),
    "the critical source is the last": (
        *(SCENE, "test_a_scene_is_the_sum_of_its_sources_and_its_worst_one", ("iso", False)),
        *("scene_risk", "scene_risk", "risk.rdsi * upper > worst * risk.upper", "True"),
    ),
    "the critical source is that of the largest risk": (
        *(SCENE, "test_the_critical_source_need_not_be_that_of_the_largest_risk", ()),
        *("scene_risk", "scene_risk", "here > state", "risk.rdsi > worst"),
    ),
    "lines are left out of the sum": (
        *(SCENE, "test_lines_count_in_the_sum_alone", ()),
        *("scene_risk", "scene_risk", "total += markings", ""),
    ),
    "everybody is looked at": (
        *(SCENE, "test_only_those_on_a_list_are_looked_at", ()),
        *("scene_risk", "which", "return who[a]", "return a"),
    ),
    "the weight of what is beside has no half": (
        *(SCENE, "test_six_cars_around_the_ego_have_the_digits_given", ("radial", 1.0, "_H")),
        *("scene_risk", "_lateral_weight", "(settings.lane_width / (2.0 * beside))", "(settings.lane_width / beside)"),
    ),
    "who is between lanes is in both": (
        *(SCENE, "test_nobody_is_in_two_lanes", ()),
        *("neighbours", "neighbours", "-0.5 < across", "-0.5 <= across"),
    ),
    "a lane change looks behind in its own lane": (
        *(SCENE, "test_neighbours_are_the_nearest_ahead_and_behind_in_three_lanes", ()),
        *("neighbours", "neighbours", "(lane == 0 and front)", "lane == 0"),
    ),
    "crossings are not cut": (
        *(STAYS, "test_a_triangle_by_hand", ()),
        *("band_risk", "_positive_part", "np.where(rises, crossing, 0.0)", "0.0 * crossing"),
    ),
    "above the band is inside": (
        *(STAYS, "test_what_is_beyond_the_upper_threshold_is_left_out", ()),
        *("band_risk", "band_risk", "np.minimum(end_up, end_down)", "end_up"),
    ),
    "excess is the integral": (
        *(STAYS, "test_the_run_of_the_example_has_the_digits_given", ("radial",)),
        *("band_risk", "band_risk", 'above if mode == "excess" else rdsi', "rdsi"),
    ),
    "each step is a stay": (
        *(STAYS, "test_the_run_of_the_example_has_the_digits_given", ("iso",)),
        *("band_risk", "band_risk", "end[:-1] == 1.0", "end[:-1] == 2.0"),
    ),
    "short stays count": (
        *(STAYS, "test_short_stays_do_not_count", ()),
        *("band_risk", "band_risk", ">= least_stay", ">= 0.0 * least_stay"),
    ),
    "braking as required takes all of v squared": (
        *(SURROGATES, "test_by_hand", (20.0, 10.0, (2.0, 0.5, 2.5))),
        *("required_braking", "required_braking", "(closing, 1.0)", "(closing, 0.5)"),
    ),
    "the leader may be beside": (
        *(SURROGATES, "test_the_leader_is_the_nearest_ahead_in_the_way", ()),
        *("toward_leader", "toward_leader", "ego.half_width) < 0.0", "ego.half_width) < 0.5"),
    ),
    "the leader may be behind": (
        *(SURROGATES, "test_the_leader_is_the_nearest_ahead_in_the_way", ()),
        *("toward_leader", "toward_leader", "user.s >= ego.s and ", ""),
    ),
}


@pytest.mark.parametrize("mutation", MUTATIONS.values(), ids=MUTATIONS)
@pytest.mark.parametrize("changed", [False, True], ids=["as it is", "changed"])
def test_only_a_changed_rule_fails(mutation, changed, monkeypatch):
    module, test, arguments, called, where, old, new = mutation
    monkeypatch.setattr(module, called, interpreted(getattr(module, called), {where: (old, new)} if changed else {}))
    if changed:
        with pytest.raises(AssertionError):
            getattr(module, test)(*arguments)
    else:
        getattr(module, test)(*arguments)
