"""Kinds of findings on the form of a URDF: its schema and its tree."""

from snakegen.linter.rule import rules_of

SCHEMA = rules_of(
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

TOPOLOGY = rules_of(
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
