"""Steps a second of the Gymnasium environment beside the compiled flight loop, one core.

    python benchmarks/gym_speed.py [--robot dragon4] [--seconds 20]

Both advance the same physics by one control period of 5 ms a step; the loop also runs the flight
controller. Times are processor time, so that other work on the machine counts little.
"""

import argparse
import time

import numpy as np

from snakegen.environment.flight import FlightEnv
from snakegen.environment.flight_vector import FlightVectorEnv
from snakegen.simulation.flight.run import run


def main() -> None:
    """Prints the rates and their ratios."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robot", default="dragon4")
    parser.add_argument("--seconds", type=float, default=20.0)
    chosen = parser.parse_args()
    options = {"duration": chosen.seconds, "trim": 0.0}
    run(FlightEnv(chosen.robot).task.robot, "hover", options=options)  # compiles
    loop = _rate(
        lambda: run(FlightEnv(chosen.robot).task.robot, "hover", options=options),
        200 * chosen.seconds,
    )
    print(f"compiled loop with controller and recording: {loop:.0f} steps/s")
    for action in ("actuators", "wrench"):
        env = FlightEnv(chosen.robot, action=action, options={"duration": 3600.0})
        rate = _env_rate(env, int(200 * chosen.seconds))
        print(f"environment, {action}: {rate:.0f} steps/s, {rate / loop:.2f} of the loop")
    many = FlightVectorEnv(16, chosen.robot, threads=1)
    many.reset(seed=0)
    zero, count = np.zeros(many.action_space.shape), int(200 * chosen.seconds) // 16
    rate = _rate(lambda: [many.step(zero) for _ in range(count)], 16 * count)
    print(f"16 environments on one thread: {rate:.0f} steps/s, {rate / loop:.2f} of the loop")


def _env_rate(env: FlightEnv, steps: int) -> float:
    """Returns the rate of steps from hover; resets, where a flight drifts off, are left out."""
    spent, done = 0.0, 0
    while done < steps:
        env.reset(seed=done)
        held = 2.0 * (env._control[env.task._driven] - env.task._low) / env.task._span - 1.0
        action = held if env.pilot is None else np.zeros(6)
        start = time.process_time()
        over = False
        while not over and done < steps:
            _, _, failed, ended, _ = env.step(action)
            done, over = done + 1, failed or ended
        spent += time.process_time() - start
    return done / spent


def _rate(work: object, steps: float) -> float:
    start = time.process_time()
    work()  # type: ignore[operator]
    return steps / (time.process_time() - start)


if __name__ == "__main__":
    main()
