"""Directions in words: which motion a twist is, seen from the root link's axes."""

import numpy as np
from numpy.typing import ArrayLike

from snakegen.base.geometry import Floats

_PURE = 1e-9  # share of rotation below which a motion is a translation
_NAMES = (
    ("surge (along the root link)", "sway (sideways)", "heave (up and down)"),
    ("roll", "pitch", "yaw"),
)


def body_axis(points: Floats) -> Floats | None:
    """Returns the unit direction of the line through `points` (n, 3), None if they are no line.

    A line: the second singular value of the centred points is below 1e-6 of the first.
    """
    if len(points) < 2:
        return None
    centred = points - points.mean(axis=0)
    _, sigma, rows = np.linalg.svd(centred, full_matrices=False)
    if sigma[0] < 1e-9 or (sigma.size > 1 and sigma[1] > 1e-6 * sigma[0]):
        return None
    return np.asarray(rows[0])


def motion(twist: Floats, lever: float, points: Floats) -> str:
    """Returns in words the motion that `twist` is: a rotation about a line, or a translation.

    Args:
        twist: (6,) [linear; angular] about the CoG, root-link axes, SI.
        lever: m, what counts 1 rad as in length.
        points: (n, 3) m, where the thrust acts; if on a line, that line is "the body axis".
    """
    linear, angular = np.asarray(twist[:3], float), np.asarray(twist[3:], float)
    turn = float(np.linalg.norm(angular)) * lever
    shift = float(np.linalg.norm(linear))
    if turn < 1e-6 * max(shift, 1e-300):
        return "translation: " + _named(linear / shift, 0)
    axis = angular / np.linalg.norm(angular)
    pitch = float(linear @ axis) / float(np.linalg.norm(angular))
    through = np.cross(angular, linear) / float(angular @ angular)
    line = body_axis(points)
    if line is not None and abs(abs(line @ axis) - 1.0) < 1e-6:
        words = "roll about the body axis"
    else:
        words = _named(axis, 1)
        if np.linalg.norm(through) > 1e-3 * lever:
            words += f" about a line {components(through)} m from the CoG"
    if abs(pitch) > 1e-3 * lever:
        words += f", with {pitch:+.3f} m of translation per radian"
    return words


def motions(twists: Floats, lever: float, points: Floats) -> tuple[str, ...]:
    """Returns in words a basis of motions, the columns of `twists` (6, k); pure pairs get one name.

    The basis has as many pure translations as possible. It depends on the space that the columns
    span, not on the columns: where several bases would do, axes of the root link come first.
    """
    if twists.shape[1] == 0:
        return ()
    scaled = np.vstack([twists[:3], twists[3:] * lever])
    columns, _, _ = np.linalg.svd(scaled, full_matrices=False)
    _, sigma, rows = np.linalg.svd(columns[3:])
    turned = columns @ rows.T
    size = np.zeros(turned.shape[1])
    size[: sigma.size] = sigma
    turned[3:, size < _PURE] = 0.0
    out, first = [], 0
    while first < size.size and size[first] >= _PURE:
        alike = int(np.sum(np.abs(size - size[first]) < 1e-6))
        for column in canonical_basis(turned[:, first : first + alike], (3, 4, 5)).T:
            out.append(motion(np.append(column[:3], column[3:] / lever), lever, points))
        first += alike
    shifts = turned[:3, first:]
    if shifts.shape[1] == 2:
        across = np.cross(shifts[:, 0], shifts[:, 1])[:, None]
        normal = components(canonical_basis(across, (2, 1, 0))[:, 0])
        out.append(f"translation at right angles to ({normal})")
    elif shifts.shape[1] == 3:
        out.append("every translation")
    elif shifts.shape[1] == 1:
        shift = canonical_basis(shifts, (0, 1, 2))[:, 0]
        out.append(motion(np.append(shift, np.zeros(3)), lever, points))
    return tuple(out)


def canonical_basis(columns: Floats, axes: tuple[int, ...]) -> Floats:
    """Returns the orthonormal basis of a space that lies nearest to coordinate axes, (n, k).

    Axis by axis, the one with the longest projection into what is left of the space; of equals
    (to 1e-6) the first of `axes`. The result does not depend on which basis `columns` (n, k) is.
    """
    basis, sigma, _ = np.linalg.svd(columns, full_matrices=False)
    basis = basis[:, sigma > 1e-9 * sigma[0]]
    projector = basis @ basis.T
    out = []
    for _ in range(basis.shape[1]):
        length = np.diag(projector)[list(axes)]
        axis = axes[int(np.flatnonzero(length > length.max() - 1e-6)[0])]
        if projector[axis, axis] <= 1e-12:  # `axes` see nothing of what is left
            axis = int(np.argmax(np.diag(projector)))
        out.append(projector[:, axis] / np.sqrt(projector[axis, axis]))
        projector = projector - np.outer(out[-1], out[-1])
    return np.array(out).T


def components(vector: ArrayLike, digits: int = 2) -> str:
    """Returns ``+0.15 -0.02 +0.99``; rounding first to 1e-9 makes ties and signs of zero equal."""
    values = (round(round(float(x), 9), digits) + 0.0 for x in np.asarray(vector))
    return " ".join(f"{x:+.{digits}f}" for x in values)


def _named(direction: Floats, kind: int) -> str:
    i = int(np.argmax(np.abs(direction).round(9)))
    if abs(direction[i]) > 0.9962:  # within 5°
        return _NAMES[kind][i]
    what = ("motion along", "rotation about")[kind]
    return f"{what} ({components(direction)}) of the root link"
