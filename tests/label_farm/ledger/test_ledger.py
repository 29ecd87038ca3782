"""The queue: each job to one worker at a time, none forgotten."""

import errno
import os
import subprocess
import sys
from dataclasses import replace

import pytest
from farm_examples import HERE

from tacdata.errors import FormatError, UsageError
from tacdata.label_farm.ledger.ledger import DONE, FAILED, LEASED, MAX_TRIES, WAITING, Ledger, owner_name
from tacdata.label_farm.ledger.roster import Roster
from tacdata.label_farm.presses.job import Job

MODEL = "a" * 64


def jobs(count, model=MODEL):
    return [
        Job("0" * 64, model, {"shape": "sphere", "radius": 2.0}, float(k), 0.0, 0.0, (0.0, 1.0, 0.0))
        for k in range(count)
    ]


@pytest.fixture
def ledger(tmp_path):
    with Ledger(tmp_path / "ledger.sqlite") as opened:
        yield opened


def test_each_job_goes_to_one_worker(ledger):
    ledger.enqueue(jobs(5))
    ledger.enqueue(jobs(5))
    taken = [lease.job.x for worker in "abc" for lease in ledger.claim(worker, MODEL, 2)]
    assert sorted(taken) == [0, 1, 2, 3, 4] and not ledger.claim("d", MODEL)
    assert ledger.counts() == {WAITING: 0, LEASED: 5, DONE: 0, FAILED: 0}


def test_a_higher_priority_comes_first_and_other_models_are_left_alone(ledger):
    ledger.enqueue(jobs(3))
    ledger.enqueue(jobs(3)[2:], priority=5)
    ledger.enqueue(jobs(1, "b" * 64), priority=9)
    assert [lease.job.x for lease in ledger.claim("a", MODEL, 3)] == [2, 0, 1]


def test_a_silent_worker_loses_its_job_and_a_beating_one_keeps_it(tmp_path):
    with Ledger(tmp_path / "ledger.sqlite", lease_seconds=-1.0) as short, Ledger(tmp_path / "ledger.sqlite") as long:
        short.enqueue(jobs(2))
        first, second = short.claim("silent", MODEL)[0], short.claim("beating", MODEL)[0]
        long.heartbeat("beating")
        (again,) = long.claim("other", MODEL, 5)
        assert again.job == first.job and again.tries == 2
        assert not long.finish(first.job.key, "silent", 1.0), "the lease was lost"
        assert long.finish(first.job.key, "other", 1.0) and long.finish(second.job.key, "beating", 1.0)
        assert long.counts()[DONE] == 2


def test_changes_are_told_once_in_order(ledger):
    ledger.enqueue(jobs(3))
    start = ledger.last_change()
    a, b, c = ledger.claim("w", MODEL, 3)
    ledger.finish(b.job.key, "w", 2.5)
    ledger.fail(a.job.key, "w", "no equilibrium")
    first = ledger.changes(start)
    assert [(x.key, x.done, x.error, x.seconds) for x in first] == [
        (b.job.key, True, "", 2.5),
        (a.job.key, False, "no equilibrium", 0.0),
    ]
    ledger.finish(c.job.key, "w", 1.0)
    assert [x.key for x in ledger.changes(first[-1].number)] == [c.job.key]


def test_a_job_that_kills_its_workers_is_not_given_back_for_ever(ledger):
    ledger.enqueue(jobs(1))
    for _ in range(MAX_TRIES - 1):
        ledger.claim("w", MODEL)
        assert ledger.release("w", blame=True) == []
    ledger.claim("w", MODEL)
    (kept,) = ledger.release("w", blame=True)
    assert kept.tries == MAX_TRIES and ledger.fail(kept.job.key, "w", "deadly")
    assert not ledger.claim("w", MODEL)


def test_being_stopped_is_not_held_against_a_job(ledger):
    ledger.enqueue(jobs(1))
    for _ in range(MAX_TRIES + 2):
        assert ledger.claim("w", MODEL)[0].tries == 1
        assert ledger.release("w", blame=False) == []


def test_leases_of_the_dead_and_of_before_a_restart_are_given_back(tmp_path):
    path = tmp_path / "ledger.sqlite"
    dead = subprocess.run(
        [sys.executable, "-c", "from tacdata.label_farm.ledger.ledger import owner_name; print(owner_name())"],
        capture_output=True,
        text=True,
        check=True,
        cwd=HERE.parent.parent,
    ).stdout.strip()
    with Ledger(path) as ledger:
        ledger.enqueue(jobs(3))
        ledger.claim(dead, MODEL)
        (mine,) = ledger.claim(owner_name(), MODEL)
        ledger._boot = "before"
        ledger.claim("elsewhere/1", MODEL)
    with Ledger(path) as ledger:
        assert ledger.counts()[LEASED] == 3
        ledger.release_dead()
        assert ledger.counts() == {WAITING: 2, LEASED: 1, DONE: 0, FAILED: 0}
        assert ledger.finish(mine.job.key, owner_name(), 0.0)


def test_claims_use_the_indices(ledger):
    from tacdata.label_farm.ledger import tables as tables

    ledger.enqueue(jobs(20))
    statements = {
        tables.FIRST_WAITING: (MODEL,),
        tables.WAITING_TOGETHER: (MODEL, 5),
        tables.FIRST_EXPIRED: (MODEL, 0.0),
    }
    for statement, values in statements.items():
        plan = [row[3] for row in ledger.rows("EXPLAIN QUERY PLAN " + statement, values)]
        assert not [step for step in plan if step.startswith("SCAN") or "TEMP B-TREE" in step], plan
    plan = [row[3] for row in ledger.rows("EXPLAIN QUERY PLAN " + tables.OPEN, 2 * (MODEL, 5))]
    assert sum("(model=?)" in step for step in plan) == 2 and "SCAN job" not in " ".join(plan), plan


