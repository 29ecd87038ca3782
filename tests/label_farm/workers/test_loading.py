"""Whoever waits for the first press sees how many modules of kernels are compiled."""

import sys

import pytest
from farm_examples import press_episode

from tacdata import warp_runtime
from tacdata.commands import label
from tacdata.label_farm.simulated import crew
from tacdata.label_farm.workers import loading
from tacdata.label_farm.workers.loading import Loading, modules_of
from tacdata.progress import StageBars


def test_kernels_that_load_at_once_are_not_worth_a_word(monkeypatch):
    clock, said = [0.0], []
    monkeypatch.setattr(loading.time, "monotonic", lambda: clock[0])
    report = Loading(said.append)
    report.begin()
    for module in range(1, 7):
        clock[0] += 0.4
        report.loaded(module, 29)
    assert [modules_of([words]) for words in said] == [(3, 29), (6, 29)]
    assert modules_of(["", "refuses model 0123456789ab…", *said]) == (6, 29)
    report.end()
    report.end()
    assert said[2:] == [""] and modules_of(said[2:]) is None


def test_a_worker_that_is_done_hears_nothing_more():
    logger, said = warp_runtime.wp.get_logger(), []
    report = Loading(said.append)
    with pytest.raises(KeyError), report.listening():
        assert warp_runtime.wp.get_logger() is not logger
        raise KeyError
    assert warp_runtime.wp.get_logger() is logger


def test_kernels_of_a_worker_are_progress_of_the_run(tmp_path, label_by_workers, monkeypatch):
    monkeypatch.setenv("FAST_MODEL_MODULES", "2")
    stages = []
    label_by_workers([press_episode(tmp_path, k, x=float(k)) for k in range(2)], progress=lambda *s: stages.append(s))
    counts = [done for stage, done, _ in stages if stage == "compile"]
    assert counts[0] == 1 and counts == sorted(set(counts))
    assert stages.index(("solve", 1, 2)) > len(counts)


def test_a_process_of_a_simulation_reports_its_kernels(tmp_path, monkeypatch):
    said = "print('kernels 12 37'); print('4 '); print('5 no equilibrium')"
    monkeypatch.setattr(crew.environment, "python", lambda module: [sys.executable, "-c", said])
    presses, modules = [], []
    hand = crew._Hand(tmp_path, 6, 0, 1, "cpu", lambda *press: presses.append(press), lambda *m: modules.append(m))
    hand.join()
    hand.stop()
    assert presses == [(4, ""), (5, "no equilibrium")] and modules == [(12, 37)]


def test_the_verb_says_so(capsys):
    with StageBars(label.PAUSE, each_press=True) as bars:
        for done in (1, 2, 3):
            bars.show("compile", done, 29)
    assert capsys.readouterr().out.strip() == "compiling kernels: 1 of about 29 modules"
