"""The tables of the ledger, and SQL statements that several methods share."""

from __future__ import annotations

LAYOUT = 3
"""Of the tables; a ledger of another layout is refused, and may be deleted: no result is in it."""

TABLES = """
CREATE TABLE IF NOT EXISTS job (
    key TEXT PRIMARY KEY, model TEXT NOT NULL, document TEXT NOT NULL, state INTEGER NOT NULL,
    rank INTEGER NOT NULL, changed INTEGER NOT NULL, owner TEXT, boot TEXT, lease REAL,
    tries INTEGER NOT NULL DEFAULT 0, alone INTEGER NOT NULL DEFAULT 0, error TEXT, seconds REAL
);
CREATE TABLE IF NOT EXISTS model (version TEXT PRIMARY KEY, sensor TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS wish (run TEXT NOT NULL, key TEXT NOT NULL, rank INTEGER NOT NULL, PRIMARY KEY (run, key))
    WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS worker (
    owner TEXT PRIMARY KEY, device TEXT NOT NULL, began REAL NOT NULL, seen REAL NOT NULL, boot TEXT NOT NULL,
    done INTEGER NOT NULL DEFAULT 0, failed INTEGER NOT NULL DEFAULT 0, busy REAL NOT NULL DEFAULT 0, note TEXT
);
CREATE INDEX IF NOT EXISTS waiting ON job (model, rank, changed) WHERE state = 0;
CREATE INDEX IF NOT EXISTS together ON job (model, rank, changed) WHERE state = 0 AND alone = 0;
CREATE INDEX IF NOT EXISTS leased ON job (model, lease) WHERE state = 1;
CREATE INDEX IF NOT EXISTS owned ON job (owner) WHERE state = 1;
CREATE INDEX IF NOT EXISTS changes ON job (changed);
CREATE INDEX IF NOT EXISTS states ON job (state);
CREATE INDEX IF NOT EXISTS wished ON wish (key);
"""

NEXT = "(SELECT coalesce(max(changed), 0) + 1 FROM job)"

# Statements of their own, each served by one partial index: "state = 0 OR lease < now" in one scans the whole table.
FIRST_WAITING = "SELECT key, alone FROM job WHERE state = 0 AND model = ? ORDER BY rank, changed LIMIT 1"
WAITING_TOGETHER = (
    "SELECT key FROM job INDEXED BY together WHERE state = 0 AND alone = 0 AND model = ? ORDER BY rank, changed LIMIT ?"
)
FIRST_EXPIRED = "SELECT key FROM job WHERE state = 1 AND model = ? AND lease < ? LIMIT 1"
# Named, as the planner would take the index of all states and pass over other models' jobs one by one.
OPEN = (
    "SELECT (SELECT count(*) FROM (SELECT 1 FROM job INDEXED BY waiting WHERE state = 0 AND model = ? LIMIT ?))"
    " + (SELECT count(*) FROM (SELECT 1 FROM job INDEXED BY leased WHERE state = 1 AND model = ? LIMIT ?))"
)
LIVING = "SELECT count(*) FROM worker WHERE boot = ? AND seen > ? AND note IS NULL"
TAKE = (
    "UPDATE job SET state = 1, owner = ?, boot = ?, lease = ?, tries = tries + 1"
    " WHERE key = ? RETURNING document, tries"
)
GIVE_BACK = "UPDATE job SET state = 0, owner = NULL"
UNWANTED = 2**40
"""Rank of a job in work whose runs were all withdrawn: its result counts, but nobody solves it a second time."""
DROP_UNWANTED = f"DELETE FROM job WHERE rank = {UNWANTED} AND state = 1"
