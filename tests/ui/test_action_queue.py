"""Actions of pages run one after another, in order, and none that fails stops the others."""

from __future__ import annotations

import threading

from burg_drake.core import InvalidInputError
from burg_drake.ui import ActionQueue
from tests.hang_guard import HANG_GUARD


def test_actions_run_in_order_and_errors_reach_who_asked() -> None:
    said: list[tuple[object, str]] = []
    done: list[int] = []
    queue = ActionQueue(lambda who, line: said.append((who, line)))

    def refuse() -> None:
        raise InvalidInputError("no")

    def stumble() -> None:
        raise ZeroDivisionError("oops")

    for i in range(50):
        queue.submit(lambda i=i: done.append(i))
        if i == 20:
            queue.submit(refuse, "a page")
            queue.submit(stumble, "another")
    assert queue.idle(HANG_GUARD)
    assert done == list(range(50))
    assert said[0] == ("a page", "no")
    assert said[1][0] == "another" and "oops" in said[1][1]
    queue.close()


def test_of_actions_with_a_key_only_the_newest_that_waits_is_done() -> None:
    done: list[int] = []
    gate = threading.Event()
    queue = ActionQueue(lambda who, line: None)
    queue.submit(gate.wait)
    for i in range(10):
        queue.submit(lambda i=i: done.append(i), key="drag")
    queue.submit(lambda: done.append(100))
    queue.submit(lambda: done.append(200), key="drag")
    gate.set()
    assert queue.idle(HANG_GUARD)
    assert done == [9, 100, 200]
    queue.close()


def test_what_is_typed_waits_for_more_but_holds_up_nobody() -> None:
    done: list[str] = []
    queue = ActionQueue(lambda who, line: None)
    queue.submit(lambda: done.append("2"), key="field", after=3600.0)
    queue.submit(lambda: done.append("25"), key="field", after=3600.0)
    assert not queue.idle(0.05)
    queue.submit(lambda: done.append("save"))
    assert queue.idle(HANG_GUARD)
    assert done == ["25", "save"]
    queue.submit(lambda: done.append("last"), key="field", after=3600.0)
    queue.close()
    assert done[-1] == "last"


def test_what_only_shows_runs_at_once_and_does_not_end_typing() -> None:
    done: list[str] = []
    queue = ActionQueue(lambda who, line: None)
    shown = threading.Event()
    queue.submit(lambda: done.append("2"), key="field", after=3600.0)
    queue.submit(lambda: done.append("shown"), key="refresh", wait_for_typing=True)
    queue.submit(shown.set, key="other", wait_for_typing=True)
    assert shown.wait(HANG_GUARD)
    queue.submit(lambda: done.append("25"), key="field", after=3600.0)
    assert not queue.idle(0.05)
    queue.submit(lambda: done.append("save"))
    assert queue.idle(HANG_GUARD)
    assert done == ["shown", "25", "save"]
    queue.close()
