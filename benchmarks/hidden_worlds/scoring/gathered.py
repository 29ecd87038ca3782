"""Every judged world with its truth and its figures, as plain rows."""

import json

import numpy as np

from scoring import measures
from scoring.outcome import accepted, family_right, found, outcome


def rows(out, label):
    """Return a row for each judged world of a label, by identity."""
    made = []
    for path in sorted((out / "verdicts" / label).glob("*.json")):
        answer, truth = json.loads(path.read_text()), json.loads((out / "truth" / path.name).read_text())
        verdict = answer["verdict"]
        row = {
            "id": truth["id"],
            "block": truth["block"],
            "name": truth["name"],
            "response": truth["response"],
            "effects": list(truth["effects"]),
            "times": truth["times"],
            "facts": truth["facts"],
            "expected": truth["expected"],
            "settings": truth["settings"],
            "outcome": outcome(truth, verdict),
            "engine": answer["engine"],
            "seconds": answer["seconds"],
            "status": verdict and verdict["status"],
            "told": verdict and [[m["mechanism"], *m["alternatives"]] for m in verdict["effects"]],
        }
        if verdict is not None:
            row["family"] = family_right(truth, verdict)
            row["parameters"] = measures.parameters(truth, verdict)
            row["confidence"] = measures.confidences(truth, verdict, accepted)
            row["found"] = {name: found(truth, verdict, name) for name in truth["effects"]}
            row |= figures(path.with_suffix(".npz"), out / "truth" / f"{truth['id']}.npz", truth, verdict)
        made.append(row)
    return made


def figures(said_path, truth_path, truth, verdict):
    """Return gap closed and error of labels, where a model was written and the world has something in it."""
    if not said_path.exists() or truth["response"] != "table" or truth["expected"] == "none":
        return {}
    said, known = dict(np.load(said_path)), dict(np.load(truth_path))
    known = {k: v.astype(float) for k, v in known.items()}
    before, after = measures.labels(said, known, verdict["status"] == "named")
    return {"gap": measures.gap(said, known), "label_before": before, "label_after": after}
