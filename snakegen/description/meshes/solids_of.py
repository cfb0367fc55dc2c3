"""Sizes of the solids that a URDF gives its links."""

import xml.etree.ElementTree as ET
from collections.abc import Sequence

import numpy as np

from snakegen.base.geometry import Floats


def rod_radii(urdf: str, links: Sequence[str]) -> Floats:
    """Returns the radius (n,) [m] of each link's first collision cylinder, 0 where it has none."""
    root = ET.fromstring(urdf)
    found = {}
    for link in root.iterfind("link"):
        cylinder = link.find("collision/geometry/cylinder")
        if cylinder is not None:
            found[link.get("name")] = float(cylinder.get("radius", "0"))
    return np.array([found.get(name, 0.0) for name in links], float)
