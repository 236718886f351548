"""The table of a batch and its page."""

import csv
import json
import os
import re
from dataclasses import replace
from pathlib import Path

import pytest
from sheets import on_each_other, sheets_drawn

from odom.batch.job import Job
from odom.batch.page import page
from odom.batch.summary import change_of, rows_of, totals_of
from odom.batch.summary_files import read_rows, write_summary
from odom.errors import SourceError

REPORT = {"frames": 30, "tracked": 30, "completeness": 1.0, "segments": [{}], "ate_m": 0.01, "rpe_1s_m": 0.005}


def job(name, results, **figures):
    made = Job(name, Path(name), f"content of {name}", "program", name.encode().hex(), results, (), ())
    if figures:
        made.folder.mkdir(parents=True)
        (made.folder / "report.json").write_text(json.dumps(REPORT | figures))
    return made


@pytest.fixture
def jobs(tmp_path):
    results = tmp_path / "results"
    return [job("a", results, ate_m=0.01), job("b & <c>", results, ate_m=None, nees_mean=None), job("d", results)]


def test_a_row_says_what_the_report_says_or_why_there_is_none(jobs):
    rows = rows_of(jobs, {"d": "failed: no frame"}, [])
    assert [row["state"] for row in rows] == ["done", "done", "failed: no frame"]
    assert rows[0] | {"name": "a", "frames": 30, "ate_m": 0.01, "parts": 1, "change": ""} == rows[0]
    assert rows[1]["ate_m"] is rows[2]["frames"] is None
    assert rows_of(jobs, {}, [])[2]["state"] == "not done"


def test_a_damaged_recording_is_told_from_a_whole_one_in_every_table(jobs, tmp_path):
    damage = ["cut at byte 9: what came later is missing", "3 more <of such>"]
    rows = rows_of([*jobs, job("cut", tmp_path / "results", source_damage=damage)], {}, [])
    assert [row["source_damage"] for row in rows] == ["", "", "", "; ".join(damage)]
    assert rows[3]["state"] == "done"
    assert totals_of(rows)["damaged"] == 1
    write_summary(tmp_path, rows)
    with (tmp_path / "summary.csv").open() as file:
        assert [line["source_damage"] for line in csv.DictReader(file)][3] == "; ".join(damage)
    words = (tmp_path / "summary.html").read_text()
    assert "what came later is missing; 3 more &lt;of such&gt;" in words
    assert "damaged 1" in words


@pytest.mark.parametrize(
    ("now", "word"),
    [
        ({}, "same"),
        ({"ate_m": 0.0101}, "same"),
        ({"ate_m": 0.008}, "better"),
        ({"ate_m": 0.02}, "worse"),
        ({"completeness": 0.9}, "worse"),
        ({"ate_m": 0.008, "rpe_1s_m": 0.006}, "mixed"),
        ({"ate_m": None}, "same"),
        ({"state": "failed: killed"}, "worse"),
    ],
)
def test_better_and_worse_are_told_by_the_judged_figures(now, word):
    old = {"state": "done", **REPORT}
    assert change_of(old, old | now) == word
    opposite = {"better": "worse", "worse": "better"}
    assert change_of(old | now, old) == opposite.get(word, word)


def test_a_recording_is_compared_with_the_baselines_of_the_same_content(jobs, tmp_path):
    before = rows_of([job("older name", tmp_path / "then", ate_m=0.02)], {}, [])
    before[0]["content"] = "content of a"
    rows = rows_of(jobs, {}, before)
    assert [row["change"] for row in rows] == ["better", "new", "new"]
    assert rows[0]["baseline_ate_m"] == 0.02
    assert rows[1]["baseline_ate_m"] is None
    totals = {"recordings": 3, "done": 2, "better": 1, "new": 2, "median_ate_m": 0.01}
    assert totals_of(rows) | totals == totals_of(rows)


