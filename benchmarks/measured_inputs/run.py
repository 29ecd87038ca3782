"""Count what an import makes of files as strangers keep them, by kind of fault.

    python run.py OUT [--inputs NAME ...] [--json FILE]

Each input is proposed, tried, imported by the proposal as it stands, and checked. Outcomes: right; refused in words;
asked (other figures, with words that say why); wrong (other figures, or a needed remark missing, in silence); crash.
"""

from __future__ import annotations

import argparse
import json
import re
import shutil
import traceback
import warnings
from collections import Counter
from pathlib import Path

import bags  # noqa: F401
import cells  # noqa: F401
import clocks  # noqa: F401
import columns  # noqa: F401
import numpy as np
import positions  # noqa: F401
import shapes  # noqa: F401
import values  # noqa: F401
import yaml
from truth import INPUTS, Input, Truth

OUTCOMES = ("right", "refused", "asked", "wrong", "crash")
KINDS = {
    1: "time goes back or is odd",
    2: "position",
    3: "values that mean none",
    4: "units",
    5: "headers and cells",
    6: "shapes and joins",
    7: "one bad stretch",
    8: "proposed roles",
    11: "nothing found",
}
"""Kinds of the issue that inputs can show; drives, errors and next steps (9, 10, 12) have tests."""
SHARE, SKEW = 0.06, 0.12
"""Largest error of depth and rate [1], and of c0 against the depth at the same time [mm]."""


def judged(source: Input, folder: Path) -> tuple[str, list[str], list[str]]:
    """Return the outcome, the deviations and all that was said."""
    from tacdata.errors import TacdataError

    shutil.rmtree(folder, ignore_errors=True)
    (folder / "files").mkdir(parents=True)
    source.make(folder / "files")
    said: list[str] = []
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            wrong = _imported(folder, source.truth, said)
        except TacdataError as error:
            said.append(str(error))
            return "refused", [str(error)], said
        except Exception:
            return "crash", [traceback.format_exc()[-1500:]], said
    wrong += [f"warning of a library: {each.message}" for each in caught if "mcap" not in str(each.filename)]
    words = "\n".join(said)
    if source.truth.needed and not re.search(source.truth.needed, words):
        return "wrong", [*wrong, f"nothing said of {source.truth.needed}"], said
    if not wrong:
        return "right", [], said
    pattern = "|".join(filter(None, (source.truth.told, source.truth.needed, "not good as it stands")))
    return ("asked" if re.search(pattern, words) else "wrong"), wrong, said


def _imported(folder: Path, truth: Truth, said: list[str]) -> list[str]:
    """Propose, import and check; return the deviations from the truth."""
    from tacdata.importing.imported_session import import_session
    from tacdata.importing.proposing.description import described
    from tacdata.importing.proposing.proposal import proposed_mapping
    from tacdata.importing.proposing.trial_run import tried
    from tacdata.recording import read_session
    from tacdata.recording.check.report import check
    from tacdata.recording.files.reader import read_episode

    kinds, text = described(folder / "files")
    proposal = proposed_mapping(folder / "files", kinds)
    (folder / "mapping.yaml").write_text(yaml.safe_dump(proposal.document))
    # Lines with the range of a column are no remarks.
    said += [line for line in text.splitlines() if not re.match(r"    .*: (-?\d|text|no value)", line)]
    said += [*proposal.questions, tried(folder / "files", proposal.mapping)]
    made = import_session(folder / "files", folder / "mapping.yaml", folder / "session")
    said += [*made.notes, *made.refused]
    report = check(made.folder)
    said.append(report.text)
    episodes = [read_episode(path) for path in read_session(made.folder).episodes]
    wrong = [f"{len(episodes)} recordings"] * bool(truth.recordings and len(episodes) != truth.recordings)
    for episode in episodes:
        steps = np.diff(episode.taxels.sample_ns) / 1e9
        rate = 1 / float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
        wrong += [f"{rate:.4g} Hz"] * (abs(rate / truth.rate - 1) > SHARE)
        wrong += [f"{episode.press.depth:.4g} mm"] * (abs(episode.press.depth / truth.depth - 1) > SHARE)
        depth = np.interp(episode.taxels.sample_ns, episode.tip_ns, episode.tip[:, 2])
        error = float(np.nanquantile(np.abs(np.abs(episode.taxels.counts[:, 0]) - 10 - depth), 0.98))
        wrong += [f"c0 is {error:.3g} off"] * (truth.aligned and not error < SKEW)
    return list(dict.fromkeys(wrong))


def main() -> None:
    """Judge all inputs, or those that are named, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--inputs", nargs="*", default=[])
    parser.add_argument("--json", type=Path)
    chosen = parser.parse_args()
    table: dict[int, Counter[str]] = {}
    record = {}
    for name, source in sorted(INPUTS.items(), key=lambda item: (item[1].truth.kind, item[0])):
        if chosen.inputs and name not in chosen.inputs:
            continue
        outcome, wrong, said = judged(source, chosen.out / name)
        table.setdefault(source.truth.kind, Counter())[outcome] += 1
        record[name] = {"kind": source.truth.kind, "outcome": outcome, "deviations": wrong}
        (chosen.out / name / "said.txt").write_text("\n".join([source.truth.words, "", *said]))
        print(
            f"{source.truth.kind:2d}  {outcome:8s} {name:24s} {' '.join('; '.join(wrong[:3]).split())[:150]}",
            flush=True,
        )
    print(f"\n| kind | {' | '.join(OUTCOMES)} |\n|---|{'---:|' * len(OUTCOMES)}")
    for kind, counts in sorted(table.items()):
        print(f"| {kind} {KINDS[kind]} | {' | '.join(str(counts[each]) for each in OUTCOMES)} |")
    total = sum(table.values(), Counter())
    print(f"| all | {' | '.join(str(total[each]) for each in OUTCOMES)} |")
    if chosen.json:
        chosen.json.write_text(json.dumps(record, indent=1) + "\n")


if __name__ == "__main__":
    main()
