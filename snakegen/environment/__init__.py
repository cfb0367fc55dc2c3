"""A Gymnasium environment: any robot that flies, on any flight mission.

Importing this folder registers ``snakegen/Flight-v0`` (``import snakegen`` does so too where
gymnasium is imported already): ``gymnasium.make("snakegen/Flight-v0", robot="dragon4",
mission="hover")``; ``gymnasium.make_vec`` flies many at once on MuJoCo's threads.
"""

from snakegen.errors import SnakegenError


def register_environments() -> None:
    """Registers ``snakegen/Flight-v0``.

    Raises:
        SnakegenError: gymnasium is not installed.
    """
    try:
        from gymnasium import register, registry
    except ImportError:
        raise SnakegenError(
            "the environment needs gymnasium, which is not installed: pip install 'snakegen[gym]'"
        ) from None

    if "snakegen/Flight-v0" not in registry:
        register(
            "snakegen/Flight-v0",
            entry_point="snakegen.environment.flight:FlightEnv",
            vector_entry_point="snakegen.environment.flight_vector:FlightVectorEnv",
        )


register_environments()
