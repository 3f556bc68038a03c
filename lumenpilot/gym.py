"""Importing this registers the bench twin with Gymnasium, as ``gymnasium.make("lumenpilot.gym:LumenPilot/Bench-v0")`` does."""

import gymnasium

ID = "LumenPilot/Bench-v0"
"""The environment's name; ``hardware/twin/bench_env.py`` describes it."""

gymnasium.register(ID, entry_point="hardware.twin.bench_env:BenchEnv")
