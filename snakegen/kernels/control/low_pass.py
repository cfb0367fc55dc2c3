"""The low-pass that autopilots put on measured rates: Butterworth, second order.

Here it takes the body's rates and the velocity of the CoG that is made of them: a root's velocity,
held between two samples of motion capture, and what turning and bending add at every tick. An arm
of metres makes much of a gyro's noise, and of a tube that rings faster than the capture samples.
"""

from math import isnan, pi, sqrt, tan

from snakegen.kernels.core.no_alloc import bare
from snakegen.kernels.core.types import Floats


@bare
def low_pass(rate: Floats, memory: Floats, cutoff: float, dt: float) -> None:
    """Filters one sample (3,) in place: ``ω_c² / (s² + √2 ω_c s + ω_c²)``, bilinear, prewarped.

    Args:
        rate: (3,) measured now; filtered afterwards.
        memory: (2, 3) of the transposed direct form II; NaN: the first sample was there for ever.
        cutoff: Hz, where half the power is left; below half the sampling rate.
        dt: s, between two samples.
    """
    c = tan(pi * cutoff * dt)
    scale = 1.0 + sqrt(2.0) * c + c * c
    b = c * c / scale
    a1, a2 = 2.0 * (c * c - 1.0) / scale, (1.0 - sqrt(2.0) * c + c * c) / scale
    for k in range(3):
        x = rate[k]
        if isnan(memory[0, k]):
            memory[0, k], memory[1, k] = (1.0 - b) * x, (b - a2) * x
        y = b * x + memory[0, k]
        memory[0, k] = 2.0 * b * x - a1 * y + memory[1, k]
        memory[1, k] = b * x - a2 * y
        rate[k] = y
