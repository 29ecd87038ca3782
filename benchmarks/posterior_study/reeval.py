"""reeval.py OUT LABEL [k=v...]: paired table of today's and the posterior's verdicts, the posterior evaluated again offline."""
import sys, json, pickle, time
from dataclasses import replace
from pathlib import Path
from collections import Counter, defaultdict
sys.path.insert(0, "/work/wt/posterior/benchmarks/hidden_worlds"); sys.path.insert(0, "/work/out/posterior")
import numpy as np
from scoring.outcome import outcome, RIGHT, WRONG, family_right
import offline
from tacdata.discrepancy.posterior.policy import POLICY
from tacdata.discrepancy.posterior.priors import SetPrior
from tacdata.discrepancy.posterior.bag import bagged
ORDER = ["nulls", "singles10", "singles3", "pairs", "outside10", "aliases"]
def main(out, label, words):
    pol = replace(POLICY, **{k: (tuple(map(float, v.split("+"))) if "+" in v else type(getattr(POLICY, k))(float(v))) for k, v in (w.split("=") for w in words if "=" in w)})
    brief = "-v" not in words
    rows = []
    files = {}
    for l in label.split("+"): files |= {f.name: f for f in (out / l).glob("*.json")}
    for f in sorted(files.values(), key=lambda f: f.name):
        truth = json.loads((out / "truth" / f.name).read_text()); today = json.loads((out / "today" / f.name).read_text())
        pk = f.with_suffix(".pkl")
        if not pk.exists() or not (out/"today"/f.name).exists(): continue
        if words and any("=" in w for w in words) or not brief:
            if not pk.exists(): continue
            rec = pickle.load(open(pk, "rb"))
            post = bagged(rec["models"], SetPrior.of(rec["effects"], pol), pol)
            if "empty" in rec and rec["empty"][0] > post.empty:
                from dataclasses import replace as rp
                k = post._empty; w = post.weights * (1 - rec["empty"][0]) / max(1 - post.empty, 1e-300); w[k] = post.weights[k] / max(post.weights[k].sum(), 1e-300) * rec["empty"][0]; post = rp(post, weights=w)
            coarse = bagged(rec["models"], SetPrior.of(rec["effects"], pol), pol, pol.coarse)
            doc = offline.document(rec, post, pol, coarse); doc["seconds"] = rec["seconds"]
        else:
            doc = json.loads(f.read_text())
            post = None
            if doc.get("error"): doc = None
        a, b = outcome(truth, today["verdict"]), outcome(truth, doc)
        rows.append((truth["block"], truth["name"], truth["response"], a, b, today["seconds"], doc and doc["seconds"], family_right(truth, today["verdict"]), family_right(truth, doc)))
        told = lambda d: d and d["status"] + ": " + ", ".join(e["mechanism"] + "/" + "/".join(e["alternatives"][:3]) + f"[{e['status'][:5]} {e.get('level')}]" for e in d["effects"])
        mark = " " if a == b else "*"
        print(mark, f.stem[:6], truth["block"], truth["name"], truth["response"], truth["times"], "\n      today:", a, "|", told(today["verdict"]), "\n      new:  ", b, "|", told(doc), doc and {k: round(v, 2) for k, v in list(doc["mechanisms"].items())[:5]}, doc and f"rem {doc['remainder']:.2f} nothing {doc['nothing']:.2f}")
        if post is not None and not brief:
            for k in np.argsort(-post.sets)[:6]:
                m = post.models[k]; print("          ", "+".join(m.name), round(float(post.sets[k]), 3), "log", round(float(post.logs[k] - post.logs.max()), 1), "tau", np.round(post.weights[k] / max(post.sets[k], 1e-12), 2).tolist())
    print(); tot = defaultdict(lambda: [0] * 10)
    for b, _, _, x, y, s, t, fx, fy in rows:
        for key in (b, "all"):
            r = tot[key]; r[0] += 1; r[1] += x in RIGHT; r[2] += y in RIGHT; r[3] += x in WRONG; r[4] += y in WRONG; r[5] += x == "false alarm without a name"; r[6] += y == "false alarm without a name"; r[7] += s or 0; r[8] += t or 0
    print(f"{'block':10s}  n  right today/new   wrong today/new  alarm  CPU today/new")
    for b in [*ORDER, "all"]:
        if b in tot: r = tot[b]; print(f"{b:10s} {r[0]:3d}   {r[1]:3d} {r[2]:3d}       {r[3]:3d} {r[4]:3d}     {r[5]} {r[6]}   {r[7]/r[0]:.1f} {r[8]/r[0]:.1f}")
if __name__ == "__main__": main(Path(sys.argv[1]), sys.argv[2], sys.argv[3:])
