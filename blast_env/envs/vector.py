"""Several environments at once, in threads: the mode `"vector_entry_point"` of `make_vec`."""

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from functools import partial
from os import cpu_count
from typing import Any, TypeVar

import gymnasium as gym
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from gymnasium.vector.utils import iterate
from gymnasium.wrappers import TimeLimit

from blast_env.envs.arguments import PlainSpec, check_names
from blast_env.envs.barrier_env import BlastBarrierEnv
from blast_env.envs.simulator_env import BlastSimulatorEnv

_Observation = TypeVar("_Observation")
_Action = TypeVar("_Action")


class _Begun(gym.Wrapper[_Observation, _Action, _Observation, _Action]):
    """Begins a step in a thread; `step` then returns its result."""

    def __init__(self, env: gym.Env[_Observation, _Action]) -> None:
        super().__init__(env)
        self._pending: Future[tuple[_Observation, Any, bool, bool, dict[str, Any]]] | None = None
        self._resets_next = False

    def begin(self, action: _Action, pool: ThreadPoolExecutor) -> None:
        """Begin a step, unless the next call is a reset because the episode has ended."""
        self._wait()
        if not self._resets_next:
            self._pending = pool.submit(self.env.step, action)

    def step(self, action: _Action) -> tuple[_Observation, Any, bool, bool, dict[str, Any]]:
        """Return the result of the step that has begun, or step if none has."""
        pending, self._pending = self._pending, None
        result = self.env.step(action) if pending is None else pending.result()
        self._resets_next = result[2] or result[3]
        return result

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[_Observation, dict[str, Any]]:
        """Reset the environment."""
        self._wait()
        self._resets_next = False
        return self.env.reset(seed=seed, options=options)

    def _wait(self) -> None:
        """Wait for a step whose result was not fetched because another environment failed."""
        pending, self._pending = self._pending, None
        if pending is not None:
            pending.exception()


class ThreadedVectorEnv(PlainSpec, SyncVectorEnv):
    """Environments of one process, whose steps run in parallel threads.

    Results equal those of `SyncVectorEnv`, to the last bit: the environments share no state.
    Threads pay with the compiled engines, whose loops release the interpreter lock.

    Args:
        make_env: Makes one environment.
        num_envs: Number of environments.
        threads: Number of steps that run at the same time; by default the number of cores, or 1
            with `render_mode="human"`.
        autoreset_mode: When an environment whose episode has ended is reset: `"NextStep"`,
            `"SameStep"`, `"Disabled"` (by the caller), or an `AutoresetMode`.

    Raises:
        UnknownNameError: If there is no such autoreset mode.
    """

    def __init__(
        self,
        make_env: Callable[[], gym.Env[Any, Any]],
        num_envs: int,
        threads: int | None = None,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
    ) -> None:
        self._begun: list[_Begun[Any, Any]] = []
        if not isinstance(autoreset_mode, AutoresetMode):
            check_names("autoreset mode", [autoreset_mode], [each.value for each in AutoresetMode])
        super().__init__(
            [partial(self._begun_env, make_env)] * num_envs, autoreset_mode=autoreset_mode
        )
        if threads is None:
            threads = 1 if self.render_mode == "human" else cpu_count() or 1
        self._threads = min(threads, num_envs)
        self._pool: ThreadPoolExecutor | None = None

    def _begun_env(self, make_env: Callable[[], gym.Env[Any, Any]]) -> gym.Env[Any, Any]:
        self._begun.append(_Begun(make_env()))
        return self._begun[-1]

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Step in all environments; see `gymnasium.vector.VectorEnv.step`."""
        if self._threads > 1:
            if self._pool is None:
                self._pool = ThreadPoolExecutor(self._threads, "blast-env")
            each_action = iterate(self.action_space, actions)
            for env, action in zip(self._begun, each_action, strict=True):
                env.begin(action, self._pool)
        return super().step(actions)

    def close_extras(self, **kwargs: Any) -> None:
        """End the threads and close the environments."""
        if self._pool is not None:
            self._pool.shutdown()
            self._pool = None
        super().close_extras(**kwargs)


def barrier_vector(num_envs: int, **arguments: Any) -> ThreadedVectorEnv:
    """Return several `BlastBarrierEnv`, from its arguments and those of `_vector`."""
    return _vector(BlastBarrierEnv, num_envs, **arguments)


def simulator_vector(num_envs: int, **arguments: Any) -> ThreadedVectorEnv:
    """Return several `BlastSimulatorEnv`, from its arguments and those of `_vector`."""
    return _vector(BlastSimulatorEnv, num_envs, **arguments)


def _vector(
    env_class: Callable[..., gym.Env[Any, Any]],
    num_envs: int,
    max_episode_steps: int | None = None,
    autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
    **arguments: Any,
) -> ThreadedVectorEnv:
    def make_env() -> gym.Env[Any, Any]:
        env = env_class(**arguments)
        return env if max_episode_steps is None else TimeLimit(env, max_episode_steps)

    return ThreadedVectorEnv(make_env, num_envs, autoreset_mode=autoreset_mode)
