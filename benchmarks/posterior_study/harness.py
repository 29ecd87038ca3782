"""harness.py today OUT SEED | pickles today's verdict and the prepared problem of each world."""
import sys, time, json, pickle, gc
from pathlib import Path
sys.path.insert(0, "/work/wt/posterior/benchmarks/hidden_worlds")
import numpy as np
from worlds import written
from worlds.cases import cases
COUNT = {"nulls": 10, "singles10": 8, "singles3": 6, "pairs": 6, "outside10": 6, "aliases": 4}
def chosen(seed):
    every = []
    for b, n in COUNT.items():
        own = sorted(cases(b, seed, 0), key=lambda c: c.identity)[:n]
        every += own
    return sorted(every, key=lambda c: c.identity)
def main(out, seed, most=10**6):
    from judge import course_of, spec_of
    from tacdata.discrepancy import judge as J
    from tacdata.discrepancy.verdict.sealed import chosen as seal, without_readings
    sys.path.insert(0, "/work/out/posterior")
    import ablate
    kept = []
    from tacdata.discrepancy.verdict.decide import decide as real
    def spy(*a): kept[:] = [a]; return real(*a)
    J.decide = spy

    for case in chosen(seed):
        file = out / "today" / f"{case.identity}.json"
        file.parent.mkdir(parents=True, exist_ok=True)
        if file.exists(): continue
        if most <= 0: return True
        most -= 1
        written.write(out, case)
        folder = out / "worlds" / case.identity
        if not (folder / "table.npz").exists(): (folder / "table.npz").symlink_to((folder.parent / "nominal.npz").resolve())
        course = course_of(dict(np.load(folder / "recordings.npz")))
        t = time.process_time(); spec = spec_of(folder)
        try:
            v = J.judge(course, spec); doc = v.document; s = time.process_time() - t
            given = v.found.given
            (out/"prepared").mkdir(exist_ok=True)
            with open(out / "prepared" / f"{case.identity}.pkl", "wb") as f: pickle.dump({"course": course, "given": given, "checks": v.checks, "placed": v.found.final.placed, "shown": None}, f, protocol=5)
            err = None
            from tacdata.discrepancy.verdict import document as _d
            base, abl = ablate.ablations(kept[0]); (out/"ablations").mkdir(exist_ok=True); (out/"ablations"/file.name).write_text(json.dumps([base, abl])); kept.clear()
        except Exception as e:
            import traceback; doc, s, err = None, None, traceback.format_exc()
        file.write_text(json.dumps({"block": case.block, "name": case.name, "response": case.response, "seconds": s, "verdict": doc, "error": err, "expected": case.expected}))
        print(case.block, case.name, case.response, s, doc and (doc["status"], [(e["mechanism"], e["status"], e.get("level")) for e in doc["effects"]]), err and err[-300:], flush=True)
        gc.collect()
    return False
if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]))
