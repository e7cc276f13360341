"""CommonRoad scenarios: read as they are written. The files are looked for beside the repository."""

import numpy as np
import pytest
from places import ROOT

from rss_shield.eval.suite.judge.judgement import judge_trace

pytest.importorskip("commonroad", reason="commonroad-io is not installed: pip install 'rss-shield[commonroad]'")
from rss_shield.eval.suite.judge.commonroad import read_commonroad

FOLDERS = [ROOT.parent / "shared" / "data" / "commonroad", ROOT.parent.parent / "shared" / "data" / "commonroad"]
FOLDER = next((folder for folder in FOLDERS if folder.is_dir()), None)
needs_files = pytest.mark.skipif(FOLDER is None, reason=f"no scenarios in {FOLDERS[0]}")


@needs_files
@pytest.mark.parametrize(
    ("name", "users", "samples"),
    [
        ("USA_US101-5_1_T-1", 25, 101),
        ("USA_Lanker-1_3_T-1", 36, 41),
        ("OSC_CutIn-1_2_T-1", 2, 100),
        ("OSC_PedestrianCollision-1_1_T-1", 2, 93),
        ("ZAM_Zip-1_56_T-1", 3, 86),
        ("ZAM_Tjunction-1_97_T-1", 5, 148),
        ("DEU_Gar-1_1_T-1", 4, 21),
    ],
)
def test_scenarios_are_read(name, users, samples):
    trace = read_commonroad(FOLDER / f"{name}.xml")
    assert (len(trace.users.ids), len(trace.time)) == (users, samples)
    assert trace.lanes and trace.dt == pytest.approx(0.1)
    # where somebody is one sample later agrees with heading and speed
    u = trace.users
    ahead = (
        u.x[:-1] + np.cos(u.heading[:-1]) * u.speed[:-1] * trace.dt,
        u.y[:-1] + np.sin(u.heading[:-1]) * u.speed[:-1] * trace.dt,
    )
    off = np.hypot(ahead[0] - u.x[1:], ahead[1] - u.y[1:])
    assert np.nanmedian(off) < 0.15


@needs_files
def test_a_pedestrian_steps_in_front_of_a_car():
    judgement = judge_trace(read_commonroad(FOLDER / "OSC_PedestrianCollision-1_1_T-1.xml"), "slides")
    assert any("pedestrian" in note for note in judgement.notes)
    (blame,) = judgement.blames
    kinds = {judgement.trace.users.kinds[i] for i in blame.users}
    assert kinds == {"car", "pedestrian"} and 0.0 < blame.time < 9.0


def test_a_file_that_is_no_scenario_is_named(tmp_path):
    path = tmp_path / "other.xml"
    path.write_text("<nothing/>")
    with pytest.raises(ValueError, match=r"other\.xml: expected a CommonRoad scenario"):
        read_commonroad(path)
    with pytest.raises(FileNotFoundError):
        read_commonroad(tmp_path / "none.xml")
