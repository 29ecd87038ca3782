import sys, pickle, time
import numpy as np
from tacdata.discrepancy.posterior import search as S
from tacdata.discrepancy.posterior.policy import POLICY
from dataclasses import replace
d = pickle.load(open(sys.argv[1], "rb")); given = d["given"]
pol = replace(POLICY, share=float(sys.argv[2]))
real = S._posterior
def spy(setting, null, *a):
    p = real(setting, null, *a); print("scale", np.round(null.noise.scale[:6], 4), "gain", null.spread, "sizes", np.round(null.sizes, 2), "presses", int((given.grams.rows > 0).sum()))
    for k in np.argsort(-p.logs)[:7]:
        m = p.models[k]; print("   ", "+".join(m.name), round(float(p.sets[k]), 3), round(float(p.logs[k] - p.logs.max()), 1), "loss", round(float(m.energy.sum() + m.freedom / 2), 1), [ {k: float(np.round(np.mean(v), 4)) for k, v in q.values.items()} for q in m.placed])
    return p
S._posterior = spy
t = time.process_time(); s = S.posterior_of(given.setting, given=given, policy=pol); print(time.process_time() - t)
