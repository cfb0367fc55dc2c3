"""Every kind of finding: its tier, its usual severity, what it means and what mends it.

**Error** is kept for what makes a model wrong or unloadable. What one parser ignores, what another
tool adds or a file that is not installed is a warning or a note. docs/lint.md holds this table.
"""

from typing import Literal, NamedTuple

Severity = Literal["error", "warning", "note"]
Tier = Literal["schema", "topology", "physics", "assets", "portability"]


class Rule(NamedTuple):
    """One kind of finding."""

    tier: Tier
    severity: Severity
    meaning: str
    remedy: str


def _tier(tier: Tier, rows: dict[str, tuple[Severity, str, str]]) -> dict[str, Rule]:
    return {code: Rule(tier, *row) for code, row in rows.items()}


_SCHEMA = _tier(
    "schema",
    {
        "unreadable": (
            "error",
            "The file cannot be read as text.",
            "Name a text file that exists, not compressed.",
        ),
        "too_large": (
            "error",
            "The file or its nesting is larger than any robot needs.",
            "Keep descriptions below 100 MB and meshes in files of their own.",
        ),
        "malformed_xml": (
            "error",
            "The text is not well-formed XML.",
            "Close, quote or escape what the message points at.",
        ),
        "late_declaration": (
            "warning",
            "Blank text precedes the XML declaration; strict parsers refuse the file.",
            "Remove everything before <?xml … ?>.",
        ),
        "foreign_encoding": (
            "warning",
            "The text is not UTF-8; parsers read other letters in its names, or refuse it.",
            "Save the file as UTF-8; --fix does.",
        ),
        "doctype": (
            "error",
            "A DOCTYPE can declare entities that expand without bound or read other files.",
            "Remove the DOCTYPE and write entities out.",
        ),
        "not_a_robot": (
            "error",
            "The root element is neither <robot> (URDF) nor <mujoco> (MJCF).",
            "Name a URDF or MJCF file.",
        ),
        "xacro_left": (
            "error",
            "The file is a xacro template that was not expanded.",
            "Expand it first: xacro model.urdf.xacro > model.urdf.",
        ),
        "unknown_tag": (
            "note",
            "An element that the URDF format does not know; parsers skip it.",
            "Nothing, if another tool reads it.",
        ),
        "misspelt_tag": (
            "error",
            "An unknown element resembles one of the format that is absent here, so its content "
            "is lost.",
            "Correct the spelling.",
        ),
        "misplaced_tag": (
            "warning",
            "An element of the format in a place where parsers do not look.",
            "Move it to the element that holds it.",
        ),
        "repeated_element": (
            "warning",
            "An element that may occur once occurs again; parsers read the first.",
            "Remove the one that is not meant.",
        ),
        "missing_element": ("error", "A required element is absent.", "Add the element."),
        "shapeless_geometry": (
            "warning",
            "A <geometry> without exactly one known shape; parsers skip or refuse it.",
            "Give it one box, cylinder, sphere, capsule or mesh.",
        ),
        "unknown_attribute": (
            "note",
            "An attribute that the URDF format does not know; parsers skip it.",
            "Nothing, if another tool reads it.",
        ),
        "misspelt_attribute": (
            "error",
            "An unknown attribute resembles one that is absent, and its value differs from what "
            "parsers assume for the absent one.",
            "Correct the spelling.",
        ),
        "missing_attribute": ("error", "A required attribute is absent.", "Add the attribute."),
        "not_finite": ("error", "A number is NaN or infinite.", "Write a finite number."),
        "not_numeric": ("error", "A word stands where a number is needed.", "Write a number."),
        "component_count": (
            "error",
            "A vector has too few or too many numbers.",
            "Write as many as the message says.",
        ),
        "unknown_joint_type": (
            "error",
            "The joint type is not one of the format.",
            "Use revolute, continuous, prismatic, fixed, floating or planar.",
        ),
    },
)

