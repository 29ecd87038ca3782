"""Methods that a lab might use without the workflow, on the same recordings; each answers as the workflow does.

noop: the model as it is. affine: a gain and an offset a channel. nominal: every nominal parameter refitted. lasso: all
effects at once, the penalty by cross-validation. bic: effects one by one while Bayes' criterion, rows taken as
independent, falls by more than ten. ridge: a free regression of the residual on histories of the path, which names
no effect and bounds the part that can be closed.
"""

import time

import numpy as np

NOMINAL = ("gain", "modulus", "thickness", "z_offset", "xy_offset")
ENOUGH = 0.1
"""A coefficient of the LASSO counts as a name from so many typical sizes on [1]."""
DROP = 10.0
MOST = 4


def answered(setting, method):
    """Return a verdict's least fields, the model's prediction before and after correction, and CPU seconds."""
    from tacdata.chain import predict
    from tacdata.discrepancy.noise.null_model import null_model
    from tacdata.discrepancy.search.problem import prepare

    course, begin = setting.course, time.process_time()
    rows, before = course.read, predict(course, setting.response, [])
    after, pose, names = before.signal, before.pose, []
    if method == "ridge":
        after = before.signal.copy()
        after[rows] += _ridge(course, before.signal)
    elif method in ("lasso", "bic", "nominal"):
        problem = prepare(setting, null_model(setting))
        gram = problem.grams.of(np.arange(course.episodes))
        chosen = {"lasso": _lasso, "bic": _bic, "nominal": _nominal}[method](problem, gram)
        placed = [c.placed(values, course.channels) for c, values in chosen]
        now = predict(course, setting.response, placed)
        after, pose, names = now.signal, now.pose, [c.called for c, _ in chosen if method != "nominal"]
    elif method not in ("noop", "affine"):
        raise SystemExit(f"no baseline {method}")
    seconds = time.process_time() - begin
    members = [
        {"mechanism": n, "effect": n, "status": "named", "alternatives": [], "parameters": {}}
        for n in dict.fromkeys(names)
    ]
    status = "named" if members else "unknown" if method in ("affine", "nominal", "ridge") else "none"
    said = {
        "time": course.time[rows],
        "episode": course.episode[rows],
        "before": before.signal[rows].astype(np.float32),
        "after": after[rows].astype(np.float32),
        "pose": pose[rows].astype(np.float32),
        "nominal": before.pose[rows].astype(np.float32),
    }
    return {"status": status, "effects": members}, said, seconds


def _least(problem):
    """Return one candidate a mechanism: the shapes that do best alone."""
    from tacdata.discrepancy.search.fits import best_shapes

    return list(best_shapes(problem).values())


def _cut(gram, columns, low, high):
    from tacdata.discrepancy.statistics.gram_fit import solve

    return solve(gram, columns, np.zeros(len(columns)), low, high)


def _nominal(problem, gram):
    chosen = [c for c in _least(problem) if c.effect.name in NOMINAL]
    if not chosen:
        return []
    columns = np.concatenate([c.columns for c in chosen])
    values = _cut(gram, columns, np.concatenate([c.low for c in chosen]), np.concatenate([c.high for c in chosen]))
    return _shared(chosen, values)


def _shared(chosen, values):
    at = np.cumsum([0, *(len(c.columns) for c in chosen)])
    return [(c, values[a:b]) for c, a, b in zip(chosen, at[:-1], at[1:], strict=True)]


def _bic(problem, gram):
    chosen, best = [], 0.5 * gram[0, 0]
    rows = float(problem.grams.rows.sum())
    while len(chosen) < MOST:
        tried = []
        for c in _least(problem):
            if c.called in {o.called for o in chosen}:
                continue
            several = [*chosen, c]
            columns = np.concatenate([o.columns for o in several])
            low, high = (np.concatenate([getattr(o, k) for o in several]) for k in ("low", "high"))
            values = _cut(gram, columns, low, high)
            inner = gram[np.ix_(columns + 1, columns + 1)]
            energy = 0.5 * (gram[0, 0] - 2 * gram[0, columns + 1] @ values + values @ inner @ values)
            tried.append((2 * energy + len(c.columns) * np.log(rows), energy, c, values))
        if not tried:
            break
        cost, energy, c, values = min(tried, key=lambda item: item[0])
        if 2 * best - cost < DROP:
            break
        chosen, best, kept = [*chosen, c], energy, values
    return _shared(chosen, kept) if chosen else []


