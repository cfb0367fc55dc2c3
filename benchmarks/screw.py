"""Screw drive in figures: model against contact, tracking, singular shapes, speeds.

Run: python benchmarks/screw.py [--only twist|track|hold|speed|terrain|model] [--preset screw4].
With --preset, contact is that of the MJCF built from that preset's URDF, and not of a bare chain.
Two things are always compared in one run on one machine; nothing here is asserted.
"""

import argparse
import math
import time
from dataclasses import replace

import numpy as np

from snakegen.description.mjcf.rolling_contact import ScrewContact
from snakegen.description.mjcf.screw_chain import BareChain, screw_mjcf
from snakegen.kernels.screw.constraints import follow
from snakegen.robot.robot import load
from snakegen.screw_drive.constraints import constraint_matrices, wheel_rates
from snakegen.screw_drive.ground_paths import (
    FollowReference,
    TimeLaw,
    l_crank,
    path_length,
    path_pieces,
    square,
)
from snakegen.screw_drive.kinematics import hara_chain
from snakegen.screw_drive.singularity import search_hold
from snakegen.screw_drive.tracking import ScrewLaw
from snakegen.simulation.drive.contact_plant import ContactDrive, drive_contact, measured_twist
from snakegen.simulation.drive.kinematic_plant import drive_kinematic
from snakegen.simulation.drive.run import contact_model
from snakegen.simulation.flight.run import run
from snakegen.spec.loading import load_spec

ALPHA = (-math.pi / 4, math.pi / 4, -math.pi / 4, math.pi / 4)
PAPER = (0.075, 0.0, 0.103, 0.123)
BUILDS = {  # name: (rollers, wheels per blade)
    "ball": ("ball", 4),
    "32 spheres": ("ring_sphere", 4),
    "32 capsules": ("helix_capsule", 4),
    "32 ellipsoids": ("ellipsoid", 4),
    "16 ellipsoids": ("ellipsoid", 2),
    "8 ellipsoids": ("ellipsoid", 1),
}
SHAPES = np.radians([[0, 0, 0], [-21.7, -21.7, -21.7], [25, -25, 25], [40, 20, -30], [-45, 0, 45]])
TWISTS = np.array([[-0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.05, 0.05, 0.2]])
STARTS = {
    "Fig 9": (0.1, 0.1, -1.1 * math.pi, -math.pi / 10, -math.pi / 11, -math.pi / 12),
    "Fig 13": (0.1, 0.04, -3.32, -math.pi / 9, -math.pi / 10, -math.pi / 11),
}


PRESET: list[str] = []  # name of the preset whose URDF is driven; a bare chain if empty


def plant(build: str) -> ContactDrive:
    """Returns the contact plant of a build."""
    rollers, per_blade = BUILDS[build]
    if PRESET:
        changes = (f"rollers={rollers}", f"wheels_per_blade={per_blade}")
        spec = load_spec(PRESET[0], overrides=[f"screw_drive.{c}" for c in changes])
        return ContactDrive(contact_model(load(spec)), 4)
    contact = ScrewContact(ALPHA, rollers=rollers, wheels_per_blade=per_blade)
    return ContactDrive(screw_mjcf(BareChain(contact)).compile(), 4)


def references() -> dict[str, FollowReference]:
    """Returns the L-crank at constant speed, as printed, and with 0.4 m/s² ramps."""
    path = tuple(l_crank())
    length = (path_length(path),)
    return {
        "steps": FollowReference(path, (0.226,) * 4, TimeLaw(length, 0.125)),
        "0.4 m/s²": FollowReference(path, (0.226,) * 4, TimeLaw(length, 0.125, 0.4)),
    }


def twist() -> None:
    """Body twist in contact against the model, 15 shapes and twists, mean over 4 s."""
    print("\nbody twist in contact against the model, 15 cases: mean / worst")
    lever = np.array([1.0, 1.0, 0.226])
    for build in BUILDS:
        drive, errors = plant(build), []
        for shape in SHAPES:
            for body in TWISTS:
                w, rate = np.append(np.zeros(3), shape), np.append(body, np.zeros(3))
                u = wheel_rates(w, w, rate, 0.0, ALPHA, *PAPER)
                gap = lever * (measured_twist(drive, shape, u[:4], 1.0, 4.0) - body)
                errors.append(100 * np.linalg.norm(gap) / np.linalg.norm(lever * body))
        print(f"  {build:14s} {np.mean(errors):5.2f} / {np.max(errors):5.2f} %")


def track() -> None:
    """L-crank and square, kinematic plant and contact."""
    geometry = hara_chain(ALPHA)
    law = ScrewLaw(geometry, 0.5)
    hold = ScrewLaw(geometry, (0.5, 0.5, 0.5, 0.0, 0.0, 0.0))
    print("\nkinematic plant: largest deviation from e(0) exp(-K t) over 25 s, and at 25 s")
    cases = [(f"L-crank {s}", law, references()["steps"], STARTS[s]) for s in STARTS]
    cases.append(("square", hold, square(1.2, 0.2, 0.4, 3), (0.05, -0.03, 0.1, 0, 0, 0)))
    for name, which, reference, start in cases:
        run = drive_kinematic(which.command, reference, geometry, start, 25.0)
        decay = np.exp(-np.multiply.outer(run.time, np.broadcast_to(which.gain, 6)))
        gap = np.abs(run.error - run.error[0] * decay).max(axis=1)
        print(f"  {name:15s} {gap.max():.1e} {gap[-1]:.1e}")
    print("\ncontact: position RMSE [mm] whole run, after 10 s; median slip [mm/s]")
    for build in ("ball", "32 spheres", "32 capsules"):
        drive = plant(build)
        for start, w0 in STARTS.items():
            for ramp, reference in references().items():
                run = drive_contact(law.command, reference, drive, w0, 25.0)
                _line(f"{build}, L-crank {start}, {ramp}", run)
        for acceleration in (0.4, math.inf):
            reference = square(1.2, 0.2, acceleration, 3)
            for feedback in (True, False):
                command = replace(hold, feedback=feedback).command
                run = drive_contact(command, reference, drive, np.zeros(6), reference.duration)
                how = "feedback" if feedback else "feedforward"
                _line(f"{build}, square {acceleration} m/s², {how}", run)


