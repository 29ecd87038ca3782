"""Findings that only a whole session shows: channel order, gain steps, offset steps."""

from __future__ import annotations

import numpy as np
from scipy.stats import theilslopes

from tacdata.recording.check.alignment import FELT, loading, reading_lag
from tacdata.recording.check.channel_order import (
    STEP_PRESSES,
    Answers,
    answers,
    counts_as_press,
    gain_steps,
    misplaced,
    orders,
    silent,
    unanswered,
    unknown_gains,
)
from tacdata.recording.check.clocks import DRIFT_PPM
from tacdata.recording.check.figures import RecordingFigures
from tacdata.recording.check.findings import DEPTH_MM, UNUSABLE, WARNING, Finding, hold_judgements
from tacdata.recording.check.first_contact import LIMITS, drift_words, first_contact, height_words
from tacdata.recording.check.imported import is_imported
from tacdata.recording.check.possible import ANSWER, CONTACT, answer
from tacdata.recording.check.session_steps import TELLING, height_step, slip, strength_step

TURNED = ("turned by 180 deg", "mirrored along x", "mirrored along y")
"""Texts for the usual wrong orders of a plug (`channel_order.orders`)."""
OFFSET = 20.0
"""Warning threshold: change of an idle reading between two recordings [times the noise]."""
OFFSET_SHARE = 0.3
"""... and its minimum share of the channel's strongest answer [1], so that slow relaxation is not reported."""


LAG_MS = 40.0
"""Delay of one recording's readings against the others' that is reported [ms of real time]."""
LAG_SHARE = 0.06
"""... and as a share of the difference in how long the way in takes [1]: the skin's own hysteresis."""
LAG_DEPTH = 0.2
"""Error of the depth by that delay that makes a recording unusable [mm]."""
FEWEST = 4
"""Recordings needed for comparing their delays or noise [count]."""
PLAIN = 4.0
"""Smallest ratio of the other presses' answers to the threshold of an answer [1]."""
NOT_FELT = "the tip did not reach the skin, or the board does not see it"
MIDDLE, LEANING = 0.8, 300
"""Share of a drift that the middle of the latencies must show, too [1], and how many of them are looked at [count]."""
ONE_SIGMA = 0.683
"""Confidence level of that lean [1]."""
LOUDER = 3.0
"""Warning threshold: noise of a recording over that of the session's quiet ones [1]."""


def session_findings(entries: list[RecordingFigures]) -> list[Finding]:
    """Return findings on the channels, from their answers to the session's presses."""
    faults = [*_delays(entries), *_louder(entries), *_drifts(entries), *_not_felt(entries), *_heights(entries)]
    sample = answers(entries)
    if sample is None:
        return faults
    if unanswered(sample):
        text = "no channel answered to any press: no contact (check the registration), or the board is not the sensor's"
        return [*faults, Finding(UNUSABLE, "taxels", "", text)]
    swaps = misplaced(sample)
    texts = [(UNUSABLE, text) for text in _places(sample, swaps)]
    # A channel that answers at another taxel's place is not silent.
    if quiet := [channel for channel in silent(sample) if channel not in swaps]:
        texts.append((UNUSABLE, f"channel {', '.join(map(str, quiet))} did not answer to presses close by"))
    names = [f.recording.episode.path.name for f in entries if counts_as_press(f)]
    for channel, (press, factor) in gain_steps(sample).items():
        text = f"channel {channel} answers {factor:.2f} times as strongly from about {names[press]} on"
        texts.append((UNUSABLE, text))
    texts += [(WARNING, text) for text in _offsets(entries, sample)]
    if not swaps:
        texts += _steps(entries, sample, names)
    return [*faults, *(Finding(severity, "taxels", "", text) for severity, text in texts)]


def depth_findings(entries: list[RecordingFigures]) -> list[Finding]:
    """Return the findings on where presses went in depth, for readers that judge something else by them.

    Where the skin begins, whether that drifts or steps, and whether the guide stood where it was sent. Imported
    recordings are left out: their depth has a zero of its own.
    """
    entries = [entry for entry in entries if not is_imported(entry.recording.episode)]
    faults = _heights(entries)
    if step := _height_step(entries):
        faults.append(Finding(step[0], "taxels", "", step[1]))
    off = [(entry.document["cnc"]["hold_error"], j) for entry in entries for j in hold_judgements(entry)]
    if off:
        severity, stream, text = max(off)[1]
        faults.append(Finding(severity, stream, "", f"{text}, at most, in {len(off)} of {len(entries)} presses"))
    return faults


