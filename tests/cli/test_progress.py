"""What a long command says while it runs, where nobody watches a terminal."""

import pytest

from blast_env.cli import output


def test_a_log_file_gets_a_line_now_and_then(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    passed_s = 0.0
    monkeypatch.setattr(output, "perf_counter", lambda: passed_s)
    with output.progress_bar("training runs/a") as progress:
        for step in range(1, 101):
            passed_s += 1.0
            progress(step / 100)
            if step == 30:
                printed = capsys.readouterr().err
    assert printed == "training runs/a: 30% after 30 s\n"
    assert capsys.readouterr().err == (
        "training runs/a: 60% after 60 s\ntraining runs/a: 90% after 90 s\n"
    )
