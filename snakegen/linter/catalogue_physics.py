"""Kinds of findings on the physics of a URDF: masses, inertias, limits, rotors."""

from snakegen.linter.rule import rules_of

PHYSICS = rules_of(
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
