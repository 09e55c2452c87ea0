"""What a full queue does is one sentence each."""

import threading

from gateway.queues import ByteQueue


def test_items_come_out_in_the_order_they_went_in() -> None:
    queue: ByteQueue[str] = ByteQueue(10)
    assert queue.put("a", 4)
    assert queue.put("b", 6)
    assert queue.take() == ["a", "b"]
    assert queue.take(0) == []


def test_a_full_queue_refuses_the_newest_item_and_counts_it() -> None:
    queue: ByteQueue[str] = ByteQueue(10)
    assert queue.put("a", 10)
    assert not queue.put("b", 1)
    assert queue.take() == ["a"]
    assert vars(queue.counters) == {
        "accepted": 1,
        "taken": 1,
        "refused": 1,
        "refused_bytes": 1,
        "high_water_bytes": 10,
    }


def test_items_without_size_fit_into_a_full_queue() -> None:
    queue: ByteQueue[str] = ByteQueue(10)
    queue.put("a", 10)
    assert queue.put("status", 0)
    assert queue.take() == ["a", "status"]


def test_taking_makes_room_again() -> None:
    queue: ByteQueue[str] = ByteQueue(10)
    for _ in range(3):
        assert queue.put("a", 10)
        queue.take()
    assert queue.counters.high_water_bytes == 10
    assert queue.counters.refused == 0


def test_a_closed_queue_gives_what_waits_and_then_its_end() -> None:
    queue: ByteQueue[str] = ByteQueue(10)
    queue.put("a", 1)
    queue.close()
    assert queue.take() == ["a"]
    assert queue.take() is None
    assert queue.take(0) is None


def test_closing_wakes_a_taker_that_waits() -> None:
    queue: ByteQueue[str] = ByteQueue(10)
    taken: list[list[str] | None] = []
    taker = threading.Thread(target=lambda: taken.append(queue.take()))
    taker.start()
    queue.close()
    taker.join(10)
    assert taken == [None]


def test_putting_wakes_a_taker_that_waits() -> None:
    queue: ByteQueue[str] = ByteQueue(10)
    taken: list[list[str] | None] = []
    taker = threading.Thread(target=lambda: taken.append(queue.take()))
    taker.start()
    queue.put("a", 1)
    taker.join(10)
    assert taken == [["a"]]


def test_what_goes_in_from_many_threads_comes_out_once_or_is_counted() -> None:
    queue: ByteQueue[int] = ByteQueue(500)
    taken: list[int] = []

    def give(first: int) -> None:
        for k in range(first, first + 2000):
            queue.put(k, 10)

    def take() -> None:
        while (items := queue.take()) is not None:
            taken.extend(items)

    taker = threading.Thread(target=take)
    givers = [threading.Thread(target=give, args=(first,)) for first in (0, 2000, 4000)]
    for thread in (taker, *givers):
        thread.start()
    for thread in givers:
        thread.join(10)
    queue.close()
    taker.join(10)
    counters = queue.counters
    assert len(set(taken)) == len(taken) == counters.taken == counters.accepted
    assert counters.accepted + counters.refused == 6000
    assert counters.refused_bytes == 10 * counters.refused
    assert counters.high_water_bytes <= 500
    for first in (0, 2000, 4000):
        own = [k for k in taken if first <= k < first + 2000]
        assert own == sorted(own)
