import sys, pickle, time, cProfile, pstats
from tacdata.discrepancy.posterior import search as S
d = pickle.load(open(sys.argv[1], "rb")); given = d["given"]
p = cProfile.Profile(time.process_time); p.enable(); s = S.posterior_of(given.setting, given=given); p.disable()
print(len(s.posterior.models)); st = pstats.Stats(p); st.sort_stats("cumulative").print_stats("tacdata", 32); st.sort_stats("tottime").print_stats(14)