_TOPOLOGY = _tier(
    "topology",
    {
        "duplicate_link": ("error", "Two links have one name.", "Rename one."),
        "duplicate_joint": ("error", "Two joints have one name.", "Rename one."),
        "duplicate_material": (
            "warning",
            "Two materials have one name; parsers keep either.",
            "Rename or remove one.",
        ),
        "dangling_parent": ("error", "A joint's parent link does not exist.", "Name a link."),
        "dangling_child": ("error", "A joint's child link does not exist.", "Name a link."),
        "two_parents": ("error", "A link hangs on two joints.", "Remove one of the joints."),
        "no_root": ("error", "There is no link to start from.", "Leave one link without parent."),
        "two_roots": (
            "error",
            "Several links have no parent, so the file holds several robots.",
            "Join them by a joint, of type fixed if they do not move.",
        ),
        "loop": (
            "error",
            "The links form a closed loop, which a URDF cannot hold.",
            "Cut the loop at one joint; close it by an equality constraint in MJCF.",
        ),
        "dangling_mimic": ("error", "A joint mimics one that does not exist.", "Name a joint."),
        "mimic_loop": ("error", "Joints mimic each other in a circle.", "Leave one of them free."),
        "fixed_mimic": (
            "warning",
            "A joint mimics a fixed joint, or a fixed one mimics another; parsers ignore it.",
            "Remove the <mimic>.",
        ),
        "mimic_range": (
            "warning",
            "The leader's range takes the follower outside its own limits.",
            "Widen the follower's limits or narrow the leader's.",
        ),
        "mimic_zero": (
            "warning",
            "A mimic multiplier of 0 locks the follower.",
            "Use a fixed joint, or the true ratio.",
        ),
        "no_mass": (
            "warning",
            "No link has a mass: scenery, but no robot.",
            "Give the links <inertial> elements.",
        ),
        "multi_axis_joint": (
            "warning",
            "A planar or inner floating joint; MuJoCo and many planners do not read it.",
            "Use single-axis joints; only the root may float.",
        ),
    },
)

