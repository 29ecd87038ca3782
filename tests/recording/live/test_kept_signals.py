"""Ctrl-C while something moves, wherever it finds the thread."""

import os
import signal

import pytest

from tacdata.cli import last_words
from tacdata.recording.live.interruption import Interruption


def ctrl_c(number=signal.SIGINT):
    os.kill(os.getpid(), number)


class Finalized:
    """Gets Ctrl-C where an exception is lost."""

    def __del__(self):
        ctrl_c()


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_without_an_interruption_one_in_a_finalizer_is_lost():
    """Why the class is there: should Python ever change this, it may go."""
    Finalized()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_kept_signal_waits_until_it_is_asked_for(number):
    with Interruption() as interruption, pytest.raises(KeyboardInterrupt), interruption.kept():
        interruption.check()
        ctrl_c(number)
        done = True
        interruption.check()
        done = False
    assert done


def test_one_in_a_finalizer_is_kept():
    with Interruption() as interruption, pytest.raises(KeyboardInterrupt), interruption.kept():
        Finalized()
        interruption.check()
        pytest.fail("it was lost")


def test_what_nobody_asked_for_is_raised_at_the_end():
    passed = False
    with Interruption() as interruption, pytest.raises(KeyboardInterrupt):
        with interruption.kept():
            ctrl_c()
            passed = True
        pytest.fail("it was lost")
    assert passed


def test_a_second_one_is_raised_at_once_also_after_the_first_was_answered():
    with Interruption() as interruption, interruption.kept():
        ctrl_c()
        with pytest.raises(KeyboardInterrupt):
            ctrl_c()
        with pytest.raises(KeyboardInterrupt):
            interruption.check()
        interruption.check()
        with pytest.raises(KeyboardInterrupt):
            ctrl_c()


def test_the_last_words_are_not_broken_off_but_a_disk_that_hangs_is(monkeypatch):
    with Interruption() as interruption:
        interruption.last_words()
        ctrl_c()
        monkeypatch.setattr(interruption, "_deaf_until", 0.0)
        with pytest.raises(KeyboardInterrupt):
            ctrl_c()


def test_words_of_an_error_are_said_though_a_ctrl_c_took_its_place():
    def both():
        try:
            error = ValueError("the fault")
            error.add_note("  tip: lifted")
            raise error
        finally:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt) as caught:
        both()
    assert last_words(caught.value) == ["  tip: lifted"]
    assert last_words(KeyboardInterrupt()) == []


def test_a_question_to_a_person_ends_at_once():
    with Interruption() as interruption, interruption.kept():
        with interruption.at_once(), pytest.raises(KeyboardInterrupt):
            ctrl_c()
        ctrl_c()
        with pytest.raises(KeyboardInterrupt), interruption.at_once():
            pytest.fail("nobody is asked after a stop")


def test_signals_go_where_they_went_before_and_nohup_stays_nohup():
    numbers = signal.SIGINT, signal.SIGTERM, signal.SIGHUP
    before = [signal.getsignal(number) for number in numbers]
    with Interruption():
        assert all(signal.getsignal(number) != handler for number, handler in zip(numbers, before, strict=True))
    assert [signal.getsignal(number) for number in numbers] == before
    try:
        signal.signal(signal.SIGHUP, signal.SIG_IGN)
        with Interruption():
            assert signal.getsignal(signal.SIGHUP) == signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, before[2])