def session_not_assessed(entries: list[RecordingFigures]) -> list[str]:
    """Name the changes within the session that its presses cannot show, and why."""
    sample = answers(entries)
    presses = 0 if sample is None else len(sample.response)
    if sample is None or presses < STEP_PRESSES:
        return [f"whether gains, wiring or the tool changed: {presses} presses, at least {STEP_PRESSES} are needed"]
    if unanswered(sample):
        return []
    words = []
    if channels := unknown_gains(sample):
        words.append(f"whether the gain of channel {', '.join(map(str, channels))} steps: too few presses near it")
    unsure = {"strength of all answers": strength_step(entries, sample), "height of the tool": height_step(entries)}
    words += [
        f"whether the {what} steps: depths, sites and indenters explain it as well, or answers scatter too much"
        for (what, search), threshold in zip(unsure.items(), TELLING, strict=True)
        if search.step is None and search.smallest > threshold
    ]
    return words


def _delays(entries: list[RecordingFigures]) -> list[Finding]:
    """Find the recordings whose readings are late, or early, against the motion when the others' are not."""
    lags = [(entry, lag) for entry in entries if (lag := reading_lag(entry)) is not None]
    if len(lags) < FEWEST:
        return []
    usual, faults = float(np.median([lag for _, lag in lags])), []
    duration = float(np.median([loading(entry) for entry, _ in lags]))
    for entry, lag in lags:
        episode = entry.recording.episode
        limit = LAG_MS * float(episode.rig.get("clock", {}).get("rate", 1.0))
        if abs(lag - usual) > limit + LAG_SHARE * abs(loading(entry) - duration):
            depth = abs(lag - usual) * 1e-3 * episode.press.speed
            text = f"they come {lag - usual:+.0f} ms later against the motion than in other recordings"
            severity = UNUSABLE if depth > LAG_DEPTH else WARNING
            faults.append(Finding(severity, "taxels", episode.path.name, f"{text}: {depth:.2f} mm of depth"))
    return faults


def _drifts(entries: list[RecordingFigures]) -> list[Finding]:
    """Find the recordings in which the board's clock runs otherwise than in the session's others."""
    clocks = [(entry, entry.document["taxels"]["clock"]) for entry in entries]
    drifts = [(entry, clock) for entry, clock in clocks if clock and clock["steady"] and clock["drift"] is not None]
    if len(drifts) < FEWEST:
        return []
    usual, faults = float(np.median([clock["drift"] for _, clock in drifts])), []
    for entry, clock in drifts:
        deviation = clock["drift"] - usual
        if abs(deviation) <= max(DRIFT_PPM, 3 * clock["drift_uncertainty"]):
            continue
        # A stream far off its nominal rate is named in the recording itself.
        named = abs(clock["drift"]) - 2 * clock["drift_uncertainty"] > DRIFT_PPM
        low, high = deviation + _lean(entry)
        if (low > MIDDLE * DRIFT_PPM or high < -MIDDLE * DRIFT_PPM) and not named:
            text = f"its clock runs {deviation:+.0f} ppm otherwise than in the session's other recordings"
            faults.append(Finding(WARNING, "taxels", entry.recording.episode.path.name, text))
    return faults


