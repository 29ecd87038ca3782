"""What generalized least squares leaves, against the same written out with whole covariance matrices."""

from itertools import pairwise

import numpy as np
import pytest

from tacdata.discrepancy.noise.episode_gls import EpisodeErrorModel, FactoredErrors

STREAMS, LENGTHS, KINDS, FEATURES, WIDTH = 3, (7, 5, 9), 2, 4, 5


def made(rng):
    count = sum(LENGTHS)
    return {
        "columns": rng.normal(size=(STREAMS, count, WIDTH)),
        "offset": np.ones((STREAMS, count)),
        "gain_error": 3 * rng.normal(size=(STREAMS, count)),
        "pose_errors": 2 * rng.normal(size=(STREAMS, count, KINDS)),
        "features": rng.normal(size=(STREAMS, count, FEATURES)),
        "random_walk": 0.8 * rng.normal(size=(STREAMS, count, 2)),
    }


def within(lengths):
    """Return each episode's rows."""
    return [slice(a, b) for a, b in pairwise(np.cumsum((0, *lengths)).tolist())]


def taken_out(factored, columns):
    """Return columns as generalized least squares sees them."""
    left = columns.astype(np.float32)
    factored.take_out(left)
    return left


def dense(columns, spans, prior, offset, gain_error, moved, features, random_walk):
    """Return the products of columns under the covariance written out, free directions taken out."""
    streams, count, width = columns.shape
    cov, free = np.eye(streams * count), []
    for rows in spans:
        pose = np.zeros((streams, count, moved.shape[2]))
        pose[:, rows] = moved[:, rows]
        cov += pose.reshape(-1, moved.shape[2]) @ pose.reshape(-1, moved.shape[2]).T
        constant = 1e9 if np.isinf(prior) else prior**2
        power = np.zeros(streams)
        for s in range(streams):
            one, gain, modes = offset[s, rows], gain_error[s, rows], random_walk[s, rows]
            shaking = np.eye(len(one)) + constant * np.outer(one, one) + modes @ modes.T
            power[s] = gain @ np.linalg.solve(shaking, gain)
            for mode in modes.T:
                whole = np.zeros((streams, count))
                whole[s, rows] = mode
                cov += np.outer(whole, whole)
            own = np.zeros((streams, count))
            own[s, rows] = one
            if np.isinf(prior):
                free.append(own.ravel())
            else:
                cov += prior**2 * np.outer(own, own)
        # Gains whose mean, weighted by what the streams tell of it, is 0.
        centred = np.eye(streams) - np.outer(np.ones(streams), power / power.sum())
        gains = np.zeros((streams, count, streams))
        gains[:, rows] = gain_error[:, rows, None] * centred[:, None, :]
        cov += gains.reshape(-1, streams) @ gains.reshape(-1, streams).T
    for s in range(streams):
        for p in range(features.shape[2]):
            one = np.zeros((streams, count))
            one[s] = features[s, :, p]
            free.append(one.ravel())
    inverse = np.linalg.inv(cov)
    flat = columns.reshape(-1, width)
    if free:
        design = np.array(free).T
        pulled = design.T @ inverse
        inverse = inverse - pulled.T @ np.linalg.solve(design.T @ inverse @ design, pulled)
    return flat.T @ inverse @ flat


@pytest.mark.parametrize("prior", [0.7, np.inf])
@pytest.mark.parametrize("features", [0, FEATURES])
@pytest.mark.parametrize("modes", [0, 2])
def test_products_are_those_of_generalized_least_squares(prior, features, modes):
    given = made(np.random.default_rng(3))
    given["features"], given["random_walk"] = given["features"][:, :, :features], given["random_walk"][:, :, :modes]
    spans = within(LENGTHS)
    parts = (given[name] for name in ("offset", "gain_error", "pose_errors", "features", "random_walk"))
    expected = dense(given["columns"], spans, prior, *parts)
    own = EpisodeErrorModel(
        given["offset"].astype(np.float32),
        np.full(len(spans), prior),
        given["gain_error"].astype(np.float32),
        given["pose_errors"].astype(np.float32),
        given["features"].astype(np.float32) if features else None,
        given["random_walk"].astype(np.float32) if modes else None,
    )
    left = taken_out(FactoredErrors(spans, own), given["columns"]).reshape(-1, WIDTH)
    assert left.T @ left == pytest.approx(expected, rel=2e-4, abs=2e-4 * np.abs(expected).max())


def test_freedom_is_what_features_take_of_noise():
    rng = np.random.default_rng(4)
    given, spans, count = made(rng), within(LENGTHS), sum(LENGTHS)
    twice = np.concatenate([given["features"], given["features"][:, :, :1]], axis=2).astype(np.float32)
    offset, free = given["offset"].astype(np.float32), np.full(len(spans), np.inf)
    white = rng.normal(size=(STREAMS, count, 4000)).astype(np.float32)
    without = FactoredErrors(spans, EpisodeErrorModel(offset, free))
    beside = FactoredErrors(spans, EpisodeErrorModel(offset, free, features=twice))
    taken = np.subtract(*(np.square(taken_out(factored, white)).sum(axis=(0, 1)) for factored in (without, beside)))
    assert without.freedom == 0.0
    # What is there twice takes no more than once.
    assert beside.freedom == pytest.approx(STREAMS * FEATURES, abs=0.01)
    assert taken.mean() == pytest.approx(beside.freedom, abs=0.3)


