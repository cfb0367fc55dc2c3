"""Tunes the gains of a hover controller by the cross-entropy method, in about a minute.

The environment's wrench actions leave thrusts and gimbals to the robot's own allocation, so the
policy has four numbers: stiffness and damping of position and of attitude.

    pip install 'snakegen[gym]'
    python docs/examples/tune_gains.py
"""

import argparse

import gymnasium
import numpy as np

import snakegen.environment

gymnasium.register_envs(snakegen.environment)  # importing it registers snakegen/Flight-v0


def wrench(gains: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """Returns the actions (n, 6) of n controllers: `gains` (n, 4), observations `seen` (n, ·)."""
    position, velocity, attitude, rate = (seen[:, 3 * i : 3 * i + 3] for i in range(4))
    force = gains[:, :1] * position + gains[:, 1:2] * velocity
    torque = gains[:, 2:3] * attitude + gains[:, 3:] * rate
    return np.clip(np.hstack([force, torque]), -1.0, 1.0)


def main() -> None:
    """Prints the best return of each generation, and the gains at the end."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robot", default="dragon4")
    parser.add_argument("--generations", type=int, default=8)
    parser.add_argument("--candidates", type=int, default=16)
    parser.add_argument("--seconds", type=float, default=2.0)
    chosen = parser.parse_args()
    env = gymnasium.make_vec(
        "snakegen/Flight-v0", num_envs=chosen.candidates, robot=chosen.robot, action="wrench",
        vectorization_mode="vector_entry_point", spread=2.0,
    )  # fmt: skip
    rng = np.random.default_rng(0)
    mean, spread = np.log(np.array([0.3, 0.3, 0.3, 0.3])), np.ones(4)
    for generation in range(chosen.generations):
        gains = np.exp(mean + spread * rng.standard_normal((chosen.candidates, 4)))
        seen, _ = env.reset(seed=7)  # the same starts in every generation
        score, alive = np.zeros(chosen.candidates), np.ones(chosen.candidates, bool)
        for _ in range(round(chosen.seconds * 200)):
            seen, reward, failed, _, _ = env.step(wrench(gains, seen))
            score += np.where(alive, reward, 0.0)
            alive &= ~failed
        best = np.argsort(score)[-max(chosen.candidates // 4, 2) :]
        mean, spread = np.log(gains[best]).mean(axis=0), np.log(gains[best]).std(axis=0) + 0.05
        print(f"generation {generation + 1}: best {score.max():.1f}, median {np.median(score):.1f}")
    print("gains (position, velocity, attitude, rate):", np.exp(mean).round(3))
    env.close()


if __name__ == "__main__":
    main()
