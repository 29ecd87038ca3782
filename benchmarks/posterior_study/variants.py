import sys, json, pickle, time
from dataclasses import replace
from pathlib import Path
sys.path.insert(0, "/work/wt/posterior/benchmarks/hidden_worlds"); sys.path.insert(0, "/work/out/posterior")
import numpy as np, offline
from scoring.outcome import outcome
from tacdata.discrepancy.posterior.policy import POLICY
from tacdata.discrepancy.posterior.priors import SetPrior
from tacdata.discrepancy.posterior.bag import bagged
V = {"boot": {"share": 1.0}, "share.8": {"share": .8}, "share.63": {"share": .63}, "share.5": {"share": .5}, "full": {"bags": 0}}
out = Path(sys.argv[1])/sys.argv[2]
for f in sorted(out.glob("*.pkl")):
    if len(sys.argv) > 3 and f.stem[:4] not in sys.argv[3:]: continue
    t = json.loads((out.parent/"truth"/f"{f.stem}.json").read_text()); rec = pickle.load(open(f, "rb"))
    print(f.stem[:6], t["block"], t["name"], t["response"], len(rec["models"]))
    for n, v in V.items():
        pol = replace(POLICY, **v); t0 = time.process_time()
        post = bagged(rec["models"], SetPrior.of(rec["effects"], pol), pol); doc = offline.document(rec, post, pol)
        print(f"   {n:9s}", outcome(t, doc), "|", doc["status"], [(e["mechanism"], e["status"][:5], e["level"]) for e in doc["effects"]], {k: round(x, 2) for k, x in list(post.mechanisms.items())[:4]}, f"nothing {post.nothing:.2f} empty {post.empty:.2f} tau", np.round(post.weights.sum(0), 2).tolist(), f"{time.process_time()-t0:.1f}s", flush=True)
