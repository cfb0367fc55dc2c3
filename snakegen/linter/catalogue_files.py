"""Kinds of findings on the files of a model, on portability, and on MJCF."""

from snakegen.linter.rule import rules_of

ASSETS = rules_of(
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

PORTABILITY = rules_of(
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

MJCF = rules_of(
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
