"""Which low-pass on measured rates a flight needs where nothing is said of it."""

SHORT = 8  # links, the most that fly without a low-pass on rates
CUTOFF = 10.0  # Hz; costs presets 15 to 27 ms of their delay margins (assumed)


def rate_filter(given: float | None, rate: float, links: int, *, bends: bool = False) -> float:
    """Returns the low-pass [Hz] on measured rates: the given one, or what long bodies need.

    Where links bend the root's own wobble passes for the CoG's velocity, and a gyro's noise does so
    with an arm of metres; rigid bodies of up to 8 links fly without, as in ZN23.

    Args:
        given: Hz, 0 for none; None where nothing is said.
        rate: Hz, of the attitude loop.
        links: of the chain.
        bends: whether they are elastic.
    """
    if given is not None:
        return given
    return min(CUTOFF, 0.25 * rate) if bends or links > SHORT else 0.0
