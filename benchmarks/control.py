"""Times one control tick of `dragon4`, compiled and as plain NumPy, in one run.

    python benchmarks/control.py

The NumPy side does what a straightforward script does in virtual-single-rotor mode: kinematics
and mass properties of each body, the force map, its pseudo-inverse, and Newton with a numerical
pseudo-inverse of the same Jacobian. Both start from the same warm state.
"""

import time
from collections.abc import Callable

import numpy as np

import snakegen
from snakegen.base.geometry import rotation_about, skew
from snakegen.control import switch
from snakegen.control.controller import Controller, flight_controller
from snakegen.control.frame import cog_frame
from snakegen.kernels.control.types import Measured, State, Target
from snakegen.robot.robot import Robot
from snakegen.simulation.flight.postures import driven_joints, place
from snakegen.simulation.push.prediction import forecast

POSTURE = {"joint1_yaw": 0.8, "joint2_yaw": 0.8, "joint3_yaw": 0.8, "joint1_pitch": 0.3}


def best_of(function: Callable[[], object], count: int, rounds: int = 7) -> float:
    """Returns the best mean time of a call [µs]."""
    times = []
    for _ in range(rounds):
        start = time.perf_counter()
        for _ in range(count):
            function()
        times.append((time.perf_counter() - start) / count)
    return 1e6 * min(times)


def numpy_poses(c: Controller, angles: np.ndarray) -> tuple[list, list]:
    """Returns body attitudes and origins, base level at 0."""
    turns, places = [np.eye(3)], [np.zeros(3)]
    for i in range(1, len(c.tree.parent)):
        above = c.tree.parent[i]
        places.append(places[above] + turns[above] @ c.tree.translation[i])
        joint = rotation_about(c.tree.axis[i], angles[i - 1])
        turns.append(turns[above] @ c.tree.rotation[i] @ joint)
    return turns, places


def numpy_map(c: Controller, angles: np.ndarray, cog: np.ndarray, lam: np.ndarray) -> tuple:
    """Returns wrench columns (6, Ñ) and J_w (6, 3Ñ) with the CoG held."""
    turns, places = numpy_poses(c, angles)
    n = len(c.gimbals.limit)
    q, jacobian = np.zeros((6, n)), np.zeros((6, 3 * n))
    for j, body in enumerate(c.gimbals.thrust_body):
        u = turns[body] @ c.gimbals.thrust_axis[j]
        p = places[body] + turns[body] @ c.gimbals.thrust_point[j]
        q[:, j] = jacobian[:, j] = np.r_[u, np.cross(p - cog, u)]
        for k, joint in enumerate((c.gimbals.roll_body[j], c.gimbals.pitch_body[j])):
            axis = turns[joint] @ c.tree.axis[joint]
            du, dp = np.cross(axis, u), np.cross(axis, p - places[joint])
            jacobian[:3, (1 + k) * n + j] = lam[j] * du
            jacobian[3:, (1 + k) * n + j] = lam[j] * (np.cross(dp, u) + np.cross(p - cog, du))
    return q, jacobian


def numpy_tick(c: Controller, angles: np.ndarray, target: Target, last: np.ndarray) -> np.ndarray:
    """Returns [λ; φ; θ] of a tick at rest, as a plain script computes it."""
    turns, places = numpy_poses(c, angles)
    mass = c.tree.mass.sum()
    centres = [p + r @ d for r, p, d in zip(turns, places, c.tree.com, strict=True)]
    cog = sum(m * x for m, x in zip(c.tree.mass, centres, strict=True)) / mass
    inertia = np.zeros((3, 3))
    for r, x, m, body in zip(turns, centres, c.tree.mass, c.tree.inertia, strict=True):
        inertia += r @ body @ r.T - m * skew(x - cog) @ skew(x - cog)
    force = mass * (c.law.force[0] * (target.position - cog) + [0, 0, c.law.gravity])
    wrench = np.r_[force, inertia @ (c.law.torque[0] * 0.0)]
    n, index = len(last), np.stack([c.gimbals.roll_body, c.gimbals.pitch_body], 1) - 1
    full = angles.copy()
    full[index] = last
    bodies, origins = numpy_poses(c, full)
    spots = [
        o + r @ f - cog
        for r, o, f in zip(
            [bodies[b] for b in c.gimbals.thrust_body],
            [origins[b] for b in c.gimbals.thrust_body],
            c.gimbals.thrust_point,
            strict=True,
        )
    ]
    frames = [turns[b] for b in c.gimbals.link_body]
    columns = [np.vstack([r, skew(p) @ r]) for r, p in zip(frames, spots, strict=True)]
    pushes = (np.linalg.pinv(np.hstack(columns)) @ wrench).reshape(n, 3)
    roll = np.arctan2(-pushes[:, 1], pushes[:, 2])
    pitch = np.arctan2(pushes[:, 0], -pushes[:, 1] * np.sin(roll) + pushes[:, 2] * np.cos(roll))
    x = np.r_[np.linalg.norm(pushes, axis=1), roll, pitch]
    for _ in range(10):
        full[index] = np.stack([x[n : 2 * n], x[2 * n :]], 1)
        q, jacobian = numpy_map(c, full, cog, x[:n])
        error = wrench - q @ x[:n]
        if np.linalg.norm(error) < 1e-6:
            break
        x = x + np.linalg.pinv(jacobian) @ error
    return x


