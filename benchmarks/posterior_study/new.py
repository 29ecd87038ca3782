"""new.py OUT LABEL [ids...]: conclusions on prepared worlds; documents as the scorer reads them."""
import sys, time, json, pickle, gc, os, traceback
from pathlib import Path
from dataclasses import replace
import numpy as np
def document(c):
    effects = []
    for e in c.surest_first:
        effects.append({"mechanism": e.placed.effect.called, "effect": e.placed.effect.name, "status": e.certainty.value, "level": e.level and e.level.value, "family": e.placed.effect.family.value,
          "alternatives": list(e.alternatives), "confidence": e.probability if not e.by_calibration else None, "pfamily": e.family, "pform": e.form, "bought": e.bought,
          "parameters": {n: {"value": p.value.tolist(), "error": p.error.tolist(), "interval": [x.tolist() for x in p.interval], "unit": p.unit} for n, p in e.estimates.items()}})
    s = c.sealed
    return {"status": c.status.value, "reason": c.reason.value, "effects": effects, "remainder": c.remainder, "nothing": c.nothing, "mechanisms": dict(list(c.mechanisms.items())[:8]), "families": dict(c.families),
      "sizes": {str(k): v for k, v in c.sizes.items()}, "sets": [[[p.effect.name for p in x.placed], x.probability, x.log_evidence] for x in c.sets[:12]], "alarms": [a.seen for a in c.alarms], "odd": list(c.odd),
      "sealed": s and {"interval": list(s.interval), "before": float(s.before.mean()), "after": float(s.after.mean()), "ratio": s.ratio and {"power": s.ratio.power, "share": s.ratio.share, "error": s.ratio.error, "refutes": bool(s.ratio.refutes), "bears_out": bool(s.ratio.bears_out)}}}
def line(d): return d["status"] + "/" + d["reason"] + ": " + ", ".join(e["mechanism"] + "/" + "/".join(e["alternatives"][:3]) + f"[{e['status'][:5]} {e['level']}]" for e in d["effects"]) + " " + str({k: round(v, 2) for k, v in list(d["mechanisms"].items())[:4]}) + f" rem {d['remainder']:.2f} nothing {d['nothing']:.2f}"
def main(out, label, ids):
    from tacdata.discrepancy.report import judgement as R
    from tacdata.discrepancy.posterior.policy import POLICY
    assert R.__file__.startswith(os.environ["ROOT"])
    caught = {}
    real = R.posterior_of
    def spy(*a): caught["s"] = real(*a); return caught["s"]
    R.posterior_of = spy
    kept = out / label; kept.mkdir(exist_ok=True)
    idle = 0
    while True:
        todo = [f for f in sorted((out / "prepared").glob("*.pkl")) if not (kept / f"{f.stem}.json").exists() and not (kept / f"{f.stem}.lock").exists() and (not ids or f.stem[:4] in ids or f.stem in ids)]
        if not todo:
            if ids or os.environ.get("ONCE") or idle > 120: break
            idle += 1; time.sleep(15); continue
        idle = 0
        f = todo[0]
        try: (kept / f"{f.stem}.lock").open("x").close()
        except FileExistsError: continue
        d = pickle.load(open(f, "rb")); given = d["given"]; setting = given.setting
        t = time.process_time()
        try:
            c = R.concluded(d["course"], setting, given=given)
            sec = time.process_time() - t
            doc = document(c); doc["seconds"] = sec
            s = caught["s"]; post = s.posterior
            rec = {"models": [replace(m, gram=m.gram.astype(np.float32), response=None) for m in post.models], "effects": [x.effect for x in given.candidates], "coarse": s.coarse.weights, "weights": post.weights, "first": [s.first.empty, s.first.nothing] if hasattr(s, "first") else None}
            pickle.dump(rec, open(kept / f"{f.stem}.pkl", "wb"), protocol=5)
            said = line(doc)
        except Exception:
            doc = {"error": traceback.format_exc(), "seconds": None, "status": "crashed", "effects": []}; said = doc["error"][-600:]
        (kept / f"{f.stem}.json").write_text(json.dumps(doc, default=float))
        t = json.loads((out / "today" / f"{f.stem}.json").read_text()) if (out / "today" / f"{f.stem}.json").exists() else {"block": "?", "name": "?", "response": "", "seconds": 0, "verdict": None}
        print(f.stem[:6], t["block"], t["name"], t["response"], "| today", round(t["seconds"] or 0, 1), t["verdict"] and (t["verdict"]["status"], [(e["mechanism"], e["status"][:5], e.get("level")) for e in t["verdict"]["effects"]]), "\n    | new", doc["seconds"] and round(doc["seconds"], 1), said, flush=True)
        (kept / f"{f.stem}.lock").unlink(missing_ok=True)
        del d, given, setting; caught.clear(); gc.collect()
if __name__ == "__main__": main(Path(sys.argv[1]), sys.argv[2], sys.argv[3:])