def test_the_files_say_the_same_and_are_written_once(jobs, tmp_path):
    rows = rows_of(jobs, {}, [])
    write_summary(tmp_path, rows)
    assert read_rows(tmp_path) == rows
    with (tmp_path / "summary.csv").open() as file:
        table = list(csv.DictReader(file))
    assert [line["name"] for line in table] == ["a", "b & <c>", "d"]
    assert float(table[0]["ate_m"]) == 0.01
    assert table[1]["ate_m"] == ""
    first = {path: (path.stat().st_mtime_ns, path.read_bytes()) for path in tmp_path.glob("summary.*")}
    assert len(first) == 3
    write_summary(tmp_path, rows)
    assert {path: (path.stat().st_mtime_ns, path.read_bytes()) for path in tmp_path.glob("summary.*")} == first
    (tmp_path / "summary.html").unlink()
    write_summary(tmp_path, rows)
    assert {path: path.read_bytes() for path in first} == {path: content for path, (_, content) in first.items()}


def test_the_page_stands_alone_and_leads_to_the_results(jobs, tmp_path):
    write_summary(tmp_path, rows_of(jobs, {}, rows_of(jobs[:1], {}, [])))
    text = (tmp_path / "summary.html").read_text()
    assert "b &amp; &lt;c&gt;" in text
    assert "<c>" not in text
    assert text.count("<svg") == text.count("</svg>") == 1
    assert "ATE, m" in text
    for link in re.findall(r'<a href="(results/[^"]+)"', text):
        assert (tmp_path / link).is_dir()
    assert not re.search(r"(?:src|href)=\"https?:", text)


@pytest.mark.parametrize(("least", "most"), [(0.011, 0.018), (0.004, 0.05), (0.001, 3.0)])
def test_numbers_of_the_pages_plots_can_be_read(jobs, tmp_path, monkeypatch, least, most):
    drawn = sheets_drawn(monkeypatch)
    row = rows_of(jobs, {}, [])[0]
    page([row | {"name": str(i), "ate_m": least * (most / least) ** (i / 11)} for i in range(12)], totals_of([row]))
    (axis,) = (one for one in drawn[0].axes if one.get_title() == "ATE, m")
    low, high = axis.get_xlim()
    assert sum(low <= at <= high for at in axis.get_xticks()) >= 1
    assert not on_each_other(drawn[0])


def test_the_page_says_what_its_rings_are(jobs):
    alone, beside = rows_of(jobs, {}, []), rows_of(jobs, {}, rows_of(jobs[:1], {}, []))
    assert "Rings: the baseline" in page(beside, totals_of(beside))
    assert "Rings" not in page(alone, totals_of(alone))


def test_the_page_of_very_many_recordings_stays_one_that_can_be_read(jobs, monkeypatch):
    drawn = sheets_drawn(monkeypatch)
    row = rows_of(jobs, {}, [])[0]
    text = page([row | {"name": f"recording {i}"} for i in range(1500)], totals_of([row]))
    assert "in the order of the table" in text
    assert not drawn[0].axes[0].get_yticks().size
    assert sorted(drawn[0].axes[0].get_ylim()) == [-1, 1500]


def test_a_name_that_is_no_utf8_is_shown_as_far_as_it_can_be(tmp_path):
    names = map(os.fsdecode, (b"caf\xe9", b"th\xe9"))
    done, failed = (replace(job("a", tmp_path / "results"), name=name) for name in names)
    rows = rows_of([done, failed], {failed.name: f"failed: {failed.name}"}, [])
    write_summary(tmp_path, rows)
    for name in ("summary.html", "summary.csv"):
        assert "caf\N{REPLACEMENT CHARACTER}" in (tmp_path / name).read_text()
    assert rows[1]["state"] == "failed: th\N{REPLACEMENT CHARACTER}"


def test_a_summary_without_recordings_is_one(tmp_path):
    write_summary(tmp_path, [])
    assert read_rows(tmp_path) == []


@pytest.mark.parametrize("text", [None, "", "{}", "[]", '{"recordings": [3]}', '{"recordings": [{"name": "a"}]}'])
def test_what_is_no_summary_is_refused_as_a_baseline(tmp_path, text):
    if text is not None:
        (tmp_path / "summary.json").write_text(text)
    with pytest.raises(SourceError, match=r"summary\.json"):
        read_rows(tmp_path)
