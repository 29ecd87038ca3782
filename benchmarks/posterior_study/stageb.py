"""stageb.py OUT LABEL [ids...]: the posterior of prepared worlds; keeps the sets' Grams."""
import sys, time, json, pickle, gc, traceback
from pathlib import Path
from dataclasses import replace
sys.path.insert(0, "/work/wt/posterior/benchmarks/hidden_worlds"); sys.path.insert(0, "/work/out/posterior")
import numpy as np
from offline import document
SEED = 94000
def main(out, label, ids):
    from tacdata.discrepancy.posterior.search import posterior_of
    from tacdata.discrepancy.posterior.policy import POLICY
    from tacdata.discrepancy.posterior import gains as G
    kept = out / label; kept.mkdir(exist_ok=True)
    while True:
        todo = [f for f in sorted((out / "prepared").glob("*.pkl")) if not (kept / f"{f.stem}.json").exists() and (not ids or f.stem in ids) and (out/"today"/f"{f.stem}.json").exists()]
        if not ids: todo = [f for f in todo if not (out / "v2" / f.name).exists() or f.stem[:4] in ("0218", "03d8", "0ef6", "1336", "0b31", "0290", "0c50")]
        if not todo and ids: break
        if not todo:
            import harness
            left = harness.main(out, SEED, 1)
            if not left and not left: break
            continue
        for f in todo:
            d = pickle.load(open(f, "rb")); given = d["given"]; setting = given.setting
            t = time.process_time()
            try:
                s = posterior_of(setting, given=given)
                sec = time.process_time() - t
                post = s.posterior
                best = post.best
                rec = {"models": [replace(m, gram=m.gram.astype(np.float32), response=None) for m in post.models],
                       "effects": [c.effect for c in given.candidates], "fitted": setting.response.fitted, "odd": given.null.odd, "rows": given.grams.rows,
                       "contradictions": bool(d["checks"].contradictions), "few": d["checks"].too_few}
                try:
                    rec["gains"] = G.channel_gains(best, setting, np.arange(len(best.gram)), POLICY); rec["halves"] = G.gains_of_halves(best, setting, POLICY)
                except Exception as e: rec["gains_error"] = repr(e)
                rec["setting"] = {"channel": setting.channel_gain and setting.channel_gain.name, "nuisance": setting.nuisance, "force": setting.course.force is not None}
                rec["seconds"] = sec
                from tacdata.discrepancy.alarms.all_alarms import alarms
                ta = time.process_time(); rec["alarms"] = [a.seen for a in alarms(given, 0.0)]; rec["alarm_s"] = time.process_time() - ta
                rec["weights"] = post.weights; rec["empty"] = [post.empty, post.nothing]; pickle.dump(rec, open(kept / f"{f.stem}.pkl", "wb"), protocol=5)
                doc = document(rec, post, POLICY); doc["seconds"] = sec
            except Exception:
                doc = {"error": traceback.format_exc(), "seconds": None}
            (kept / f"{f.stem}.json").write_text(json.dumps(doc, default=float))
            t = json.loads((out / "today" / f"{f.stem}.json").read_text())
            print(f.stem, t["block"], t["name"], t["response"], "| today", round(t["seconds"] or 0, 1), t["verdict"] and (t["verdict"]["status"], [(e["mechanism"], e["status"], e.get("level")) for e in t["verdict"]["effects"]]),
                  "| now", doc.get("seconds") and round(doc["seconds"], 1), doc.get("status"), [(e["mechanism"], e["status"], e["level"]) for e in doc.get("effects", [])], {k: round(v, 2) for k, v in list(doc.get("mechanisms", {}).items())[:4]}, "nothing", doc.get("nothing"), doc.get("error", "")[-400:], flush=True)
            del d, given, setting; gc.collect()
if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2], sys.argv[3:])
