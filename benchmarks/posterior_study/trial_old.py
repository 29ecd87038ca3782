"""TEMPORARY: paired trials."""
import numpy as np
from tacdata.discrepancy.judge import _setting
from tacdata.discrepancy.posterior.search import posterior_of
from tacdata.discrepancy.posterior.bag import bagged
from tacdata.discrepancy.posterior.priors import SetPrior
from tacdata.discrepancy.posterior import gains as G
from tacdata.discrepancy.report.conclusion import conclude
from tacdata.discrepancy.verdict.sealed import chosen, without_readings
from tacdata.discrepancy.data.checks import check
from tacdata.discrepancy.alarms.all_alarms import alarms
import time
def _doc(post, policy, checks, seen):
    c = conclude(post, policy)
    status = c.status.value
    if status == "none" and seen: status = "unknown"
    if checks.contradictions or checks.too_few: status = "unknown"
    effects = []
    for e in c.effects:
        st = "named" if e.level is not None and status in ("named", "named, incomplete") else "ambiguous" if status in ("ambiguous",) else "suspected"
        lv = e.level.value if e.level is not None else None
        if status in ("none","unknown"): st, lv = "suspected", None
        pars = {p.name: {"value": np.asarray(e.placed.values[p.name]).tolist(), "unit": p.unit} for p in e.placed.effect.parameters}
        effects.append({"mechanism": e.placed.effect.called, "effect": e.placed.effect.name, "status": st if not (status=="ambiguous" and lv in ("mechanism","form")) else "named", "level": lv, "family": e.placed.effect.family.value, "alternatives": list(e.alternatives), "parameters": pars, "confidence": e.probability, "pfamily": e.family, "pform": e.form})
    if status == "none": effects = []
    return {"status": status, "effects": effects, "remainder": post.remainder, "nothing": post.nothing, "empty": post.empty,
            "mechanisms": dict(list(post.mechanisms.items())[:8]), "families": dict(list(post.families.items())[:6])}
def run(course, spec, variants):
    t0 = time.process_time()
    sealed = chosen(course)
    setting = _setting(without_readings(course, sealed), spec, (), True)
    checks = check(setting)
    s = posterior_of(setting)
    t1 = time.process_time()
    seen = alarms(s.given, 0.0) if not s.posterior.best.placed or s.posterior.nothing >= 0.5 else ()
    out = {"search_s": t1 - t0}
    for name, policy in variants.items():
        prior = SetPrior.of((c.effect for c in s.given.candidates), policy)
        post = s.posterior if name == "base" else bagged(s.posterior.models, prior, policy)
        out[name] = _doc(post, policy, checks, seen)
    order = np.argsort(-s.posterior.logs)
    out["sets"] = [[list(s.posterior.models[k].name), float(s.posterior.logs[k] - s.posterior.logs.max()), float(s.posterior.sets[k])] for k in order[:14]]
    out["alarms"] = [a.seen for a in seen]
    out["gains"] = G.channel_gains(s.posterior.best, setting, np.arange(len(s.posterior.best.gram)), variants["base"]).tolist()
    out["halves"] = G.gains_of_halves(s.posterior.best, setting, variants["base"]).tolist()
    return out