def _lean(entry: RecordingFigures) -> np.ndarray:
    """Return by how much the middle of the latencies leans against the clock's line below them [ppm], shape (2,).

    In a recording of seconds a few early frames lead the line astray; they do not lead the middle. The two lie one
    standard deviation apart from it: a slow board has too few frames for a judgement.
    """
    stride = max(len(entry.lag) // LEANING, 1)
    time_ms = entry.recording.episode.taxels.sample_ns[::stride] / 1e6
    return 1e6 * np.array(theilslopes(entry.lag[::stride], time_ms - time_ms[0], ONE_SIGMA)[2:])


def _not_felt(entries: list[RecordingFigures]) -> list[Finding]:
    """Find the presses that no channel answers, where the session's others of their depth are felt."""
    responses = [
        (entry, press, felt)
        for entry in entries
        if (press := entry.recording.episode.press).depth >= CONTACT and (felt := answer(entry)) is not None
    ]
    usual = [felt for _, press, felt in responses if felt >= PLAIN * ANSWER]
    felt_from = min((press.depth for _, press, felt in responses if felt >= PLAIN * ANSWER), default=np.inf)
    # Where most presses are not felt, the sensor is the cause, and that has its own finding.
    if 2 * len(usual) < len(responses):
        return []
    return [
        Finding(UNUSABLE, "taxels", entry.recording.episode.path.name, f"no channel answers to this press: {NOT_FELT}")
        for entry, press, felt in responses
        if felt < ANSWER and press.depth >= felt_from and over_taxels(entry)
    ]


def _heights(entries: list[RecordingFigures]) -> list[Finding]:
    """Judge where the skin begins: at depth zero, and at the same depth in each press."""
    contacts = [
        (entry.recording.episode.number, contact)
        for entry in entries
        if entry.recording.episode.complete and (contact := first_contact(entry)) is not None
    ]
    faults = []
    if judged := height_words([contact for _, contact in contacts]):
        faults.append(Finding(UNUSABLE if abs(judged[0]) > LIMITS[1] else WARNING, "taxels", "", judged[1]))
    if words := drift_words(contacts):
        faults.append(Finding(WARNING, "taxels", "", words))
    return faults


def over_taxels(entry: RecordingFigures) -> bool:
    """Whether a press is over a taxel, so that it must be felt."""
    press, taxels = entry.recording.episode.press, entry.recording.episode.sensor.taxels
    distances = np.linalg.norm(taxels.centers - np.array([press.x, press.y]), axis=1)
    return bool(distances.min() < 0.75 * max(taxels.pitch_x, taxels.pitch_y))


def _steps(entries: list[RecordingFigures], sample: Answers, names: list[str]) -> list[tuple[str, str]]:
    """Describe a step of all answers: sideways, else in height, else in strength, as each changes the next."""
    if slipped := slip(sample):
        x, y = slipped.size
        words = "the tool or the skin slipped, or the registration changed"
        return [(UNUSABLE, f"answers lie x {x:+.1f}, y {y:+.1f} mm elsewhere from {names[slipped.row]} on: {words}")]
    if found := _height_step(entries):
        return [found]
    if step := strength_step(entries, sample).step:
        factor = float(np.exp(step.size[0]))
        words = "the board's gain or supply changed, or the skin did"
        return [(UNUSABLE, f"all channels answer {factor:.2f} times as strongly from {names[step.row]} on: {words}")]
    return []


def _height_step(entries: list[RecordingFigures]) -> tuple[str, str] | None:
    """Describe a step of the height at which the skin is felt."""
    step = height_step(entries).step
    if step is None:
        return None
    # For an answer linear in depth, a surface lower by h moves the depth at a share s by (1 - s) h.
    height = float(step.size[0]) / (1 - FELT)
    way = "deeper" if height > 0 else "higher"
    name = [entry.recording.episode.path.name for entry in entries if counts_as_press(entry)][step.row]
    words = f"the skin is felt about {abs(height):.2f} mm {way} from {name} on"
    severity = UNUSABLE if abs(height) > DEPTH_MM[1] else WARNING
    return severity, f"{words}: the tool or the skin slipped, or the registration changed"


def _louder(entries: list[RecordingFigures]) -> list[Finding]:
    """Find the recordings in which all channels are noisier than in the session's quiet ones."""
    noise = [[v for v in entry.document["taxels"]["idle_noise"] if v is not None] for entry in entries]
    levels = [(entry, float(np.median(values))) for entry, values in zip(entries, noise, strict=True) if values]
    if len(levels) < FEWEST:
        return []
    # The quiet quarter as the reference: if half of the recordings are loud, the median is loud, too.
    quiet = max(float(np.percentile([value for _, value in levels], 25)), 0.5)
    return [
        Finding(
            WARNING,
            "taxels",
            entry.recording.episode.path.name,
            f"its noise is {value / quiet:.0f} times that of the session's quiet recordings",
        )
        for entry, value in levels
        if value > LOUDER * quiet
    ]


def _places(sample: Answers, swaps: dict[int, int]) -> list[str]:
    """Describe the channels that are wired to other taxels than in the sensor file."""
    for words, order in zip(TURNED, orders(sample.taxels)[1:], strict=True):
        same = sum(int(order[k]) == j for k, j in swaps.items())
        if len(swaps) > 0.6 * len(order) and same > 0.9 * len(swaps):
            return [f"the channels answer as if the array were {words}: plug, order of channels or registration"]
    return [
        f"channel {channel} answers like taxel {taxel}: swapped wires, or a wrong yaw in the registration"
        for channel, taxel in swaps.items()
    ]


def _offsets(entries: list[RecordingFigures], sample: Answers) -> list[str]:
    """Describe the channels whose idle reading steps between two recordings while others' do not."""
    idle = np.array(
        [[np.nan if v is None else v for v in f.document["taxels"]["idle_reading"]] for f in entries], float
    )
    if len(idle) < 2:
        return []
    change = np.diff(idle, axis=0)
    rows = np.isfinite(change).any(axis=1)
    shared = np.zeros(len(change))
    # Warmth and supply move all channels together; that is no fault of one.
    shared[rows] = np.nanmedian(change[rows], axis=1)
    excess = np.nan_to_num(change - shared[:, None])
    limit = np.maximum(OFFSET * sample.noise, OFFSET_SHARE * np.abs(sample.response).max(axis=0))
    words = []
    for channel in np.flatnonzero((np.abs(excess) > limit).any(axis=0)).tolist():
        at = int(np.argmax(np.abs(excess[:, channel])))
        name = entries[at + 1].recording.episode.path.name
        words.append(f"the idle reading of channel {channel} steps by {excess[at, channel]:+.0f} counts before {name}")
    return words
