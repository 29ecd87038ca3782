import sys, json, time, random, shutil, traceback
from pathlib import Path
sys.path.insert(0, "/work/wt/posterior/benchmarks/real_kinds"); sys.path.insert(0, "/work/out/posterior")
import run as R
from written import write
import numpy as np, offline
from tacdata.discrepancy.data.recordings import course_of
from tacdata.discrepancy import judge as J
from tacdata.discrepancy.model.spec import read_spec
from tacdata.importing.imported_session import import_session
from tacdata.discrepancy.posterior.search import posterior_of
from tacdata.discrepancy.posterior.policy import POLICY
from tacdata.discrepancy.alarms.all_alarms import alarms
out = Path(sys.argv[1]); seed = int(sys.argv[2]); out.mkdir(exist_ok=True, parents=True)
tasks = list(R.sets(list(R.KINDS), R.SHARES, 1, seed)); random.Random(seed).shuffle(tasks)
for name, share, which, s in tasks:
    path = out / f"{name}-{share:g}-{which}-{s}.json".replace(" ", "_").replace(",", "")
    if path.exists(): continue
    folder = path.with_suffix(""); shutil.rmtree(folder, ignore_errors=True)
    try:
        write(folder / "files", name, share, which, s)
        truth = json.loads((folder / "files" / "truth.json").read_text()); (folder / "files" / "truth.json").unlink()
        row = {"kind": name, "share": share, "remainder": which, "seed": s, **truth, "error": ""}
        import_session(folder / "files", folder / "files" / "mapping.yaml", folder / "session")
        course = course_of([folder / "session"])
        t = time.process_time(); v = J.judge(course, read_spec(None)); sec = time.process_time() - t
        a = row | {"seconds": sec, "verdict": v.document}
        given = v.found.given; t = time.process_time(); sr = posterior_of(given.setting, given=given); sec2 = time.process_time() - t
        rec = {"fitted": given.setting.response.fitted, "odd": given.null.odd, "contradictions": bool(v.checks.contradictions), "few": v.checks.too_few, "alarms": [x.seen for x in alarms(given, 0.0)] if sr.posterior.nothing >= .5 or not sr.posterior.best.placed else []}
        doc = offline.document(rec, sr.posterior, POLICY, sr.coarse)
        doc["sets"] = [["+".join(sr.posterior.models[k].name), float(sr.posterior.sets[k]), float(sr.coarse.sets[k])] for k in np.argsort(-sr.posterior.sets)[:8]]
        b = row | {"seconds": sec2, "verdict": doc}
        path.write_text(json.dumps({"today": a, "new": b}, default=float))
        print(R.line(a)); print("    new:", R.line(b), f"rem {doc['remainder']:.2f}", {k: round(x, 2) for k, x in list(doc["mechanisms"].items())[:4]}, flush=True)
    except Exception: print(name, share, which, traceback.format_exc()[-500:], flush=True)
    shutil.rmtree(folder, ignore_errors=True)
