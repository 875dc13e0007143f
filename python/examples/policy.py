"""A policy that swings the arm up, found in about a minute: policy.py [generations].

CMA-ES (the package `cma`) draws some dozens of small networks, 300 times by default. A vector environment tries each
of them on several arms at once, and the best half shapes the next draw. Needs `pip install "$(ls
python/target/wheels/*.whl)[gym]" cma`. Prints the reward of a random policy and of the found one, more than 0.5.
Their starts are not those of the training. Keeps the network in `policy.npz`.
"""

import sys
import time

import cma
import gymnasium
import numpy as np

import pendularm.envs

LINKS = 2
HIDDEN = 8
SEEN, ACTIONS = 3 * LINKS, LINKS
STARTS = 4
STEPS = 200
# A typical largest rate [rad/s], which scales the network's inputs to about one.
SCALE = np.array([1.0] * (2 * LINKS) + [8.0] * LINKS)
SIZE = (SEEN + 1) * HIDDEN + (HIDDEN + 1) * ACTIONS


def act(weights: np.ndarray, observations: np.ndarray) -> np.ndarray:
    """Actions of many networks, (networks, SIZE), each for its own row of observations, (networks, arms, SEEN)."""
    first, last = np.split(weights, [(SEEN + 1) * HIDDEN], axis=1)
    first, last = first.reshape(-1, SEEN + 1, HIDDEN), last.reshape(-1, HIDDEN + 1, ACTIONS)
    hidden = np.tanh(observations / SCALE @ first[:, :-1] + first[:, -1:])
    return np.tanh(hidden @ last[:, :-1] + last[:, -1:])


def rewards(weights: np.ndarray, seed: int, starts: int = STARTS) -> np.ndarray:
    """Mean reward per step of each network over an episode, on `starts` arms each: 0 hanging, 1 upright."""
    networks = len(weights)
    env = gymnasium.make_vec("Pendularm-v0", networks * starts, links=LINKS, max_episode_steps=STEPS)
    observations, _ = env.reset(seed=seed)
    alive, total = np.ones(env.num_envs, bool), np.zeros(env.num_envs)
    for _ in range(STEPS):
        actions = act(weights, observations.reshape(networks, starts, SEEN))
        observations, reward, terminated, _, _ = env.step(actions.reshape(-1, ACTIONS).astype(np.float32))
        total += reward * alive
        alive &= ~terminated
    return total.reshape(networks, starts).mean(axis=1) / STEPS


def train(generations: int) -> np.ndarray:
    """Searches for this number of draws, and returns the weights of the best network."""
    search = cma.CMAEvolutionStrategy(np.zeros(SIZE), 0.5, {"popsize": 48, "seed": 1, "verbose": -9})
    began, steps = time.monotonic(), 0
    for generation in range(generations):
        drawn = search.ask()
        # The starts change with the draws, so the network cannot memorise them.
        search.tell(drawn, list(-rewards(np.array(drawn), seed=1000 * generation)))
        steps += len(drawn) * STARTS * STEPS
        if generation % 20 == 19:
            took = time.monotonic() - began
            print(f"{took:5.1f} s, {steps / 1e6:5.1f} million steps: best {-search.best.f:.3f}", flush=True)
    return search.result.xfavorite


def main() -> None:
    found = train(int(sys.argv[1]) if len(sys.argv) > 1 else 300)
    np.savez("policy.npz", weights=found)
    random = np.random.default_rng(0).normal(size=SIZE)
    for name, weights in [("a random policy", random), ("the policy found", found)]:
        print(f"{name}: {rewards(weights[None], seed=10**8, starts=64)[0]:.3f}")


if __name__ == "__main__":
    main()
