"""Events as they are shown: what repeats itself without a pause is one line, with its count."""

from collections.abc import Iterable

from snakegen.simulation.recording.recording import Event

PAUSE = 1.0  # s, after which the same text is news again


def merged(events: Iterable[Event]) -> list[Event]:
    """Returns `events` in order of time; repeats at most a second apart become one.

    That one has the first's time, and says how often it came and until when.
    """
    found: list[tuple[Event, float, int]] = []  # the first of a kind, time of the last, how many
    latest: dict[tuple[str, str], int] = {}
    for event in sorted(events, key=lambda e: e.time):
        kind = event.level, event.text
        i = latest.get(kind)
        if i is not None and event.time - found[i][1] <= PAUSE:
            found[i] = found[i][0], event.time, found[i][2] + 1
        else:
            latest[kind] = len(found)
            found.append((event, event.time, 1))
    return [
        first
        if count == 1
        else first._replace(text=f"{first.text} ({count} times until {last:.2f} s)")
        for first, last, count in found
    ]