def test_jobs_of_all_indenters_are_taken_together_by_priority(ledger):
    ledger.enqueue(jobs(4))
    other = [replace(job, indenter={"shape": "sphere", "radius": 3.0}) for job in jobs(6)[4:]]
    ledger.enqueue(other, priority=1)
    assert [lease.job.x for lease in ledger.claim("a", MODEL, 3)] == [4, 5, 0]
    assert [lease.job.x for lease in ledger.claim("a", MODEL, 5)] == [1, 2, 3]


def test_a_batch_is_no_more_than_a_workers_share(ledger):
    roster = Roster(ledger)
    for name in ("remote:a/1", "remote:b/1", "remote:c/1"):
        roster.enter(name, "cuda:0")
    roster.note("remote:c/1", "refuses the model")
    ledger.enqueue(jobs(9))
    first = ledger.claim("remote:a/1", MODEL, 256)
    assert len(first) == 5, "nine jobs, two workers that work"
    assert len(ledger.claim("remote:b/1", MODEL, 256)) == 4, "what another holds counts as well"
    for lease in first:
        ledger.finish(lease.job.key, "remote:a/1", 0.0)
    ledger.enqueue([replace(job, x=job.x + 100.0) for job in jobs(300)])
    assert len(ledger.claim("remote:a/1", MODEL, 100)) == 100, "never more than a model likes"
    roster.leave("remote:b/1")
    assert len(ledger.claim("remote:a/1", MODEL, 256)) == 200, "one that is gone has no share"


def test_a_batch_whose_worker_died_is_tried_one_by_one(ledger):
    ledger.enqueue(jobs(3))
    assert len(ledger.claim("w", MODEL, 3)) == 3
    assert ledger.release("w", blame=True) == []
    for x in range(3):
        (lease,) = ledger.claim("w", MODEL, 3)
        assert (lease.job.x, lease.tries) == (x, 1), "who shared the blame starts anew, alone"


def test_withdrawn_jobs_leave_unless_another_run_wants_them(ledger):
    ledger.enqueue(jobs(3), run="mine")
    ledger.enqueue(jobs(4)[2:], priority=7, run="yours")
    (worked_on,) = ledger.claim("w", MODEL)
    assert worked_on.job.x == 2, "the highest priority that anyone asked for"
    ledger.release("w", blame=False)
    ledger.prioritize("yours", -1)
    assert ledger.claim("w", MODEL)[0].job.x == 0
    assert ledger.withdraw("mine") == 1, "job 0 is worked on, job 2 is wanted by another"
    assert ledger.counts() == {WAITING: 2, LEASED: 1, DONE: 0, FAILED: 0}
    assert {lease.job.x for lease in ledger.claim("w", MODEL, 9)} == {2, 3}


@pytest.mark.parametrize("end", ["given back", "killed", "silent", "restarted"])
def test_a_withdrawn_job_in_work_is_not_solved_again(tmp_path, end):
    owner = "w" if end != "restarted" else f"{owner_name().split('/')[0]}/999999999"
    with Ledger(tmp_path / "ledger.sqlite", -1.0 if end == "silent" else 30.0) as ledger:
        ledger.enqueue(jobs(1), run="mine")
        ledger.enqueue(jobs(2)[1:], run="yours")
        assert len(ledger.claim(owner, MODEL, 2)) == 2
        ledger.withdraw("mine")
        assert ledger.counts()[LEASED] == 2, "it is solved to its end"
        if end == "restarted":
            ledger.release_dead()
        elif end != "silent":
            ledger.release(owner, blame=end == "killed")
        assert [lease.job.x for lease in ledger.claim("other", MODEL, 9)] == [1.0]
        assert sum(ledger.counts().values()) == 1


def test_a_withdrawn_job_in_work_that_is_asked_for_anew_is_given_back(ledger):
    ledger.enqueue(jobs(1), run="mine")
    (lease,) = ledger.claim("w", MODEL)
    ledger.withdraw("mine")
    ledger.enqueue(jobs(1), run="again")
    ledger.release("w", blame=False)
    assert ledger.claim("other", MODEL)[0].job == lease.job


def test_models_are_offered_by_the_priority_of_their_first_job(ledger):
    ledger.register({MODEL: {}, "b" * 64: {}, "c" * 64: {}})
    ledger.enqueue(jobs(2))
    ledger.enqueue(jobs(1, "b" * 64), priority=3)
    assert ledger.offered() == ["b" * 64, MODEL]


@pytest.mark.parametrize("content", [b"this is no database" * 100, None])
def test_an_unusable_ledger_is_said_in_words(tmp_path, content):
    path = tmp_path / "ledger.sqlite"
    if content is None:
        with Ledger(path) as ledger:
            ledger._db.execute("PRAGMA user_version = 99")
    else:
        path.write_bytes(content)
    with pytest.raises(FormatError, match=r"damaged|layout 99") as error:
        Ledger(path)
    assert "no result is lost" in error.value.remedy


def test_a_drive_without_locks_is_refused_at_once_with_the_way_out(tmp_path, monkeypatch):
    def refused(stream, operation):
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr("fcntl.lockf", refused)
    with pytest.raises(UsageError, match="its drive locks no files") as error:
        Ledger(tmp_path / "ledger.sqlite")
    assert "--store FOLDER" in error.value.remedy
    assert not list(tmp_path.iterdir())
