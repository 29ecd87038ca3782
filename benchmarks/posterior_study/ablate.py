"""Today's decision with each rule made neutral."""
from dataclasses import replace
import tacdata.discrepancy.verdict.decide as D
def _patched(names, args, **kw):
    old = {n: getattr(D, n) for n in names}
    for n, v in names.items(): setattr(D, n, v)
    try: return D.decide(*args)
    finally:
        for n, v in old.items(): setattr(D, n, v)
RULES = {
 "compliance_of_specimens": lambda *a: [], "stands": lambda *a: False, "fills": lambda *a: False, "beside_much": lambda *a: None,
 "beside_open": lambda f, a, l: [None for _ in a], "lends_form": lambda *a: False, "seems_early": lambda *a: False, "stands_in": lambda *a: False,
 "another_form": lambda *a: False, "elsewhere": lambda *a: [], "traded": lambda a, l: [False for _ in a], "refuted": lambda *a: False,
 "borne_out": lambda *a: True, "_hidden": lambda *a: [], "lookalikes": lambda *a: [], "lent": lambda *a: False, "calibration_error": lambda *a: False,
 "gains_beyond_calibration": lambda *a: [], "_untried_kin": lambda *a: set(), "_unphysical": lambda *a: False, "_within_bounds": lambda f: f, "_of_one_family": lambda f: True}
def brief(d): return [d.status, d.reason.name, [(e.finding.placed.effect.called, e.status, e.level and e.level.value, list(e.finding.rivals)) for e in d.effects]]
def ablations(args):
    base = brief(D.decide(*args)); out = {}
    for name, value in RULES.items():
        try: own = brief(_patched({name: value}, args))
        except Exception as e: own = ["error", repr(e), []]
        if own != base: out[name] = own
    for name, a in {"no alarms": (*args[:5], ()), "no lacking": (*args[:4], {}, args[5]), "no sealed": (*args[:3], None, *args[4:]), "no beside": (*args[:2], (), *args[3:])}.items():
        try: own = brief(D.decide(*a))
        except Exception as e: own = ["error", repr(e), []]
        if own != base: out[name] = own
    for const, v in {"LOUD": 1e9, "RARE_P": 0.0, "GAP_T": 0.0}.items():
        own = brief(_patched({const: v}, args))
        if own != base: out[const] = own
    return base, out
