"""The numbers behind the pages: packed, they come back as they were, and a measurement goes on from them."""

import io
import subprocess
import sys
import tarfile

import pytest
from places import ROOT

from bench.kept import Config, archive, kept, known, main, pack, unpack


@pytest.fixture
def runs(tmp_path):
    runs = tmp_path / "runs"
    (runs / "parking" / "old").mkdir(parents=True)
    (runs / "people.jsonl").write_text('{"seed": 1}\n')
    (runs / "parking" / "a.csv").write_text("seed\n1\n")
    (runs / "parking" / "old" / "b.json").write_text("{}")
    (runs / "parking" / "model.zip").write_bytes(b"large")
    (runs / "parking" / ".c.csv.tmp").write_text("half")
    (runs / "parking" / ".c.csv").write_text("half")
    return runs


def test_tables_come_back_and_nothing_else(runs, tmp_path):
    assert pack("parking", runs, tmp_path) == 2
    elsewhere = tmp_path / "elsewhere"
    assert unpack("parking", elsewhere, tmp_path) == 2
    there = {path.relative_to(elsewhere).as_posix(): path.read_text() for path in elsewhere.rglob("*.*")}
    assert there == {"parking/a.csv": "seed\n1\n", "parking/old/b.json": "{}"}


def test_the_same_files_are_the_same_archive(runs, tmp_path):
    pack("people", runs, tmp_path)
    first = archive("people", tmp_path).read_bytes()
    (runs / "people.jsonl").touch()
    pack("people", runs, tmp_path)
    assert archive("people", tmp_path).read_bytes() == first


def test_what_was_kept_before_stays(runs, tmp_path):
    pack("parking", runs, tmp_path)
    (runs / "parking" / "a.csv").unlink()
    (runs / "parking" / "d.csv").write_text("seed\n2\n")
    assert pack("parking", runs, tmp_path) == 3


def test_what_is_in_runs_is_left_alone(runs, tmp_path):
    pack("parking", runs, tmp_path)
    (runs / "parking" / "a.csv").write_text("seed\n1\n2\n")
    (runs / "parking" / "old" / "b.json").unlink()
    assert unpack("parking", runs, tmp_path) == 1
    assert (runs / "parking" / "a.csv").read_text() == "seed\n1\n2\n"


def test_of_a_part_of_the_campaign_is_kept_what_its_page_is_written_from(tmp_path):
    runs, part = tmp_path / "runs", "campaign-short-highway-main"
    model = runs / part / "shielded-seed0"
    (runs / part / "episodes").mkdir(parents=True)
    model.mkdir()
    (runs / part / "episodes.csv").write_text(
        "seed,return,blame,crashed,actions,evidence,min_ttc\n1000000007,22.123456789,no contact,False,1 2,{},\n"
    )
    (runs / part / "episodes" / "episodes.csv").write_text("seed\n1\n")
    (runs / part / "table.csv").write_text("metric\n")
    (model / "learning_curve.csv").write_text("timesteps,return\n8192,1.5\n")
    (model / "model.zip").write_bytes(b"large")
    assert known(runs, tmp_path)[-1] != part  # it is not finished
    (runs / part / "results.json").write_text('{"n": 1.123456789}')
    assert known(runs, tmp_path)[-1] == part
    assert pack(part, runs, tmp_path) == 3
    assert kept(part, tmp_path) == {
        f"{part}/episodes.csv": b"seed,return,blame,crashed,min_ttc\n1000000007,22.123,no contact,False,\n",
        f"{part}/results.json": b'{"n": 1.123456789}',
        f"{part}/shielded-seed0/learning_curve.csv": b"timesteps,return\n8192,1.5\n",
    }
    assert known(tmp_path / "nowhere", tmp_path)[-1] == part


def test_nothing_is_put_outside(tmp_path):
    with tarfile.open(archive("people", tmp_path), "w:xz") as tar:
        member = tarfile.TarInfo("../people.jsonl")
        member.size = 1
        tar.addfile(member, io.BytesIO(b"x"))
    with pytest.raises(ValueError, match="is outside"):
        unpack("people", tmp_path / "runs", tmp_path)
    assert not (tmp_path / "people.jsonl").exists()


def test_an_unknown_name_is_refused(tmp_path):
    with pytest.raises(ValueError, match="people, parking"):
        main(Config("list", ("nobody",), tmp_path, tmp_path))


def test_the_command_says_what_is_there(runs, tmp_path):
    words = [sys.executable, "bench/kept.py", "list", "people", "--runs", runs, "--data", tmp_path]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["people:", "0", "files", "kept,", "1", "in", str(runs)]


def test_what_is_shipped_can_be_read():
    for path in sorted((ROOT / "docs" / "results" / "data").glob("*.tar.xz")):
        assert kept(path.name.split(".")[0], path.parent)