def test_freedom_is_the_rank_of_splines_that_are_nearly_alike():
    """Splines of few rows, in single precision: those too near to be told apart count once, not 1.6 times."""
    rng = np.random.default_rng(3)
    rows, width = 400, 12
    features = rng.normal(size=(1, rows, width))
    for k in range(4):
        features[0, :, k] = features[0, :, 11 - k] + 2e-5 * rng.normal(size=rows)
    features = np.repeat(features, 24, axis=0).astype(np.float32)
    spans = within([rows // 8] * 8)
    own = EpisodeErrorModel(np.ones((24, rows), dtype=np.float32), np.full(8, np.inf), features=features)
    freedom = FactoredErrors(spans, own).freedom
    assert 24 * (width - 4) <= freedom <= 24 * (width - 4) + 2


@pytest.mark.parametrize("free", [False, True])
def test_columns_in_one_stream_of_an_episode_are_told_like_any_others(free):
    """Scores and information of all of them at once, against products with each made by itself."""
    rng = np.random.default_rng(0)
    parts = made(rng)
    spans = within(LENGTHS)
    own = EpisodeErrorModel(
        parts["offset"],
        np.array([np.inf, 0.5, np.inf]),
        pose_errors=parts["pose_errors"],
        features=parts["features"] if free else None,
    )
    factored, alone = FactoredErrors(spans, own), parts["gain_error"]
    left = taken_out(factored, parts["columns"])[:, :, 0]
    score, information = factored.stream_scores(left, alone)
    (joint,) = factored.joint_scores(left, parts["columns"][:, :, :2])
    every = np.zeros((STREAMS, sum(LENGTHS), 2 * len(spans)))
    for e, rows in enumerate(spans):
        every[:, rows, 2 * e : 2 * e + 2] = parts["columns"][:, rows, :2]
    white = taken_out(factored, every)
    assert joint.score.ravel() == pytest.approx(np.einsum("snk,sn->k", white, left), rel=1e-4, abs=1e-6)
    assert joint.information == pytest.approx(np.einsum("snk,snl->kl", white, white), rel=1e-4, abs=1e-3)
    for e, rows in enumerate(spans):
        for s in range(STREAMS):
            column = np.zeros((*alone.shape, 1))
            column[s, rows, 0] = alone[s, rows]
            white = taken_out(factored, column)[:, :, 0]
            assert score[e, s] == pytest.approx(np.sum(white * left), rel=1e-4, abs=1e-6)
            assert information[e, s] == pytest.approx(np.sum(white * white), rel=1e-4)


def test_what_features_leave_of_noise_that_is_white_to_it():
    """White noise projected is noise of the whole covariance, drawn and cleaned: the same mean products."""
    rng = np.random.default_rng(6)
    parts = made(rng)
    spans = within(LENGTHS)
    named = {name: parts[name] for name in ("pose_errors", "features", "random_walk")}
    own = EpisodeErrorModel(parts["offset"], np.full(3, 0.7), **named)
    factored, count, draws = FactoredErrors(spans, own), sum(LENGTHS), 20000
    white = rng.normal(size=(STREAMS, count, draws)).astype(np.float32)
    projected_draws = white.copy()
    for rows in spans:
        projected_draws[:, rows] += 0.7 * parts["offset"][:, rows, None] * rng.normal(size=(STREAMS, 1, draws))
        projected_draws[:, rows] += parts["random_walk"][:, rows] @ rng.normal(size=(STREAMS, 2, draws))
        projected_draws[:, rows] += parts["pose_errors"][:, rows] @ rng.normal(size=(KINDS, draws))
    cleaned = taken_out(factored, projected_draws).reshape(-1, draws)
    factored.project(white)
    projected = white.reshape(-1, draws)
    products = projected @ projected.T / draws
    assert cleaned @ cleaned.T / draws == pytest.approx(products, abs=0.06)
    assert np.trace(products) == pytest.approx(STREAMS * (count - FEATURES), rel=0.01)


def test_features_that_are_alike_in_all_streams_are_given_once():
    rng = np.random.default_rng(8)
    parts, spans = made(rng), within(LENGTHS)
    named = {name: parts[name].astype(np.float32) for name in ("gain_error", "pose_errors")}
    shared, offset = parts["features"][:1].astype(np.float32), parts["offset"].astype(np.float32)
    once, each = (
        FactoredErrors(spans, EpisodeErrorModel(offset, np.full(3, np.inf), features=features, **named))
        for features in (shared, np.repeat(shared, STREAMS, axis=0))
    )
    assert once.freedom == pytest.approx(each.freedom, rel=1e-9)
    left = taken_out(each, parts["columns"])
    assert np.abs(left - parts["columns"]).max() > 0.1
    assert taken_out(once, parts["columns"]) == pytest.approx(left, abs=1e-5)
    (first,), (second,) = (factored.joint_scores(left[:, :, 0], parts["columns"]) for factored in (once, each))
    assert first.information == pytest.approx(second.information, rel=1e-4, abs=1e-4)
