"""The thread that works one step ahead."""

from __future__ import annotations

import threading
import time

import pytest

from track.prefetch import one_ahead


def helpers() -> int:
    return sum(thread.name.startswith("one-ahead") for thread in threading.enumerate())


def test_results_come_in_order_and_the_next_is_worked_out_meanwhile() -> None:
    begun: list[int] = []

    def work(item: int) -> int:
        begun.append(item)
        return item**2

    got = []
    for result in one_ahead(work, range(5)):
        got.append(result)
        deadline = time.monotonic() + 5.0
        while len(begun) < min(len(got) + 1, 5) and time.monotonic() < deadline:
            time.sleep(0.001)
        assert begun == list(range(min(len(got) + 1, 5)))  # the next one, and no more
    assert got == [0, 1, 4, 9, 16]
    assert list(one_ahead(work, [])) == []
    assert helpers() == 0


def test_an_error_is_raised_when_its_turn_has_come_and_ends_the_thread() -> None:
    results = one_ahead(lambda item: 1 // item, [2, 1, 0, 1])
    assert next(results) == 0
    assert next(results) == 1
    with pytest.raises(ZeroDivisionError):
        next(results)
    assert helpers() == 0


def test_the_thread_ends_when_the_caller_stops_early() -> None:
    results = one_ahead(lambda item: item, range(100))
    next(results)
    assert helpers() == 1
    results.close()
    assert helpers() == 0
