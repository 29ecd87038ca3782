import sys, time, json, cProfile, pstats
from pathlib import Path
sys.path.insert(0, "/work/wt/posterior/benchmarks/hidden_worlds")
import numpy as np
from judge import course_of, spec_of
from tacdata.discrepancy.judge import judge
folder = Path(sys.argv[1])
course = course_of(dict(np.load(folder / "recordings.npz"))); spec = spec_of(folder)
p = cProfile.Profile(time.process_time); p.enable(); v = judge(course, spec); p.disable()
print(v.document["status"], course.rows, course.reduced.rows, course.channels, course.episodes)
s = pstats.Stats(p); s.sort_stats("cumulative").print_stats("tacdata", 45); s.sort_stats("tottime").print_stats(25)
