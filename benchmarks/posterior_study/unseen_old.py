"""unseen_old.py OUT SEED K/N: today's verdict of main's engine on frozen worlds; keeps the prepared problem."""
import sys, time, json, pickle, gc, os, traceback
from pathlib import Path
ROOT = os.environ["ROOT"]
sys.path.insert(0, ROOT + "/benchmarks/hidden_worlds")
import numpy as np
from worlds import written
from worlds.cases import cases
COUNT = {"nulls": 8, "singles10": 6, "singles3": 5, "pairs": 4, "outside10": 5, "aliases": 3, "remainder5": 2, "remainder15": 2, "remainder30": 2, "remainder50": 1, "near_pairs": 2}
def chosen(seed):
    every = []
    for b, n in COUNT.items():
        every += sorted(cases(b, seed, 0), key=lambda c: c.identity)[:n]
    return sorted(every, key=lambda c: c.identity)
def main(out, seed, shard):
    from judge import course_of, spec_of
    from tacdata.discrepancy import judge as J
    assert J.__file__.startswith(ROOT), J.__file__
    k, n = map(int, shard.split("/"))
    for case in chosen(seed)[k::n]:
        file = out / "today" / f"{case.identity}.json"; file.parent.mkdir(parents=True, exist_ok=True)
        if file.exists(): continue
        written.write(out, case)
        folder = out / "worlds" / case.identity
        if not (folder / "table.npz").exists(): (folder / "table.npz").symlink_to((folder.parent / "nominal.npz").resolve())
        course = course_of(dict(np.load(folder / "recordings.npz")))
        t = time.process_time(); spec = spec_of(folder); err = None
        try:
            v = J.judge(course, spec); doc = v.document; s = time.process_time() - t
            (out/"prepared").mkdir(exist_ok=True)
            part = out / "prepared" / f"{case.identity}.part"
            with open(part, "wb") as f: pickle.dump({"course": course, "given": v.found.given, "checks": v.checks}, f, protocol=5)
            part.rename(part.with_suffix(".pkl"))
        except Exception as e:
            doc, s, err = None, None, traceback.format_exc()
        file.write_text(json.dumps({"block": case.block, "name": case.name, "response": case.response, "seconds": s, "verdict": doc, "error": err, "expected": case.expected}))
        print(case.block, case.name, case.response, s, doc and (doc["status"], [(e["mechanism"], e["status"], e.get("level")) for e in doc["effects"]]), err and err[-300:], flush=True)
        gc.collect()
if __name__ == "__main__": main(Path(sys.argv[1]), int(sys.argv[2]), sys.argv[3])