def _line(name: str, run) -> None:
    late = 1e3 * run.position_rmse(10.0)
    slip = 1e3 * np.median(run.slip)
    print(f"  {name:45s} {1e3 * run.position_rmse():6.2f} {late:6.2f} {slip:6.2f}")


def hold() -> None:
    """Smallest σ₃ and singular shapes of alternating drives."""
    print("\nalternating ±45°: smallest σ₃ (proved), and singular shapes within wider limits")
    for n in range(3, 11):
        geometry = hara_chain(tuple(math.pi / 4 * (-1.0) ** (np.arange(n) + 1)))
        start = time.perf_counter()
        span = np.full(n - 1, math.pi / 4)
        found = search_hold(geometry, -span, span)
        spent = time.perf_counter() - start
        print(
            f"  n = {n:2d}: ±45° {found.weakest.sigma[-1]:.3f} (≥ {found.certified:.3f}, "
            f"{found.boxes} boxes, {spent:.2f} s)",
            end="",
        )
        for limit in (86, 87, 88, 89, 90):
            wide = np.full(n - 1, math.radians(limit))
            lost = search_hold(geometry, -wide, wide, budget=1).singular
            if lost:
                shape = np.round(np.degrees(lost[0].shape), 1).tolist()
                print(f"; first within ±{limit}°, e.g. {shape}: {lost[0].kind}", end="")
                break
        print()


def terrain() -> None:
    """Screw4's own wheels in a duct, in a pipe and over ledges, beside open ground."""
    narrow = load(load_spec("screw4", overrides=["caster.track=0.02"]))
    names = ("distance_rmse_m", "distance_end_m", "screw_torque_max_n_m", "cone_use_mean")
    print("\nterrain: error of the head RMS and at the end [mm], screw torque [N·m], friction use")
    for what, robot, mission, options in (
        ("duct as wide as the body, ceiling pressing", load("screw4"), "gap", {}),
        ("pipe, 1 mm of room", narrow, "pipe", {}),
        ("pipe, no room", narrow, "pipe", {"room": 0.0}),
        *(
            (f"ledge of {h:g} m", load("screw4"), "ledge", {"height": h})
            for h in (0.02, 0.03, 0.04)
        ),
    ):
        rec = run(robot, mission, options=options)
        m = rec.metrics
        tail = f"tilt {m['tilt_max_rad']:.2f} rad  {rec.verdict.summary()}"
        for kind, head in (("", what), ("open_ground_", "  the same on open ground")):
            if kind + names[0] in m:
                a, b, torque, cone = (m[kind + n] for n in names)
                print(
                    f"  {head:44s} {1e3 * a:6.2f} {1e3 * b:6.2f} {torque:5.2f} {cone:5.2f}  "
                    f"{'' if kind else tail}"
                )


def speed() -> None:
    """Steps a second, driving, on one core."""
    print("\nsteps a second at 2 ms, four units, driving ahead: with the loop; mj_step alone")
    import mujoco

    for build in BUILDS:
        drive = plant(build)
        u = np.array([2.0, -2.0, 2.0, -2.0, 0.0, 0.0, 0.0])
        drive.step(u, 500)
        start = time.perf_counter()
        for _ in range(600):
            drive.step(u, 5)
            drive.state()
        loop = 3000 / (time.perf_counter() - start)
        start = time.perf_counter()
        mujoco.mj_step(drive.model, drive.data, 3000)
        bare = 3000 / (time.perf_counter() - start)
        print(f"  {build:14s} nv {drive.model.nv:3d} {loop:8.0f} {bare:8.0f}")


def model() -> None:
    """Cost of the model's parts."""
    print("\nmicroseconds a call")
    geometry, pieces, links = hara_chain(ALPHA), path_pieces(l_crank()), np.full(4, 0.226)
    law, w = ScrewLaw(geometry, 0.5), np.array(STARTS["Fig 9"])
    for name, call in {
        "A and B": lambda: constraint_matrices(w, ALPHA, *PAPER),
        "law (eq 7)": lambda: law.command(w, w, w),
        "follow-the-leader": lambda: follow(pieces, 1.5, links),
    }.items():
        call()
        start = time.perf_counter()
        for _ in range(5000):
            call()
        print(f"  {name:18s} {(time.perf_counter() - start) / 5e-3:6.1f}")


if __name__ == "__main__":
    tables = {"model": model, "twist": twist, "track": track, "hold": hold, "speed": speed}
    tables["terrain"] = terrain
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", choices=tables)
    parser.add_argument("--preset", metavar="NAME", help="drive the URDF of this preset")
    given = parser.parse_args()
    chosen = given.only
    PRESET += [given.preset] if given.preset else []
    for name, table in tables.items():
        if chosen in (None, name):
            table()
