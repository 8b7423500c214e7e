"""The proof's page: what it shows, and what it never shows."""

from challenge.judging.judge import judge
from challenge.proof.page import Judged, write_page
from challenge.proof.scoreboard import figures


def test_judge_scores_and_writes_a_page(judged, bowed, tmp_path, monkeypatch):
    monkeypatch.setattr("challenge.proof.page.stage", lambda secret: bowed[1])  # staged already
    scored = judge(judged)
    score = scored["cases"]["case-001"]["score"]
    assert score["top_1"] == 1
    assert score["recovered"] == 1.0  # more than the oracle counts as much
    page = tmp_path / "docs" / "proof.md"
    page.parent.mkdir()
    mine = [Judged.of(scored, judged)]
    write_page(mine, page, commit="abc")
    assert (page.parent / "pictures" / "proof-instrument.png").exists()
    write_page(mine, page, commit="abc")
    text = page.read_text()
    assert text.count("- seed 1 ") == 1  # one record for a run, however often it is judged
    assert "Single faults, medium and strong: named rightly, first | 1 of 1" in text
    assert (page.parent / "pictures" / "proof-power.png").exists()
    assert any(f.name == "alarms on nulls" for f in figures(scored))


def test_a_page_shows_no_case_of_a_test_set_and_no_seed(judged, tmp_path):
    scored = {**judge(judged), "population": "test", "family": "second", "seed": 424242}
    page = tmp_path / "proof.md"
    page.write_text("## Record of sealed runs\n\n- seed 9 (160 cases): alarms 0 of 60\n")
    write_page([Judged.of(scored, judged)], page, commit="abc")
    text = page.read_text()
    assert "case-001" not in text
    assert "line_bow |" not in text.split("What was hidden, what was reported")[0]
    assert "424242" not in text
    assert "- seed 9 (160 cases)" in text
    assert "- test set, commit abc (1 cases)" in text
    assert not list(tmp_path.glob("pictures/proof-story*"))
