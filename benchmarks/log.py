"""What logging costs: microseconds a tick and megabytes, `dragon4`, 60 s at 200 Hz.

    python benchmarks/log.py

Three parts: keeping a tick's samples in the loop (rows of arrays made beforehand), the whole
write of the .rrd spread over the ticks, and for comparison one `rerun.log` call a tick and
series, the way that columns replace.
"""

import sys
import tempfile
import time as clock
from pathlib import Path

import numpy as np
import pinocchio as pin
from scipy.spatial.transform import Rotation

import snakegen
from snakegen.log import read, write
from snakegen.simulation.recording.metrics import metrics
from snakegen.simulation.recording.recording import Event, Recording, channel
from snakegen.simulation.recording.verdict import FLIGHT_THRESHOLDS, verdict


def dragon_flight(seconds: float = 60.0, rate: float = 200.0) -> Recording:
    """Returns a made-up flight of `dragon4` with noise in every bit of every column."""
    robot = snakegen.load("dragon4")
    rng = np.random.default_rng(1)
    time = np.arange(round(seconds * rate)) / rate
    joints = list(robot.model.names[2:])
    gimbals = tuple(n for n in joints if n.startswith("gimbal"))
    chain = tuple(n for n in joints if n.startswith("joint"))

    def noise(columns: int, size: float) -> np.ndarray:
        return size * rng.standard_normal((time.size, columns))

    def swing(columns: int, size: float) -> np.ndarray:
        rates, phases = rng.uniform(0.1, 0.5, columns), rng.uniform(0, 6, columns)
        return size * np.sin(np.outer(time, rates) + phases)

    asked = {n: 0.15 * np.sin(0.3 * time) + (0.9 if n.endswith("yaw") else 0.0) for n in chain}
    joint_command = np.column_stack([asked[n] for n in chain])
    joint_angle = joint_command + noise(len(chain), 0.002)
    gimbal_command = swing(len(gimbals), 0.15)
    gimbal_angle = gimbal_command + noise(len(gimbals), 0.005)
    angles = dict(zip(chain, joint_angle.T, strict=True))
    angles |= dict(zip(gimbals, gimbal_angle.T, strict=True))
    turn = Rotation.from_rotvec(swing(3, 0.03) + noise(3, 0.002))
    target = np.column_stack([swing(2, 0.3), 0.5 + time / 40.0])
    position = target + swing(3, 0.01) + noise(3, 0.001)
    q = np.column_stack([np.zeros((time.size, 3)), turn.as_quat(), *(angles[n] for n in joints)])
    data = robot.model.createData()
    for i in range(time.size):
        q[i, :3] = position[i] - pin.centerOfMass(robot.model, data, q[i])
    rotors = tuple(f"rotor{j}_{k}" for j in range(1, 5) for k in (1, 2))
    thrust = 9.8 + swing(8, 3.0) + noise(8, 0.2)
    slow = time[::10]
    push = np.zeros((time.size, 6))
    push[(time > 0.4 * seconds) & (time < 0.7 * seconds), 1] = 8.0
    torque = {"joint_torque": (chain, 2.0), "gimbal_torque": (gimbals, 0.5)}
    channels = {
        "position": channel("position", position),
        "position_target": channel("position_target", target),
        "attitude": channel("attitude", turn.as_quat()),
        "attitude_target": channel("attitude_target", np.tile([0.0, 0, 0, 1], (time.size, 1))),
        "q": channel("q", q, ("x", "y", "z", "qx", "qy", "qz", "qw", *joints)),
        "thrust": channel("thrust", thrust, rotors),
        "thrust_command": channel("thrust_command", thrust + noise(8, 0.3), rotors),
        "gimbal_angle": channel("gimbal_angle", gimbal_angle, gimbals),
        "gimbal_command": channel("gimbal_command", gimbal_command, gimbals),
        "joint_angle": channel("joint_angle", joint_angle, chain),
        "joint_command": channel("joint_command", joint_command, chain),
        **{
            name: channel(name, swing(len(labels), size) + noise(len(labels), 0.1), labels)
            for name, (labels, size) in torque.items()
        },
        "disturbance": channel("disturbance", push),
        "power": channel("power", 1200.0 + noise(1, 20.0)),
        "sigma_min": channel("sigma_min", 0.15 + 0.05 * np.sin(slow / 5), time=slow),
        "force_margin": channel("force_margin", 22.0 + 3 * np.sin(slow / 5), time=slow),
        "torque_margin": channel("torque_margin", 4.0 + np.sin(slow / 4), time=slow),
        "floor_distance": channel("floor_distance", 0.3 + slow / 40.0, time=slow),
        "self_distance": channel("self_distance", 0.2 + 0.05 * np.sin(slow / 3), time=slow),
    }
    meta = {
        "robot": "dragon4",
        "mission": "made up",
        "mode": "fully actuated",
        "seed": 1,
        "urdf": robot.urdf,
        "weight_n": 9.81 * robot.mass,
        "rotors": [{"link": name, "axis": [0.0, 0.0, 1.0]} for name in rotors],
        "limits": {"thrust_max": 16.0, "joint_torque": 7.0, "gimbal_torque": 3.0},
    }
    events = (Event(0.0, "INFO", "in the air"), Event(0.4 * seconds, "WARN", "gust begins"))
    run = Recording(time, channels, events, meta, "A made-up flight.")
    numbers = metrics(run)
    return run.judged(numbers, verdict(numbers, FLIGHT_THRESHOLDS))


