"""A Gymnasium environment: any robot that flies, on any flight mission.

``gymnasium.make("snakegen/Flight-v0", robot="dragon4", mission="hover")`` finds it once snakegen
is installed with the extra ``gym``; ``gymnasium.make_vec`` flies many at once on MuJoCo's threads.
"""


def register_environments() -> None:
    """Registers ``snakegen/Flight-v0``; Gymnasium calls it (entry point ``gymnasium.envs``)."""
    from gymnasium import register, registry

    if "snakegen/Flight-v0" not in registry:
        register(
            "snakegen/Flight-v0",
            entry_point="snakegen.environment.flight:FlightEnv",
            vector_entry_point="snakegen.environment.flight_vector:FlightVectorEnv",
        )
