"""Contact-true screw drives: wheel geometry, rolling against the model, tracking in contact."""

import math
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from screw_urdf import drive_urdf

from snakegen.analysis.screw_drive import wheel_rates
from snakegen.description.mjcf.decorate import decorate
from snakegen.description.mjcf.rolling_contact import (
    GROUND_BIT,
    ScrewContact,
    decorate_drive,
    decorate_screws,
    meet_rollers,
)
from snakegen.description.mjcf.screw_chain import BareChain, screw_mjcf
from snakegen.errors import DescriptionError, SpecError
from snakegen.robot.modules import from_urdf
from snakegen.screw_drive.ground_paths import FollowReference, TimeLaw, l_crank, path_length, square
from snakegen.screw_drive.kinematics import hara_chain
from snakegen.screw_drive.tracking import ScrewLaw
from snakegen.simulation.drive.contact_plant import (
    ContactDrive,
    drive_contact,
    mean_twist,
    measured_twist,
    unit_contacts,
)
from snakegen.spec.wheel_layout import wheel_layout

ALPHA = (-math.pi / 4, math.pi / 4, -math.pi / 4, math.pi / 4)
PAPER = (0.075, 0.0, 0.103, 0.123)
SHAPES = np.radians([[0, 0, 0], [-21.7, -21.7, -21.7], [25, -25, 25], [40, 20, -30], [-45, 0, 45]])
TWISTS = np.array([[-0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.05, 0.05, 0.2]])
STARTS = {
    "fig9": (0.1, 0.1, -1.1 * math.pi, -math.pi / 10, -math.pi / 11, -math.pi / 12),
    "fig13": (0.1, 0.04, -3.32, -math.pi / 9, -math.pi / 10, -math.pi / 11),
}


def plant(rollers="ring_sphere", **changes):
    """Returns a contact plant of HA's robot."""
    contact = ScrewContact(ALPHA, rollers=rollers, **changes)
    return ContactDrive(screw_mjcf(BareChain(contact)).compile(), 4)


@pytest.mark.parametrize("rollers", ["helix_capsule", "ring_sphere", "ellipsoid"])
@pytest.mark.parametrize("alpha", [-math.pi / 4, 0.6])
def test_layout_puts_axles_as_eq_3_has_them(rollers, alpha):
    layout = wheel_layout(alpha, 0.075, 8, 4, rollers)
    R = layout.rotation
    assert np.allclose(R @ R.transpose(0, 2, 1), np.eye(3)) and np.allclose(np.linalg.det(R), 1)
    r, p, y = layout.rpy.T
    cr, sr, cp, sp, cy, sy = np.cos(r), np.sin(r), np.cos(p), np.sin(p), np.cos(y), np.sin(y)
    z_axis = np.stack([cy * sp * cr + sy * sr, sy * sp * cr - cy * sr, cp * cr], axis=-1)
    assert np.allclose(z_axis, R[:, :, 2])  # URDF's fixed-axis rpy gives the same axle
    azimuth = np.arctan2(layout.position[:, 1], -layout.position[:, 2])
    for gamma, rotation in zip(azimuth, R, strict=True):
        # Turn the drum by -γ about x: the wheel stands on the ground, its axle as in eq 3.
        c, s = math.cos(-gamma), math.sin(-gamma)
        grounded = np.array([[1, 0, 0], [0, c, -s], [0, s, c]]) @ rotation[:, 2]
        assert np.allclose(grounded, [math.cos(alpha), math.sin(alpha), 0])
    assert np.allclose(np.sort(np.diff(np.sort(azimuth % (2 * np.pi)))), 2 * np.pi / 32)
    if rollers == "helix_capsule":  # blades run along the axles: dx/dγ = R_c / tan α
        blade = layout.blade == 3
        slope = np.diff(layout.position[blade, 0]) / np.diff(np.unwrap(azimuth[blade]))
        assert np.allclose(slope * math.tan(alpha), np.hypot(*layout.position[0, 1:]))


