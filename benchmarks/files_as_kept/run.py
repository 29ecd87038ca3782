"""From files as labs keep them, by the proposed mapping, to a verdict: python run.py OUT [--seed S] [--sets ...]."""

import argparse
import json
import os
import shutil
import sys
import time
from pathlib import Path

os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"
sys.path.insert(0, str(Path(__file__).parent))

import numpy as np
from sets import SETS


def imported(folder, kept):
    """Import a set as proposed, then as a person answers; return the counts."""
    from tacdata import documents
    from tacdata.importing.imported_session import import_session
    from tacdata.importing.proposing.description import described
    from tacdata.importing.proposing.proposal import proposed_mapping
    from tacdata.importing.proposing.trial_run import tried

    source = folder / kept.source
    kinds, _ = described(source)
    proposal = proposed_mapping(source, kinds)
    row = {"asked": len(proposal.questions), "as_proposed": tried(source, proposal.mapping, folder).startswith("tried")}
    documents.write(folder / "mapping.yaml", proposal.mapping | kept.answers, "import_mapping")
    made = import_session(source, folder / "mapping.yaml", folder / "session")
    return row | {"recordings": made.recordings, "refused": len(made.refused)}


def judged(out, name, seed):
    """Make, import and judge one set; return its row."""
    path = out / f"{name}-{seed}.json"
    if path.exists():
        return json.loads(path.read_text())
    from tacdata.discrepancy.data.recordings import course_of
    from tacdata.discrepancy.judge import judge
    from tacdata.discrepancy.model.spec import read_spec
    from tacdata.discrepancy.report.text import in_text

    folder = out / f"{name}-{seed}"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    kept = SETS[name](folder, np.random.default_rng([seed, *name.encode()]))
    begun = time.process_time()
    row = {
        "set": name,
        "seed": seed,
        "mechanisms": kept.mechanisms,
        "families": kept.families,
        **imported(folder, kept),
    }
    verdict = judge(course_of([folder / "session"]), read_spec(None)).document
    row |= {"seconds": time.process_time() - begun, "verdict": verdict, "text": in_text(verdict)}
    path.write_text(json.dumps(row))
    shutil.rmtree(folder, ignore_errors=True)
    return row


def outcome(row):
    """Return whether a verdict fits the true effects, as in ../real_kinds."""
    mechanisms, families = set(row["mechanisms"]), set(row["families"])
    effects = row["verdict"]["effects"]
    named = [e for e in effects if e["status"] == "named" and e.get("level", "form")]
    named += [e for e in effects if e["status"] == "ambiguous" and e.get("level") == "family"]
    sets = [{e["mechanism"], *e["alternatives"]} for e in effects if e["status"] in ("named", "ambiguous")]
    told = {e["family"] for e in named} | {
        e["family"]
        for e in effects
        if e["status"] == "ambiguous" and {e["mechanism"], *e["alternatives"]} <= mechanisms
    }
    return {
        "family": bool(told & families),
        "mechanism": any(s & mechanisms and len(s) <= 2 for s in sets),
        "wrong": any(
            e["family"] not in families or (e.get("level") != "family" and e["mechanism"] not in mechanisms)
            for e in named
        ),
        "suspected": any({e["mechanism"], *e["alternatives"]} & mechanisms for e in effects),
    }


def line(row):
    """Return a row of the table."""
    said = " + ".join(
        f"{'/'.join([e['mechanism'], *e['alternatives'][:3]])} ({e['status']})" for e in row["verdict"]["effects"]
    )
    good = ", ".join(key for key, value in outcome(row).items() if value)
    sealed, share = row["verdict"]["sealed"], ""
    if row["verdict"]["effects"] and sealed.get("certain"):
        share = "{:.0f} ({:.0f} to {:.0f})".format(*(100 * part for part in (sealed["closed"], *sealed["interval"])))
    proposed = "yes" if row["as_proposed"] else "asks"
    cells = (row["set"], proposed, row["asked"], row["recordings"], row["verdict"]["status"], said, good, share)
    return f"| {' | '.join(map(str, cells))} | {row['seconds']:.0f} |"


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--sets", nargs="*", default=list(SETS))
    parser.add_argument("--seed", type=int, default=1000, help="seeds 1000 to 4999 are for development")
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    print("| set | as proposed | questions | recordings | status | effects | right | gap closed [%] | CPU [s] |")
    rows = []
    for one in given.sets:
        rows.append(judged(given.out, one, given.seed))
        print(line(rows[-1]), flush=True)
    hidden = [outcome(row) for row in rows if row["mechanisms"]]
    print(
        {key: sum(o[key] for o in hidden) for key in ("family", "mechanism", "wrong", "suspected")}, "of", len(hidden)
    )
