"""The outage protocol: which windows, and what each is worth."""

import numpy as np
import pytest

from outrider.errors import UsageError
from outrider.eval import outage_windows, score_outages

S = 1_000_000_000


def test_windows_start_after_the_first_minute_and_end_in_time():
    windows = outage_windows(5 * S, 305 * S, 60.0)
    assert windows[0].tolist() == [65 * S, 125 * S] and windows[-1].tolist() == [245 * S, 305 * S]
    assert np.all(np.diff(windows[:, 0]) == 10 * S) and len(windows) == 19
    assert outage_windows(0, 100 * S, 60.0).shape == (0, 2)
    with pytest.raises(UsageError, match="positive"):
        outage_windows(0, 1, 0.0)


def test_each_window_is_scored_on_its_own_records():
    windows = np.array([[0, 10], [5, 15], [20, 30]]) * S
    t = [np.arange(40) * S] * 3
    errors = [np.tile([3.0, 4.0], (40, 1)), np.column_stack([np.arange(40.0), np.zeros(40)]), np.full((40, 2), np.nan)]
    score = score_outages(windows, t, errors)
    assert score.count.tolist() == [10, 10] and score.windows.tolist() == windows[:2].tolist()
    np.testing.assert_allclose(score.rmse, [5.0, np.sqrt(np.mean(np.arange(5.0, 15.0) ** 2))])
    np.testing.assert_allclose(score.worst, [5.0, 14.0])
    np.testing.assert_allclose(score.last, [5.0, 14.0])
    assert score.median == pytest.approx(np.mean(score.rmse))
    assert score.as_dict()["windows"] == 2 and score.as_dict()["records"] == 20


def test_one_lost_window_does_not_decide():
    windows = outage_windows(0, 400 * S, 20.0)
    errors = [np.full((5, 2), 1e6 if k == 3 else 1.0) for k in range(len(windows))]
    score = score_outages(windows, [w[0] + np.arange(5) * S for w in windows], errors)
    assert score.median == pytest.approx(2**0.5)


def test_no_window_is_no_score():
    score = score_outages(np.zeros((0, 2), np.int64), [], [])
    assert np.isnan(score.median) and score.as_dict()["median_rmse_m"] is None
    with pytest.raises(UsageError, match="one of each"):
        score_outages(np.zeros((1, 2), np.int64), [], [])