@pytest.mark.parametrize("rollers", ["helix_capsule", "ring_sphere", "ellipsoid"])
def test_drum_rolls_at_its_radius_on_average(rollers):
    """Casts the drum's lowest point from the geoms themselves, through a whole turn."""
    contact = ScrewContact(ALPHA, rollers=rollers)
    model = screw_mjcf(BareChain(contact)).compile()
    data = mujoco.MjData(model)
    wheels = [g for g in range(model.ngeom) if model.geom(g).name.startswith("wheel1_")]
    joint, heights = model.joint("screw1").qposadr[0], []
    nearest = np.zeros(6)
    for angle in np.linspace(0, 2 * np.pi / 32, 33):
        data.qpos[joint] = angle
        data.qpos[2] = 0.2
        mujoco.mj_kinematics(model, data)
        floor = model.geom("floor").id
        gap = min(mujoco.mj_geomDistance(model, data, floor, g, 1.0, nearest) for g in wheels)
        heights.append(0.2 - gap)
    assert abs(np.mean(heights) - 0.075) < 2e-5 and np.ptp(heights) < 5e-4


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"alpha": 0.0}, "0°: the screw drives nothing"),
        ({"alpha": math.pi / 2}, "slides sideways"),
        ({"wheel_radius": 0.08}, r"0\.08 m does not fit a drum of radius 0\.075 m"),
        ({"blades": 2, "wheels_per_blade": 1}, "at least 3 wheels"),
        ({"rollers": "cube"}, "one of helix_capsule"),
    ],
)
def test_a_drum_that_cannot_be_is_refused(given, says):
    with pytest.raises(SpecError, match=says):
        wheel_layout(**({"alpha": 0.7, "radius": 0.075} | given))


def test_mean_twist_inverts_the_exponential():
    rng = np.random.default_rng(0)
    for _ in range(20):
        start, twist, T = rng.normal(size=3), rng.normal(size=3), rng.uniform(0.1, 2)
        w = start.copy()
        for _ in range(4000):  # midpoint steps of ẋ = R(ψ) v
            half = w[2] + twist[2] * T / 8000
            c, s = math.cos(half), math.sin(half)
            w += np.array([c * twist[0] - s * twist[1], s * twist[0] + c * twist[1], twist[2]]) * (
                T / 4000
            )
        assert np.allclose(mean_twist(start, w, T), twist, atol=1e-6)


def twist_errors(drive, alpha=ALPHA, duration=2.0):
    """Returns the relative errors of 15 body twists against the model, levers scaled by L."""
    lever, errors = np.array([1.0, 1.0, 0.226]), []
    for shape in SHAPES:
        for twist in TWISTS:
            w, rate = np.concatenate([np.zeros(3), shape]), np.concatenate([twist, np.zeros(3)])
            u = wheel_rates(w, w, rate, 0.0, alpha, *PAPER)
            got = measured_twist(drive, shape, u[:4], 1.0, duration)
            errors.append(np.linalg.norm(lever * (got - twist)) / np.linalg.norm(lever * twist))
    return np.array(errors)


@pytest.mark.parametrize("rollers", ["ring_sphere", "ellipsoid", "ball"])
def test_contact_gives_the_models_twist(rollers):
    errors = twist_errors(plant(rollers), duration=1.5)
    assert errors.mean() <= 0.01 and errors.max() <= 0.015, errors


def test_ellipsoids_that_share_the_load_must_not_lag():
    """Long wheels under load together: critical damping loads the entering one more and turns."""
    drive, lever = plant("ellipsoid"), np.array([1.0, 1.0, 0.226])
    w, rate = np.append(np.zeros(3), SHAPES[1]), np.append(TWISTS[2], np.zeros(3))
    u, errors = wheel_rates(w, w, rate, 0.0, ALPHA, *PAPER), []
    for ratio in (drive.model.geom_solref[drive.model.geom_priority == 1][0, 1], 1.0):
        drive.model.geom_solref[drive.model.geom_priority == 1, 1] = ratio
        gap = lever * (measured_twist(drive, SHAPES[1], u[:4], 1.0, 2.0) - TWISTS[2])
        errors.append(np.linalg.norm(gap) / np.linalg.norm(lever * TWISTS[2]))
    assert errors[0] < 0.01 < 0.018 < errors[1]


def test_a_wrong_model_is_seen_by_contact():
    """The check above must be able to fail: a helix angle 2° off exceeds the bar."""
    wrong = tuple(a * 47 / 45 for a in ALPHA)
    assert twist_errors(plant("ball"), wrong, 1.0).mean() > 0.01


@pytest.mark.parametrize("start", STARTS)
def test_l_crank_in_contact(start):
    path = tuple(l_crank())
    reference = FollowReference(path, (0.226,) * 4, TimeLaw((path_length(path),), 0.125, 0.4))
    law = ScrewLaw(hara_chain(ALPHA), gain=0.5)
    run = drive_contact(law.command, reference, plant(), STARTS[start], 25.0)
    assert run.position_rmse(10.0) <= 0.003
    assert np.abs(run.error[run.time > 10, 2:]).max() < 0.02
    moving = (run.time > 1) & (run.time < 20)
    assert 0 < np.nanmean(run.slip[moving]) < 0.01


