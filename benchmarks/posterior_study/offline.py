"""Verdict documents from a posterior, as the scorer reads them."""
import sys, json, pickle
from types import SimpleNamespace
from pathlib import Path
import numpy as np
def document(rec, post, policy, coarse=None):
    from tacdata.discrepancy.report.conclusion import conclude
    c = conclude(post, policy, coarse)
    status = c.status.value
    if status == "none" and (rec.get("alarms") or len(rec["odd"])): status = "unknown"
    if rec["contradictions"] or rec["few"]: status = "unknown"
    effects = []
    for e in c.effects:
        lv = e.level.value if e.level is not None else None
        if status in ("none", "unknown"): st, lv = "suspected", None
        elif lv: st = "named"
        else: st = "ambiguous" if status == "ambiguous" else "suspected"
        pars = {p.name: {"value": np.asarray(e.placed.values[p.name]).tolist(), "unit": p.unit} for p in e.placed.effect.parameters}
        effects.append({"mechanism": e.placed.effect.called, "effect": e.placed.effect.name, "status": st, "level": lv, "family": e.placed.effect.family.value, "alternatives": list(e.alternatives), "parameters": pars, "confidence": e.probability, "pfamily": e.family, "pform": e.form})
    if status == "none": effects = []
    if "gains" in rec and not rec["fitted"]:
        from tacdata.discrepancy.verdict.calibration import gains_beyond_calibration
        from tacdata.effects import load
        s = rec["setting"]
        setting = SimpleNamespace(channel_gain=load(s["channel"]) if s["channel"] else None, nuisance=s["nuisance"], course=SimpleNamespace(force=1 if s["force"] else None))
        found = SimpleNamespace(problem=SimpleNamespace(setting=setting), gains=np.asarray(rec["gains"]), halves=np.asarray(rec["halves"]))
        more = gains_beyond_calibration(found) if status != "unknown" or True else []
        for f in more:
            lv = "family" if f.rivals else "mechanism"
            effects.append({"mechanism": f.placed.effect.called, "effect": f.placed.effect.name, "status": "named" if not f.rivals else "ambiguous", "level": lv if not f.rivals else None, "family": f.placed.effect.family.value, "alternatives": list(f.rivals), "parameters": {}, "confidence": None})
            if status == "none": status = "named" if not f.rivals else "ambiguous"
    return {"status": status, "effects": effects, "remainder": post.remainder, "nothing": post.nothing, "empty": post.empty,
            "mechanisms": dict(list(post.mechanisms.items())[:8]), "families": dict(list(post.families.items())[:6])}
