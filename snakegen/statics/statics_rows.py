"""Rows of text about joint torques, hardest joint first, and about what the tip carries."""

import numpy as np

from snakegen.base.geometry import Floats

SHOWN = 12  # joints in a table; a longer robot shows its hardest


def joint_rows(
    joints: tuple[str, ...], torque: Floats, limit: Floats, use: Floats
) -> list[tuple[str, str]]:
    """Returns a row a joint: torque [N·m], and its share of the limit where one is declared."""
    loaded = np.flatnonzero((use > 1e-9) | (np.isinf(limit) & (np.abs(torque) > 1e-9)))
    order = loaded[np.lexsort((-np.abs(torque[loaded]), -use[loaded]))]
    out = []
    for i in order[:SHOWN]:
        of = f" of {limit[i]:.4g} ({100 * use[i]:.3g} %)" if np.isfinite(limit[i]) else ""
        out.append((joints[i], f"{torque[i]:+.4g} N·m{of}"))
    if len(order) > SHOWN:
        out.append(("", f"and {len(order) - SHOWN} joints with less"))
    if len(order) < len(joints):
        out.append(("no load", f"{len(joints) - len(order)} joints"))
    return out


def capacity_text(radius: float, unit: str, joint: str, free: Floats) -> str:
    """Returns the capacity in every direction, and the directions that load no joint."""
    out = f"{radius:.4g} {unit} in every direction" + (f" (limit: {joint})" if joint else "")
    if np.isinf(radius):
        return f"any {'force' if unit == 'N' else 'torque'}: no joint feels it"
    signed = [u * np.sign(u[np.argmax(np.abs(u))]) for u in free.T]  # either sense is the same
    along = " and ".join("[" + " ".join(f"{x + 0.0:.2f}" for x in u) + "]" for u in signed)
    return out + (f"; along {along} no joint feels it" if along else "")
