"""The next presses of a verdict that leaves something open, as a plan or as a table for a foreign machine."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from tacdata import documents
from tacdata.errors import TacdataError
from tacdata.plans import Plan
from tacdata.recording import read_episode, read_session
from tacdata.recording.check.imported import is_imported
from tacdata.recording.session import FILE
from tacdata.revision.comparison import Comparison
from tacdata.revision.next_presses.machine import MachineLimits
from tacdata.revision.next_presses.plan import choose, left_open, plan_of, standard_errors, table_of
from tacdata.revision.next_presses.rivals import rivals

PLAN, TABLE = "next.yaml", "next.csv"
"""Files of the presses: a plan for a rig of our own, a table for a foreign machine."""


class NoPlan(Exception):
    """No press is worth a plan; its text is the reason."""


def recommend(
    recordings: list[Path],
    comparison: Comparison,
    verdict: dict[str, Any],
    target: Path,
    presses: int,
    note: Callable[[str], None] = lambda text: None,
) -> dict[str, Any]:
    """Return the next presses; a plan that cannot be made is a remark, as all else is complete without it.

    Args:
        recordings: The recordings of the verdict.
        comparison: Recordings and model.
        verdict: The verdict.
        target: Folder of the plan.
        presses: Different presses of the plan.
        note: Called with a line of progress.
    """
    # Without a plan the verdict's own words hold, but those that send one here.
    steps = [words for words in verdict["next"] if "`tacdata revise " not in words]
    # Nothing is open, so no press is missing.
    if verdict["status"] in ("named", "none"):
        return {"plan": None, "presses": [], "remark": ""}
    try:
        return _planned(recordings, comparison, verdict, target, presses, note)
    except NoPlan as reason:
        return {"plan": None, "presses": steps, "remark": str(reason)}
    except TacdataError as error:
        return {"plan": None, "presses": steps, "remark": f"no plan: {error.given}"}
    except (ArithmeticError, ValueError, np.linalg.LinAlgError) as error:
        return {"plan": None, "presses": steps, "remark": f"no plan: the presses could not be predicted ({error})"}


def _planned(
    recordings: list[Path],
    comparison: Comparison,
    verdict: dict[str, Any],
    target: Path,
    presses: int,
    note: Callable[[str], None],
) -> dict[str, Any]:
    """Plan presses that distinguish the rivals, within the machine's path and limits.

    Raises:
        NoPlan: If there are no rivals, or no press distinguishes them.
    """
    sessions = [p for p in recordings if (p / FILE).is_file()]
    candidates = rivals(comparison, verdict, note=note)
    if len(candidates) < 2:
        raise NoPlan("no plan: the rivals do not differ in these recordings")
    note("next presses")
    session = read_session(sessions[-1]) if sessions else None
    rig_of_ours = session is not None and not is_imported(read_episode(session.episodes[0]))
    plan = session.plan if session is not None and rig_of_ours else None
    machine = MachineLimits.of_course(comparison.course) if plan is None else MachineLimits.of_plan(plan)
    choices = choose(comparison, candidates, machine, presses)
    if not choices:
        names = ", ".join(r.mechanism for r in candidates)
        raise NoPlan(f"no press at these places distinguishes {names} beyond the noise: another measurement is needed")
    if plan is not None and session is not None:
        file, document = PLAN, plan_of(choices, comparison, plan, f"{plan.name}, next")
        # A plan that its own guide would refuse is no recommendation.
        Plan.from_document(document, PLAN).check_against(session.sensor)
        documents.write(target / PLAN, document, "plan")
    else:
        file = TABLE
        documents.write_text(target / TABLE, table_of(choices, comparison))
    words = []
    for c in choices:
        separation = standard_errors(c.nats[c.best])
        words.append(
            f"{c.trial.in_words(comparison.course.tools[c.trial.tool].name)}: one press distinguishes {c.best[0]} from "
            f"{c.best[1]} by {separation:.1f} standard errors"
        )
    remarks = ["judge the new session together with the earlier ones", left_open(choices)]
    return {"plan": file, "presses": words, "remark": "; ".join(r for r in remarks if r)}
