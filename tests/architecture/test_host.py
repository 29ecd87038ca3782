"""What a host adds to Python's own threads."""

import pytest

from tacdata.host import Host


def test_an_interrupt_before_the_lock_is_taken_back_is_not_hidden(monkeypatch):
    condition = Host().condition()

    def interrupted(state):
        raise KeyboardInterrupt

    monkeypatch.setattr(condition, "_acquire_restore", interrupted)
    with pytest.raises(KeyboardInterrupt), condition:
        condition.wait(0.001)


def test_a_lock_that_is_not_held_is_still_an_error():
    condition = Host().condition()
    with pytest.raises(RuntimeError), condition:
        condition.release()
