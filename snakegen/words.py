"""Directions in words: which motion a twist is, seen from the root link's axes."""

import numpy as np

from snakegen.geometry import Floats

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
            x, y, z = through
            words += f" about a line {x:+.2f} {y:+.2f} {z:+.2f} m from the CoG"
    if abs(pitch) > 1e-3 * lever:
        words += f", with {pitch:+.3f} m of translation per radian"
    return words


def motions(twists: Floats, lever: float, points: Floats) -> tuple[str, ...]:
    """Returns in words a basis of motions, the columns of `twists` (6, k); pure pairs get one name.

    The columns are first turned so that as many as possible are pure translations.
    """
    if twists.shape[1] == 0:
        return ()
    _, sigma, rows = np.linalg.svd(twists[3:] * lever)
    turned = twists @ rows.T
    size = np.zeros(turned.shape[1])
    size[: sigma.size] = sigma
    turned[3:, size < 1e-9] = 0.0
    shifts = turned[:3, size < 1e-9]
    out = [motion(turned[:, k], lever, points) for k in np.flatnonzero(size >= 1e-9)]
    if shifts.shape[1] == 2:
        across = np.cross(shifts[:, 0], shifts[:, 1])
        x, y, z = across / np.linalg.norm(across) * (-1.0 if across[2] < 0 else 1.0)
        out.append(f"translation across ({x:+.2f} {y:+.2f} {z:+.2f})")
    elif shifts.shape[1] == 3:
        out.append("every translation")
    else:
        out += [motion(turned[:, k], lever, points) for k in np.flatnonzero(size < 1e-9)]
    return tuple(out)


def _named(direction: Floats, kind: int) -> str:
    i = int(np.argmax(np.abs(direction)))
    if abs(direction[i]) > 0.9962:  # within 5°
        return _NAMES[kind][i]
    what = ("motion along", "rotation about")[kind]
    x, y, z = direction
    return f"{what} ({x:+.2f} {y:+.2f} {z:+.2f}) of the root link"
