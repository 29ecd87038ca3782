"""The map from what was found to how sure a name is."""

import numpy as np

from tacdata.discrepancy.verdict.confidence import fit


def test_a_map_ranks_names_and_claims_no_more_than_its_sample_can_tell():
    rng = np.random.default_rng(0)
    rows = [{"margin": float(m), "need": float(n)} for m, n in rng.random((80, 2))]
    right = [bool(rng.random() < 1 / (1 + np.exp(-8 * (row["margin"] - 0.4)))) for row in rows]
    made = fit(rows, right)
    assert made["weights"]["margin"] > 2 > abs(made["weights"]["need"])
    assert made["range"] == [1 / 82, 1 - 1 / 82]
    said = [1 / (1 + np.exp(-made["intercept"] - sum(w * r[k] for k, w in made["weights"].items()))) for r in rows]
    assert abs(np.mean(said) - np.mean(right)) < 0.02