def keep(run: Recording) -> float:
    """Returns seconds to keep every tick of `run` in arrays made beforehand.

    A tick has one array a channel in hand, as the stepping loop has.
    """
    rows = [c.values for c in run.channels.values() if c.time is None]
    kept = [np.empty_like(values) for values in rows]
    in_hand = [values[0].copy() for values in rows]
    start = clock.perf_counter()
    for i in range(run.time.size):
        for target, values in zip(kept, in_hand, strict=True):
            target[i] = values
    return clock.perf_counter() - start


def row_by_row(run: Recording, path: Path, ticks: int = 500) -> float:
    """Returns seconds a tick when each series of each tick is one `rerun.log` call."""
    import rerun as rr

    rec = rr.RecordingStream("benchmark")
    rec.save(path)
    shown = {k: c for k, c in run.channels.items() if c.time is None}
    start = clock.perf_counter()
    for i in range(ticks):
        rec.set_time("time", duration=float(run.time[i]))
        for name, c in shown.items():
            rec.log(name, rr.Scalars(c.values[i]))
    rec.flush()
    rec.disconnect()
    return (clock.perf_counter() - start) / ticks


def main() -> int:
    """Prints the table; the first write warms rerun's imports up."""
    run = dragon_flight()
    columns = sum(c.values.shape[1] for c in run.channels.values())
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "flight.rrd"
        write(dragon_flight(1.0), path)
        spent, busy = [], []
        for _ in range(9):
            start, start_cpu = clock.perf_counter(), clock.process_time()
            write(run, path)
            spent.append(clock.perf_counter() - start)
            busy.append(clock.process_time() - start_cpu)
        size = path.stat().st_size / 1e6
        start = clock.perf_counter()
        back = read(path)
        reading = clock.perf_counter() - start
        rows = row_by_row(run, Path(folder) / "rows.rrd")
    ticks = run.time.size
    in_loop, writing = 1e6 * keep(run) / ticks, 1e6 * float(np.median(spent)) / ticks
    print(f"dragon4, {ticks} ticks, {columns} columns, every one noisy")
    print(f"  keep a tick in the loop   {in_loop:8.2f} µs")
    worst = 1e6 * max(spent) / ticks
    print(f"  write, spread over ticks  {writing:8.2f} µs   (worst of 9: {worst:.2f})")
    print(f"  its processor time        {1e6 * float(np.median(busy)) / ticks:8.2f} µs")
    print(f"  together                  {in_loop + writing:8.2f} µs   (bar: 15)")
    print(f"  a log call a series       {1e6 * rows:8.2f} µs")
    print(f"  file                      {size:8.2f} MB   (bar: 10)")
    same = metrics(back) == run.metrics
    print(f"  read back                 {reading:8.2f} s, metrics equal: {same}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
