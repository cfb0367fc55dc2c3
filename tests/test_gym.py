"""The Gymnasium environment: its contract, its physics, and many flights against one."""

import subprocess
import sys
import warnings

import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium")
import mujoco  # noqa: E402
from gymnasium.utils.env_checker import check_env  # noqa: E402

import snakegen.environment  # noqa: E402, F401  (registers)
from snakegen.errors import MissionError  # noqa: E402


def _make(**how: object) -> "gymnasium.Env":
    return gymnasium.make("snakegen/Flight-v0", **how)


@pytest.mark.parametrize("action", ["actuators", "wrench"])
def test_gymnasium_finds_nothing_wrong(action: str) -> None:
    with warnings.catch_warnings():
        warnings.filterwarnings("error")
        warnings.filterwarnings("ignore", message=".*observation space m.*imum value is.*")
        check_env(_make(action=action).unwrapped, skip_render_check=True)


def _steer(seen: np.ndarray) -> np.ndarray:
    push = 0.8 * seen[:3] + 0.6 * seen[3:6]
    turn = 2.0 * seen[6:9] + 0.8 * seen[9:12]
    return np.clip(np.concatenate([push, turn]), -1.0, 1.0)


@pytest.mark.parametrize("robot", ["dragon4", "dragon3"])
def test_a_simple_controller_of_wrenches_settles(robot: str) -> None:
    env = _make(robot=robot, action="wrench")
    if robot == "dragon3":  # under-actuated: force across is not to be had, so the body drifts
        env = _make(robot=robot, action="wrench", spread=0.2)
    seen, _ = env.reset(seed=4)
    for _ in range(400):
        seen, reward, failed, _, _ = env.step(_steer(seen))
        assert not failed
    if robot == "dragon4":
        assert np.abs(seen[:3]).max() < 0.01 and np.abs(seen[6:9]).max() < 0.01
        assert reward > 0.98
    assert abs(seen[2]) < 0.02


def test_a_wrench_action_is_the_wrench_that_acts() -> None:
    env = _make(action="wrench", spread=0.0).unwrapped
    env.reset(seed=0)
    mass = env.task.robot.mass
    action = np.array([0.05, -0.03, 0.1, 0.0, 0.0, 0.0])
    for _ in range(60):  # motors and gimbals have their lag
        env.step(action)
    model, data = env.task.world.model, env.data
    mujoco.mj_subtreeVel(model, data)
    before = data.subtree_linvel[1].copy()
    for _ in range(20):
        env.step(action)
    mujoco.mj_subtreeVel(model, data)
    gained = mass * (data.subtree_linvel[1] - before) / (20 * env.task.seconds)
    np.testing.assert_allclose(gained, 0.5 * mass * 9.81 * action[:3], atol=0.15)


def test_the_same_seed_gives_the_same_episode_and_another_another() -> None:
    env = _make()
    first, again, other = (env.reset(seed=s)[0] for s in (5, 5, 6))
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


@pytest.mark.parametrize("action", ["actuators", "wrench"])
def test_many_flights_are_as_one_each(action: str) -> None:
    many = gymnasium.make_vec(
        "snakegen/Flight-v0", num_envs=3, action=action, vectorization_mode="vector_entry_point"
    )
    seen, _ = many.reset(seed=10)
    rng = np.random.default_rng(1)
    actions = 0.2 * rng.standard_normal((30, 3, many.single_action_space.shape[0]))
    rows = [seen, *(many.step(a)[0] for a in actions)]
    for i in range(3):
        one = _make(action=action)
        alone = [one.reset(seed=10 + i)[0], *(one.step(a[i])[0] for a in actions)]
        np.testing.assert_allclose(np.array(rows)[:, i], np.array(alone), atol=1e-12)
    many.close()


def test_an_episode_that_ends_begins_again_in_the_next_step() -> None:
    many = gymnasium.make_vec(
        "snakegen/Flight-v0", num_envs=2, vectorization_mode="vector_entry_point"
    )
    many.reset(seed=0)
    fall = -np.ones(many.action_space.shape)
    fall[1] = many.single_action_space.sample() * 0.0
    ended = np.zeros(2, bool)
    for _ in range(400):
        seen, reward, failed, _, _ = many.step(fall)
        if ended.any():
            assert (reward[ended] == 0.0).all()
            assert np.abs(seen[ended, :3]).max() < 0.4
            break
        ended = failed.copy()
        assert (reward[failed] == -1.0).all()
    else:
        pytest.fail("motors off, and no episode ended")
    many.close()


def test_a_mission_without_a_flight_is_refused_in_one_line() -> None:
    with pytest.raises(MissionError, match="loop of its own"):
        _make(robot="screw4", mission="lcrank")
    with pytest.raises(MissionError, match="'actuators' or 'wrench'"):
        _make(action="thrust")


def test_importing_snakegen_after_gymnasium_is_enough() -> None:
    code = "import gymnasium, snakegen; print(gymnasium.spec('snakegen/Flight-v0').id)"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert run.stdout == "snakegen/Flight-v0\n", run.stderr


def test_the_example_tunes_something() -> None:
    run = subprocess.run(
        [sys.executable, "docs/examples/tune_gains.py", "--generations", "3", "--candidates", "8",
         "--seconds", "0.6"],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    best = [float(line.split("best ")[1].split(",")[0]) for line in run.stdout.splitlines()[:3]]
    assert best[-1] > best[0] - 1.0 and best[-1] > 100.0
