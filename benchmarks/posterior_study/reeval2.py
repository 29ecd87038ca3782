"""reeval2.py OUT LABELS [-v]: outcomes from kept Grams, with the present conclude."""
import sys, json, pickle, os
from types import SimpleNamespace
from pathlib import Path
from dataclasses import replace
from collections import defaultdict
import numpy as np
sys.path.insert(0, "/work/wt/posterior/benchmarks/hidden_worlds"); sys.path.insert(0, "/work/out/posterior")
from scoring.outcome import outcome, RIGHT, WRONG
from tacdata.discrepancy.posterior.policy import POLICY
from tacdata.discrepancy.posterior.priors import SetPrior
from tacdata.discrepancy.posterior.bag import bagged
from tacdata.discrepancy.report import conclude as C
import new as N
def gains_docs(rec, c):
    from tacdata.discrepancy.report.calibration import gains_beyond_calibration
    from tacdata.effects import load
    if "gains" not in rec or rec["fitted"]: return []
    s = rec["setting"]; setting = SimpleNamespace(channel_gain=load(s["channel"]) if s["channel"] else None, nuisance=s["nuisance"], course=SimpleNamespace(force=1 if s["force"] else None))
    return gains_beyond_calibration(setting, np.asarray(rec["gains"]), np.asarray(rec["halves"]))
def main(out, labels, words):
    files = {}
    for l in labels.split("+"): files |= {f.name: f for f in (out / l).glob("*.pkl")}
    tot = defaultdict(lambda: [0] * 7)
    for f in sorted(files.values(), key=lambda f: f.name):
        if words and words[0] != "-v" and f.stem[:4] not in words: continue
        truth = json.loads((out / "truth" / f"{f.stem}.json").read_text()); today = json.loads((out / "today" / f"{f.stem}.json").read_text())
        rec = pickle.load(open(f, "rb")); prior = SetPrior.of(rec["effects"], POLICY)
        post = bagged(rec["models"], prior, POLICY); coarse = bagged(rec["models"], prior, POLICY, POLICY.coarse)
        e = rec.get("empty") or rec.get("first")
        if e and e[0] > post.empty:
            k = post._empty; w = post.weights * (1 - e[0]) / max(1 - post.empty, 1e-300); w[k] = post.weights[k] / max(post.weights[k].sum(), 1e-300) * e[0]; post = replace(post, weights=w)
        cached = C.presences
        seen = []
        C.presences = lambda *a: seen.append(cached(*a)) or seen[-1]
        c = C.conclude(SimpleNamespace(posterior=post, coarse=coarse, prior=prior, given=SimpleNamespace(grams=SimpleNamespace(rows=np.einsum("eii->e", rec["models"][0].gram)))), POLICY)
        C.presences = cached
        c = C.with_gains(c, gains_docs(rec, c))
        c = C.with_alarms(replace(c, odd=tuple(rec.get("odd", ()))), tuple(SimpleNamespace(seen=a) for a in rec.get("alarms", ())))
        doc = N.document(c)
        if rec.get("contradictions") or rec.get("few"): doc["status"] = "unknown"
        a, b = outcome(truth, today["verdict"]), outcome(truth, doc)
        for key in (truth["block"], "all"):
            r = tot[key]; r[0] += 1; r[1] += a in RIGHT; r[2] += b in RIGHT; r[3] += a in WRONG; r[4] += b in WRONG
        print(" " if a == b else "*", f.stem[:4], truth["block"], truth["name"], truth["response"], "|", a, "|", b, "|", N.line(doc), "there", [round(x, 3) for x in (seen[0] if seen else ())], flush=True)
    for k, r in tot.items(): print(k, r[:5])
if __name__ == "__main__": main(Path(sys.argv[1]), sys.argv[2], sys.argv[3:])