def held_at_limits(
    robot: Robot, c: Controller, measured: Measured, target: Target, state: State
) -> tuple[State, Target, tuple[str, ...]]:
    """Returns the memory after 5 s of holding 0.97 of the largest push by force.

    Beside it the target that asks for it, and what is at its limit.
    """
    joints = np.array([POSTURE.get(n, 0.0) for n in driven_joints(robot)])
    found = forecast(robot, c, place(robot, joints, np.zeros(3)), "force")
    asked = target._replace(acceleration=-0.97 * found.held * found.push[:3] / robot.mass)
    for _ in range(1000):
        state = c.tick(measured, asked, state, 0.005, force_dt=0.0)[0]
    if not np.any(np.abs(state.internal) > 0.1):
        raise RuntimeError("the push meets no limit: nothing is measured")
    return state, asked, found.stopped


def shaken(
    c: Controller, measured: Measured, target: Target, state: State, count: int = 50
) -> list[tuple[Measured, State]]:
    """Returns what goes into `count` ticks on end under noise: 1 mm, 1 mm/s, 0.1°, 0.01 rad/s.

    What differs from tick to tick is the wrench asked for, as in flight.
    """
    rng, out = np.random.default_rng(0), []
    for _ in range(count):
        turn = rotation_about(np.array([1.0, 0.0, 0.0]), np.radians(0.1) * rng.standard_normal())
        seen = measured._replace(
            rotation=turn @ measured.rotation,
            position=measured.position + 1e-3 * rng.standard_normal(3),
            linear=measured.linear + 1e-3 * rng.standard_normal(3),
            angular=measured.angular + 0.01 * rng.standard_normal(3),
        )
        out.append((seen, state))
        state = c.tick(seen, target, state, 0.005, force_dt=0.0)[0]
    return out


def main() -> None:
    """Prints the table."""
    robot = snakegen.load("dragon4")
    angles = robot.angles(robot.configuration(POSTURE))
    measured = Measured(np.eye(3), *np.zeros((3, 3)), angles, 0 * angles)
    print(f"{'tick of dragon4, state in, command out, one core':<52s} {'µs':>7s}")
    for mode in ("virtual_single_rotor", "dual_rotor"):
        c = flight_controller(robot, mode=mode)
        turns = switch.hover_gimbals(c, angles)
        frame = cog_frame(c, angles)
        near = frame.cog + np.array([0.05, -0.03, 0.02])
        target = Target(near, np.zeros(3), np.zeros(3), np.eye(3), np.zeros(3))
        state: State = c.tick(measured, target, c.start(turns), 0.0)[0]

        def compiled(c: Controller = c, t: Target = target, s: State = state) -> object:
            return c.tick(measured, t, s, 0.0)

        print(f"  {'compiled, ' + mode:<50s} {best_of(compiled, 1000):7.1f}")
        if mode == "virtual_single_rotor":
            mine = c.tick(measured, target, state, 0.0)[1]
            plain = numpy_tick(c, angles, target, state.gimbals)
            n = c.apparatuses
            thrust = mine.thrust.reshape(n, -1).sum(axis=1)
            apart = np.abs(np.r_[thrust, mine.gimbals.T.ravel()] - plain).max()

            def script(c: Controller = c, t: Target = target, s: State = state) -> object:
                return numpy_tick(c, angles, t, s.gimbals)

            bounded = flight_controller(robot, mode=mode, allocator="constrained")
            pushed, asked, stopped = held_at_limits(robot, bounded, measured, target, state)
            what_stops = ", ".join(stopped)
            for what, s, t in (("inside limits", state, target), ("at limits", pushed, asked)):

                def kept(c: Controller = bounded, t: Target = t, s: State = s) -> object:
                    return c.tick(measured, t, s, 0.005)

                name = f"compiled, constrained allocator, {what}"
                print(f"  {name:<50s} {best_of(kept, 200):7.1f}")
            noisy = shaken(bounded, measured, asked, pushed)

            def flown(c: Controller = bounded, t: Target = asked, n: list = noisy) -> object:
                return [c.tick(seen, t, s, 0.005) for seen, s in n]

            name = "compiled, constrained allocator, at limits, shaken"
            print(f"  {name:<50s} {best_of(flown, 4) / len(noisy):7.1f}")
            print(f"    (at limits: {what_stops})")
            name = f"NumPy script, same mode (answers {apart:.0e} apart)"
            print(f"  {name:<50s} {best_of(script, 30):7.1f}")


if __name__ == "__main__":
    main()
