"""An executor for sweeps on a Ray cluster."""

from collections.abc import Callable
from concurrent.futures import Future
from typing import Any


class RayExecutor:
    """Runs the pieces of a sweep on Ray: ``sweep(grid, metric, executor=RayExecutor())``.

    `options` are those of `ray.remote`, such as `num_cpus=1`. Each worker needs the same wheel. The metric is sent to
    Ray once, and each node fetches it once. Ray repeats a piece whose worker was lost.
    """

    def __init__(self, **options: Any) -> None:
        import ray

        self._ray = ray
        self._options = options
        self._function: tuple[Callable[..., Any], Any] | None = None
        self._sent: tuple[object, Any] | None = None

    def submit(self, fn: Callable[..., Any], /, *args: Any) -> Future[Any]:
        """Calls the function on a worker. A first argument that is the same object as before is not sent again."""
        if self._function is None or self._function[0] is not fn:
            self._function = fn, self._ray.remote(**self._options)(fn) if self._options else self._ray.remote(fn)
        if args:
            if self._sent is None or self._sent[0] is not args[0]:
                self._sent = args[0], self._ray.put(args[0])
            args = (self._sent[1], *args[1:])
        future: Future[Any] = self._function[1].remote(*args).future()
        return future