_PHYSICS = _tier(
    "physics",
    {
        "negative_mass": ("error", "A mass is negative.", "Correct the mass."),
        "massless_frame": (
            "note",
            "A link of zero mass and zero inertia: a frame.",
            "Nothing; the <inertial> may be left out.",
        ),
        "massless": (
            "warning",
            "A link moves but neither it nor a link fixed to it has a mass.",
            "Give it a mass, or weld it.",
        ),
        "massless_tip": (
            "warning",
            "Nothing that a joint moves has a mass, so its acceleration is undefined.",
            "Give the moved links masses before they are simulated.",
        ),
        "inertia_without_mass": (
            "warning",
            "An inertia stands with a mass of 0.",
            "Give the mass that belongs to it.",
        ),
        "bad_inertia": (
            "error",
            "The inertia is not positive definite: no body has it.",
            "Take inertias from CAD about the centre of mass; check the signs of products.",
        ),
        "inertia_triangle": (
            "error",
            "The largest principal moment exceeds the sum of the others: no body has it.",
            "Take inertias about the centre of mass, in the axes of the <inertial> origin.",
        ),
        "point_inertia": (
            "error",
            "A mass without a size: the radius of gyration is below a nanometre's order.",
            "Compute the inertia from the shape, for a box m/12 (b² + c²).",
        ),
        "gyration_small": (
            "warning",
            "The radius of gyration is below a thousandth of the body, or that of any metal.",
            "Check the units of the inertia: kg·m², not g mm².",
        ),
        "gyration_large": (
            "warning",
            "The radius of gyration exceeds the body, or ten times what the joints reach.",
            "Check the units of the inertia and whether it is about the centre of mass.",
        ),
        "identity_inertia": (
            "warning",
            "Mass and inertia of 1 are an exporter's placeholders.",
            "Enter the true values.",
        ),
        "com_outside": (
            "warning",
            "The centre of mass is farther from the link's shapes than they are large.",
            "Check the units and the frame of the <inertial> origin.",
        ),
        "density": (
            "warning",
            "Mass over the volume of the shapes is below 1 or above 30,000 kg/m³.",
            "Check units: millimetres for metres, grams for kilograms.",
        ),
        "mesh_inertia_large": (
            "warning",
            "The inertia exceeds that of any distribution of the mass inside the link's meshes.",
            "Check units, the scale of the meshes, and whether it is about the centre of mass.",
        ),
        "mesh_inertia_small": (
            "warning",
            "The inertia is below a thousandth of that of the link's meshes, filled evenly.",
            "Check units: kg·m², not g mm²; and the scale of the meshes.",
        ),
        "mesh_com_outside": (
            "warning",
            "The centre of mass lies outside the link's meshes by a tenth of their size or more.",
            "Check the units and the frame of the <inertial> origin, and the meshes' origins.",
        ),
        "mesh_density": (
            "warning",
            "Mass over the volume of the link's meshes is below 1 or above 30,000 kg/m³.",
            "Check the scale of the meshes (millimetres need scale 0.001) and the mass.",
        ),
        "mass_range": (
            "warning",
            "A link heavier than 10 t or lighter than 0.1 mg.",
            "Check the unit: kilograms.",
        ),
        "size_range": (
            "warning",
            "A shape or an offset of more than 50 m.",
            "Check the unit: metres, not millimetres.",
        ),
        "bad_size": (
            "warning",
            "A size of a shape is zero or negative; MuJoCo refuses it.",
            "Give positive sizes.",
        ),
        "zero_axis": ("error", "The joint's axis has no direction.", "Write a unit vector."),
        "axis_not_unit": (
            "warning",
            "The axis is not of length 1; parsers that do not normalise it scale the motion.",
            "Normalise it.",
        ),
        "axis_rounded": (
            "note",
            "The axis is not of length 1 by its printed digits.",
            "Print more digits.",
        ),
        "missing_limit": (
            "error",
            "A revolute or prismatic joint needs limits with effort and velocity.",
            'Add <limit lower="…" upper="…" effort="…" velocity="…"/>.',
        ),
        "negative_limit": ("error", "An effort or velocity limit is negative.", "Drop the sign."),
        "limits_swapped": ("error", "The lower limit exceeds the upper one.", "Swap them."),
        "locked_joint": (
            "warning",
            "Both limits are the same, so the joint cannot move.",
            "Use type fixed, or give it a range.",
        ),
        "neutral_outside": (
            "note",
            "The range excludes 0, so the neutral posture breaks the limit.",
            "Nothing; analyses start from the nearest angle within it.",
        ),
        "degrees_for_radians": (
            "warning",
            "An angle that is common in degrees and absurd in radians.",
            "Write radians.",
        ),
        "no_effort": (
            "warning",
            "An effort limit of 0: the joint has no declared authority.",
            "Enter the actuator's torque or force.",
        ),
        "no_velocity": (
            "note",
            "A velocity limit of 0.",
            "Enter the actuator's speed.",
        ),
        "effort_placeholder": (
            "note",
            "An effort limit above 100,000 N·m is a placeholder.",
            "Enter the actuator's torque.",
        ),
        "friction_above_effort": (
            "warning",
            "The joint's friction exceeds its effort limit, so it can never move.",
            "Check both values.",
        ),
        "negative_dynamics": (
            "error",
            "Negative damping or friction feeds energy in.",
            "Drop the sign.",
        ),
        "soft_limits": (
            "note",
            "The soft limits of the safety controller are not within the joint's limits.",
            "Move them inside.",
        ),
        "thrust_to_weight": (
            "warning",
            "All rotors at full thrust lift less than the robot's weight.",
            "Check thrust limits (newtons) and masses.",
        ),
        "drag_ratio": (
            "warning",
            "A drag-torque-to-thrust ratio outside 1e-5 … 0.5 m.",
            "Give torque over thrust in metres, 0.005 to 0.05 for common propellers.",
        ),
    },
)

_ASSETS = _tier(
    "assets",
    {
        "missing_mesh": (
            "warning",
            "A mesh file does not exist; masses and kinematics do not need it.",
            "Install the package, or correct the path.",
        ),
        "missing_texture": ("note", "A texture file does not exist.", "Correct the path."),
        "unresolved_package": (
            "note",
            "The package of a package:// path is not beside the file.",
            "Set ROS_PACKAGE_PATH, or install the package.",
        ),
        "backslash_path": (
            "warning",
            "A path with backslashes is found on Windows alone.",
            "Write forward slashes.",
        ),
        "case_mismatch": (
            "warning",
            "A file of that name exists in another letter case only.",
            "Use the file's own case.",
        ),
        "mesh_format": (
            "note",
            "A mesh format that MuJoCo does not read.",
            "Export STL or OBJ beside it.",
        ),
        "empty_mesh": ("warning", "A mesh file without a triangle.", "Export it again."),
        "mesh_scale": (
            "warning",
            "The scaled mesh is larger than 50 m: millimetres, in all likelihood.",
            'Write scale="0.001 0.001 0.001".',
        ),
        "large_mesh": (
            "error",
            "A mesh file too large to read.",
            "Decimate it.",
        ),
        "large_texture": (
            "error",
            "A texture file too large to read.",
            "Scale it down.",
        ),
    },
)