def test_square_in_contact_needs_feedback():
    reference = square(1.2, 0.2, 0.4, 3)
    law, drive = ScrewLaw(hara_chain(ALPHA), gain=(0.5, 0.5, 0.5, 0, 0, 0)), plant()
    run = drive_contact(law.command, reference, drive, np.zeros(6), reference.duration)
    assert run.position_rmse() <= 0.012
    blind = replace(law, feedback=False).command
    half = drive_contact(blind, reference, drive, np.zeros(6), reference.duration / 2)
    steered = float(np.sqrt((run.error[: half.time.size, :2] ** 2).sum(axis=1).mean()))
    assert steered < 0.5 * half.position_rmse()


def test_units_share_the_weight_and_keep_within_their_cones():
    drive = plant()
    found = []
    for _ in range(200):
        drive.step(np.array([1.0, -1.0, 1.0, -1.0, 0, 0, 0]) * 2, 5)
        found.append(unit_contacts(drive))
    late = found[100:]
    normal = np.array([sample.normal for sample in late])
    weight = 9.81 * float(drive.model.body_mass.sum())
    assert 0.7 * weight < normal.sum(axis=1).mean() < weight  # the caster carries the rest
    assert (normal.mean(axis=0) > 0.1 * weight).all()
    use = np.array([sample.cone_use for sample in late])
    assert 0 < use.mean() < 0.3 and use.max() <= 1 + 1e-9
    # A wheel that lands does not spin yet and slips for a moment; all others roll.
    slip = np.array([sample.slip for sample in late])
    assert 0 < np.median(slip) < 0.005 * 0.15 and slip.mean() < 0.1 * 0.15


def test_rollers_meet_the_ground_alone():
    drive = plant()
    for _ in range(50):
        drive.step(np.ones(7), 5)
        names = [
            {drive.model.geom(g).name.split("_")[0][:5] for g in contact.geom}
            for contact in drive.data.contact
        ]
        assert all("floor" in pair and len(pair) == 2 for pair in names) and names
    assert drive.model.geom("floor").contype[0] & GROUND_BIT


def test_ball_keeps_the_mass_and_the_meaning_of_its_command():
    ball, wheels = plant("ball"), plant()
    assert np.isclose(ball.model.body_mass.sum(), wheels.model.body_mass.sum())
    assert ball.model.nv == 6 + 2 * 3 + 4 * 3
    for _ in range(200):
        ball.step(np.array([1.0, -1.0, 1.0, -1.0, 0, 0, 0]) * 2, 5)
    read = [ball.data.actuator(f"screw{i}").velocity[0] for i in (1, 2, 3, 4)]
    assert np.allclose(read, [2, -2, 2, -2], atol=0.02)
    assert np.isclose(ball.data.qvel[0], 0.15, atol=0.002)  # r θ̇ tan 45°


def test_a_missing_body_is_named():
    spec = screw_mjcf(BareChain(ScrewContact(ALPHA)))
    for drum in ("screw2", "wheel1_3_2"):
        broken = spec.copy()
        broken.delete(broken.body(drum))
        with pytest.raises(DescriptionError, match="no body 'wheel"):
            decorate_screws(broken, ScrewContact(ALPHA))


@pytest.mark.parametrize("rollers", ["ring_sphere", "ball"])
def test_a_urdf_drives_as_the_bare_chain_does(rollers):
    text = drive_urdf(ALPHA)
    modules = from_urdf(text)
    full = decorate(text, modules, {}, visuals=False).compile()
    spec = decorate(text, modules, {}, visuals=False, rollers=rollers)
    spec.worldbody.add_geom(name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[20, 20, 0.1])
    meet_rollers(spec)
    drive = ContactDrive(spec.compile(), 4)
    assert np.isclose(drive.model.body_mass.sum(), full.body_mass.sum())
    shape, twist = np.array([0.4, 0.2, -0.3]), np.array([0.05, 0.05, 0.2])
    w, rate = np.concatenate([np.zeros(3), shape]), np.concatenate([twist, np.zeros(3)])
    u = wheel_rates(w, w, rate, 0.0, ALPHA, *PAPER)
    got = measured_twist(drive, shape, u[:4], 1.0, 2.0)
    lever = np.array([1.0, 1.0, 0.226])
    assert np.linalg.norm(lever * (got - twist)) <= 0.015 * np.linalg.norm(lever * twist)


def test_a_robot_without_drums_is_refused():
    modules = replace(from_urdf(drive_urdf(ALPHA)), screws=())
    with pytest.raises(DescriptionError, match="no screw unit"):
        decorate_drive(mujoco.MjSpec(), modules)
