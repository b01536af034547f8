"""Work in other processes: one pool for evaluating grasps, building libraries, rendering images.

`WorkerPool` is an executor as those of `concurrent.futures`: `submit` gives a future, `map` gives
results in order, and the pool is a context that ends its processes::

    from burg_drake.core.workers import WorkerPool
    from my_images import render  # def render(number: int) -> Image

    with WorkerPool() as pool:
        for number, image in enumerate(pool.map(render, range(100))):
            image.save(f"{number:03d}.png")

Workers are fresh interpreters that are talked to over a pipe. They are never forked, which Drake
does not survive, and they do not import the program's main module, so that scripts and notebooks
need no guard; hence functions have to stand in a module that can be imported. On Linux they start
with a faster memory allocator where there is one (`allocator`).

**Sessions.** What is expensive to build (a scene with its renderer, a judge) is built once in each
worker, and handed to every task of the session as its first argument. A worker keeps the last few
of them, and stays with a session while that has work::

    scene = Session("kitchen", partial(SceneRenderer, "kitchen.yaml"))
    futures = [pool.submit_task(Task(render_view, (X_WC,), session=scene)) for X_WC in poses]

**Progress.** A task may call `report_progress(message)`; `Task.on_progress` is called with each
message, in a thread of the pool. Outside of a worker it does nothing.

**Crashes, hangs, memory.** A worker that dies (a crash inside Drake, a `TimeLimit`, an end from
outside such as the system's when memory runs out) takes no other task with it. The task that it was
at is tried again, alone in a fresh process; when that dies too, the future raises `WorkerDied`,
which says why, and whether it was through no fault of the task. A task that took too long is not
tried again. A session whose building ends its worker fails after `Session.attempts`.

**Ending.** Leaving the `with` block waits for what is under way. Leaving it by an exception, such
as that of Ctrl-C, ends the workers at once (`kill_workers`). Workers do not hear an interrupt from
the keyboard, and end when their parent does, also when that is killed. One task alone is ended by
`WorkerFuture.interrupt`, which it notices as it reports progress, or `WorkerFuture.terminate`.

Beside the pool: `map_unordered` for work that this process does itself if there is one worker,
`Prefetcher` for results that are made ahead, and `start_worker` for a process that serves as
something else, such as a node of a cluster.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