_PORTABILITY = _tier(
    "portability",
    {
        "package_mesh": (
            "note",
            "A package:// path is not resolved by MuJoCo and log viewers.",
            "Use a path relative to the file.",
        ),
        "attribute_blanks": (
            "warning",
            "Tabs or line ends in a vector: urdfdom, so ROS and Pinocchio, refuse the file.",
            "Write the numbers on one line with blanks between them.",
        ),
        "undeclared_prefix": (
            "warning",
            "A prefix that no xmlns declares: XML parsers with namespaces refuse the file.",
            'Add xmlns:PREFIX="…" to <robot>, or drop the prefix.',
        ),
        "default_namespace": (
            "note",
            "A default namespace: XML parsers with namespaces do not find <robot>.",
            "Drop xmlns=…; URDF has no namespace.",
        ),
        "remote_mesh": (
            "warning",
            "A mesh at a network address is not loaded.",
            "Download it beside the file.",
        ),
        "absolute_mesh": (
            "warning",
            "An absolute path breaks on another machine.",
            "Make it relative to the file.",
        ),
        "link_named_world": (
            "warning",
            "A link named world below the root clashes with the world body of simulators.",
            "Rename it.",
        ),
        "odd_name": (
            "note",
            "A name with blanks, slashes or letters outside ASCII.",
            "Use letters, digits and underscores.",
        ),
        "capsule_shape": (
            "note",
            "<capsule> is not part of the URDF standard; some parsers skip it.",
            "Use a cylinder with two spheres where that matters.",
        ),
        "quaternion_origin": (
            "note",
            "quat_xyzw in <origin> is read by few parsers.",
            "Write rpy.",
        ),
        "mirrored_mesh": (
            "note",
            "A negative scale mirrors a mesh; some viewers show it inside out.",
            "Export the mirrored mesh.",
        ),
    },
)

_MJCF = _tier(
    "physics",
    {
        "mjcf_default_density": (
            "warning",
            "A body without <inertial> takes mass and inertia from its geoms at a density of "
            "1000 kg/m³, visual ones included.",
            "Write <inertial>, or mass or density on every geom.",
        ),
        "mjcf_massless": (
            "error",
            "A body with a joint has neither <inertial> nor a geom; MuJoCo refuses it.",
            "Give it a mass.",
        ),
        "mjcf_range_ignored": (
            "warning",
            'A range is given with limited="false", which switches it off.',
            "Remove one of the two.",
        ),
        "mjcf_degrees": (
            "note",
            "Angles are in degrees, the default of MJCF.",
            'Write <compiler angle="radian"/> to compare with a URDF.',
        ),
        "mjcf_inertia_overridden": (
            "warning",
            'inertiafromgeom="true" replaces every <inertial> of the file.',
            'Write inertiafromgeom="auto".',
        ),
        "mjcf_inertia_altered": (
            "warning",
            "balanceinertia, boundmass or boundinertia alter masses and inertias silently.",
            "Correct the values in the file instead.",
        ),
        "mjcf_unlimited_actuator": (
            "note",
            "An actuator without a force range can push without bound.",
            "Give forcerange, or ctrlrange for motors.",
        ),
        "mjcf_implicit_fuse": (
            "warning",
            "fusestatic merges bodies, so names of fixed links are lost.",
            'Write fusestatic="false".',
        ),
    },
)

RULES: dict[str, Rule] = _SCHEMA | _TOPOLOGY | _PHYSICS | _ASSETS | _PORTABILITY | _MJCF


def page() -> str:
    """Returns docs/lint.md: every code with its tier, severity, meaning and remedy."""
    lines = [
        "# Findings of `snakegen lint`",
        "",
        "Every code that a finding ends with. An **error** makes a model wrong or unloadable: "
        "`analyze`, `flight` and `build` stop at it. A **warning** is probably not meant, or some "
        "program refuses it. A **note** is harmless; `--all` prints it. Some rules lower their "
        "severity where the model is not changed, for instance an impossible inertia of a frame "
        "that is fixed to a sound link.",
        "",
        "This page is made of `RULES` in the linter's catalogue; a test keeps the two together.",
    ]
    for tier in ("schema", "topology", "physics", "assets", "portability"):
        lines += ["", f"## {tier.capitalize()}", "", "| code | severity | meaning | remedy |"]
        lines.append("|---|---|---|---|")
        lines += [
            f"| `{code}` | {rule.severity} | {rule.meaning} | {rule.remedy} |"
            for code, rule in RULES.items()
            if rule.tier == tier
        ]
    return "\n".join(lines) + "\n"
