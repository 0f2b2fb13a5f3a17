"""Publishes one stream to any number of subscribers, each with a bounded queue of its own."""

from __future__ import annotations

from collections import deque

from server.service.streaming.subscriber_queue import Chunk, Subscriber


class Broadcaster:
    """Sends every chunk to every subscriber; a new one begins with the newest ``backlog_gops`` GOPs.

    After ``queue_gops`` filler GOPs in a row the backlog is dropped: a new subscriber waits for the next
    random access point. ``queue_gops`` is also what may wait for one subscriber.
    """

    def __init__(self, *, backlog_gops: int = 1, queue_gops: int = 8) -> None:
        self._backlog_gops = backlog_gops
        self._queue_gops = queue_gops
        self._backlog: deque[Chunk] = deque()
        self._subscribers: set[Subscriber] = set()
        self._closed = False

    @property
    def viewers(self) -> int:
        """The number of subscribers."""
        return len(self._subscribers)

    def publish(self, chunk: Chunk) -> None:
        """Send a chunk to all subscribers, and add it to the backlog for new ones."""
        self._backlog.append(chunk)
        gops = sum(waiting.random_access for waiting in self._backlog)
        while gops > self._backlog_gops or (self._backlog and not self._backlog[0].random_access):
            gops -= self._backlog.popleft().random_access
        if chunk.is_filler and sum(waiting.is_filler for waiting in self._backlog) > self._queue_gops:
            self._backlog.clear()
        self.publish_once(chunk)

    def publish_once(self, chunk: Chunk) -> None:
        """Send a chunk to the present subscribers only."""
        for subscriber in self._subscribers:
            subscriber.put(chunk)

    def subscribe(self) -> Subscriber:
        """Return a new subscriber; call :meth:`unsubscribe` in the end."""
        subscriber = Subscriber(list(self._backlog), self._queue_gops)
        self._subscribers.add(subscriber)
        if self._closed:
            subscriber.close()
        return subscriber

    def subscribers_with_new_loss(self) -> list[Subscriber]:
        """Return the subscribers that have lost GOPs since the last call."""
        return [subscriber for subscriber in self._subscribers if subscriber.has_new_loss()]

    def unsubscribe(self, subscriber: Subscriber) -> None:
        """Remove a subscriber."""
        self._subscribers.discard(subscriber)

    def close(self) -> None:
        """End the stream for all subscribers."""
        self._closed = True
        for subscriber in self._subscribers:
            subscriber.close()