def _lasso(problem, gram):
    chosen = _least(problem)
    columns = np.concatenate([c.columns for c in chosen]) + 1
    scale = np.sqrt(np.maximum(np.diag(gram)[columns], 1e-12))
    every = problem.grams.gram
    half = np.arange(len(every)) % 5
    top = np.abs(gram[columns, 0] / scale).max()
    path = top * np.geomspace(1, 1e-3, 16)
    cost = np.zeros(len(path))
    for fold in range(5):
        inside = every[half != fold].sum(axis=0)
        outside = every[half == fold].sum(axis=0)
        values = np.zeros(len(columns))
        for k, penalty in enumerate(path):
            values = _descend(inside, columns, penalty * scale, values)
            cost[k] += (
                outside[0, 0] - 2 * outside[0, columns] @ values + values @ outside[np.ix_(columns, columns)] @ values
            )
    values = np.zeros(len(columns))
    for penalty in path[: int(np.argmin(cost)) + 1]:
        values = _descend(gram, columns, penalty * scale, values)
    return [(c, v) for c, v in _shared(chosen, values) if np.abs(v).max() > ENOUGH]


def _descend(gram, columns, penalty, values, rounds=60):
    """Return LASSO coefficients by coordinate descent on a Gram matrix."""
    inner, target = gram[np.ix_(columns, columns)], gram[columns, 0]
    values, own = values.copy(), np.maximum(np.diag(inner), 1e-12)
    slope = target - inner @ values
    for _ in range(rounds):
        most = 0.0
        for k in range(len(values)):
            raw = slope[k] + own[k] * values[k]
            new = np.sign(raw) * max(abs(raw) - penalty[k], 0.0) / own[k]
            if new != values[k]:
                slope -= inner[:, k] * (new - values[k])
                most = max(most, abs(new - values[k]) * np.sqrt(own[k]))
                values[k] = new
        if most < 1e-3 * np.sqrt(max(gram[0, 0], 1e-12)):
            break
    return values


def _ridge(course, signal):
    """Return the fit of a regression of every channel's residual on its own history and the path, rows read."""
    rows = course.read
    idle = np.median(signal[course.tip[:, 2] <= 0], axis=0)
    rise, clock = signal - idle, (course.time / course.time[-1])[:, None]
    lags = [_late(rise, course.step, tau) for tau in (0.03, 0.1, 0.4, 1.5, 6.0, 25.0)]
    deep = np.maximum(course.tip[:, 2:], 0.0)
    left, right = np.roll(rise, 1, axis=1), np.roll(rise, -1, axis=1)
    speed = course.speed[:, None] * (deep > 0)
    flat = 0 * rise
    kinds = [
        rise,
        *lags,
        rise * rise / 1e3,
        rise * clock,
        left,
        right,
        rise * deep,
        rise * np.sign(speed),
        rise * speed,
    ]
    kinds += [rise * course.tip[:, [0]], rise * course.tip[:, [1]], clock + flat, clock**2 + flat, 1 + flat]
    made = np.empty((len(rows), course.channels))
    fold = course.episode[rows] % 5
    for c in range(course.channels):
        x = np.stack([k[rows, c] for k in kinds], axis=1)
        x = x / np.maximum(np.sqrt((x * x).mean(axis=0)), 1e-9)
        y = course.readings[rows, c] - signal[rows, c]
        best, chosen = np.inf, 1.0
        for weight in (1e-3, 1e-2, 1e-1, 1.0):
            error = sum(
                float(np.sum((y[fold == f] - x[fold == f] @ _solved(x[fold != f], y[fold != f], weight)) ** 2))
                for f in range(5)
            )
            best, chosen = min((best, chosen), (error, weight))
        made[:, c] = x @ _solved(x, y, chosen)
    return made


def _solved(x, y, weight):
    return np.linalg.solve(x.T @ x + weight * len(x) * np.eye(x.shape[1]), x.T @ y)


def _late(values, step, tau):
    """Return first-order followers, stepped."""
    out, last = np.empty_like(values), np.zeros(values.shape[1])
    share = -np.expm1(-step / tau)
    for i, now in enumerate(values):
        last = last + share[i] * (now - last)
        out[i] = last
    return out
