"""Connects a grasp planner to burg_drake. Copy this file beside your planner; it needs numpy, and
for a server msgpack and websockets.

It runs in the environment of the planner: with Python from 3.8, and without burg_drake.

A planner is a function from an `Observation` to grasps. This makes it a program that burg_drake can
ask, from any environment::

    from burg_planner import Observation, run

    def plan(observation: Observation) -> dict:
        ...  # your method, on observation.color, observation.depth, observation.K
        return {"X_CG": X_CG, "width": width, "score": score}

    if __name__ == "__main__":
        run(plan)

`python my_planner.py --port 9000` answers over a websocket, `ws://127.0.0.1:9000`, and needs the
packages msgpack and websockets. `python my_planner.py observation.npz answer.npz` reads one
observation from a file and writes the answer to another.

**The answer** is a dict with these entries; all but the poses may be left out or None:

- `X_CG`: (N, 4, 4) grasps in the camera's frame; or `X_WG` in the world, or `X_SG` in the scene.
- `score`: (N,) higher is better. Without it the first grasp is the best.
- `width`: (N,) distance between the object's two sides along the closing direction [m].
- `frame`: the frame G of the poses, by the name of a project, such as `acronym` or `vgn`
  (`burg-drake frames` lists them). Without it: origin midway between the finger pads, z along the
  approach, x along the closing direction.
- `time`: time that planning took [s], if the time around the call of the function is not right.
"""

from __future__ import annotations

import argparse
import hashlib
import io
import json
import math
import queue
import re
import socket
import sys
import threading
import time
import traceback
from dataclasses import dataclass, fields
from importlib.metadata import version
from pathlib import Path
from typing import Any, Callable, Mapping  # noqa: UP035  # Python 3.8

import numpy as np

PROTOCOL_NAME = "burg_drake.planner"
PROTOCOL_VERSION = 1
MAX_OBSERVATION_BYTES = 1 << 28
"""Colour, depth and segmentation of 20 million pixels fit in."""
MAX_ANSWER_BYTES = 1 << 26
"""300,000 grasps with widths and scores fit in."""
ARRAY_KINDS = "biuf"
"""Kinds of arrays that are sent: truth values and numbers."""


@dataclass(frozen=True, eq=False)
class Observation:
    """What a robot's camera sees of a scene, and the hand that is to grasp.

    Attributes:
        id: hash of the images and of all else; the answer names it.
        color: (H, W, 3) red, green, blue, uint8; None if the camera is one for depth only.
        depth: (H, W) distance along the optical axis, float32 [m]; 0 where none was measured.
        K: (3, 3) intrinsics of both images, without distortion; pixel centres are at integers.
        X_WC: (4, 4) pose of the camera in the world: z forward, x right, y down.
        X_WS: (4, 4) pose of the scene frame in the world: z up, on the table's top.
        bounds: (2, 3) lower and upper corner, in the scene frame, of the box with all objects [m].
        hand: name of the hand, `opening` (smallest and largest distance between its pads) [m],
            `tip` (distance from the origin of G to the finger tips along the approach) [m], and
            `X_HG` (pose of G in the frame of the hand's body).
        segmentation: (H, W) number of the object in each pixel, uint16, 0 for anything else; None
            if objects are not told apart.
        target: number of the object to grasp; None for any.
    """

    id: str
    color: Any
    depth: Any
    K: Any
    X_WC: Any
    X_WS: Any
    bounds: Any
    hand: Mapping[str, Any]
    segmentation: Any = None
    target: int | None = None

    @property
    def X_CS(self) -> Any:
        """(4, 4) pose of the scene frame in the camera's frame."""
        return np.linalg.inv(self.X_WC) @ self.X_WS

    def points(self) -> Any:
        """(H, W, 3) points of the depth image in the camera's frame [m]; NaN without depth."""
        height, width = self.depth.shape
        z = np.where(self.depth > 0.0, self.depth, np.nan).astype(float)
        x = (np.arange(width) - self.K[0, 2]) / self.K[0, 0] * z
        y = (np.arange(height)[:, None] - self.K[1, 2]) / self.K[1, 1] * z
        return np.stack([x, y, z], axis=-1)

    def rng(self) -> np.random.Generator:
        """Random numbers that follow from the observation, so that an answer can be repeated."""
        return np.random.default_rng(int(self.id[:16], 16))

    def arrays(self) -> dict[str, Any]:
        """The observation as arrays, texts and numbers by name; inverse of `from_arrays`."""
        found = {field.name: getattr(self, field.name) for field in fields(self)}
        found["hand"] = json.dumps(dict(self.hand))
        return {name: value for name, value in found.items() if value is not None}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, Any]) -> Observation:
        """The observation whose `arrays` these are."""
        found: dict[str, Any] = {field.name: arrays.get(field.name) for field in fields(cls)}
        found["hand"] = json.loads(str(arrays["hand"]))
        found["id"] = str(arrays["id"])
        if found["target"] is not None:
            found["target"] = int(found["target"])
        return cls(**found)


def observation_id(**parts: Any) -> str:
    """Hash of the parts of an observation: SHA-256 of names, shapes, types and bytes."""
    digest = hashlib.sha256()
    for name in sorted(parts):
        value = parts[name]
        if value is None:
            continue
        if not isinstance(value, np.ndarray):
            value = np.frombuffer(json.dumps(value, sort_keys=True).encode(), np.uint8)
        digest.update(f"{name} {value.shape} {value.dtype.str}\n".encode())
        digest.update(np.ascontiguousarray(value).tobytes())
    return digest.hexdigest()


PlanFunction = Callable[[Observation], Mapping[str, Any]]
"""A planner: returns an answer, see the text of this file."""


def answer_observation(plan: PlanFunction, observation: Observation) -> dict[str, Any]:
    """Calls a planner, and adds the time that it took and the observation's id to the answer.

    Raises:
        TypeError: the planner returned no dict.
    """
    begun = time.perf_counter()
    answer = plan(observation)
    elapsed = time.perf_counter() - begun
    if not isinstance(answer, Mapping):
        raise TypeError(f"the planner returned {type(answer).__name__}, not a dict with grasps")
    given = {str(name): value for name, value in answer.items() if value is not None}
    return {"time": elapsed, "observation": observation.id, **given}


def plain_value(name: str, value: Any) -> Any:
    """An entry of an answer as text, number, truth value or array of numbers.

    Args:
        name: name of the entry, for the message.
        value: one of these, or anything that numpy makes an array of, such as a list or a tensor.

    Raises:
        TypeError: it is something else.
    """
    for kind in (str, bool, int, float):
        if isinstance(value, kind):
            return kind(value)
    try:
        array = np.asarray(value)
    except Exception as error:  # lists of different lengths, tensors on a graphics card
        raise TypeError(f"{name} cannot be made an array: {error}") from error
    if array.dtype.kind == "f" and array.dtype.itemsize > 8:  # which few readers know
        array = array.astype(float)
    if array.ndim == 0 and array.dtype.kind == "U":
        return str(array)
    if array.dtype.kind not in ARRAY_KINDS:
        raise TypeError(f"{name} is {type(value).__name__} {str(value)[:40]!r}, not numbers")
    return array if array.ndim else array.item()


def write_arrays(path: str | Path, arrays: Mapping[str, Any]) -> None:
    """Writes arrays, texts and numbers to an .npz file.

    Raises:
        TypeError: an entry is something else.
        OSError: the file cannot be written.
    """
    buffer = io.BytesIO()
    plain: dict[str, Any] = {name: plain_value(name, value) for name, value in arrays.items()}
    np.savez(buffer, **plain)
    Path(path).write_bytes(buffer.getvalue())


def read_arrays(path: str | Path) -> dict[str, Any]:
    """Reads what `write_arrays` wrote.

    Raises:
        OSError: the file is missing.
        ValueError: the file is damaged.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            found = {name: file[name] for name in file.files}
    except OSError:
        raise
    except Exception as error:  # zipfile, zlib and numpy raise many kinds
        raise ValueError(f"{path} is not a file of arrays (.npz): {error}") from error
    return {name: value if value.ndim else value.item() for name, value in found.items()}


def pack_message(arrays: Mapping[str, Any]) -> bytes:
    """Arrays, texts and numbers as msgpack; an array is a map with its type, shape and bytes.

    Raises:
        TypeError: an entry is something else.
    """
    import msgpack

    def pack(value: Any) -> Any:
        if not isinstance(value, np.ndarray):
            return value
        return {"dtype": value.dtype.str, "shape": list(value.shape), "data": value.tobytes()}

    plain = {name: pack(plain_value(name, value)) for name, value in arrays.items()}
    packed: bytes = msgpack.packb(plain)
    return packed


def unpack_message(data: bytes | str) -> dict[str, Any]:
    """Inverse of `pack_message`. Takes no more memory than a few times the size of the message.

    Raises:
        ValueError: the message is damaged, or holds anything else.
    """
    import msgpack

    max_entries, max_dimensions = 64, 8
    is_complete = False

    def unpack_map(found: dict[str, Any]) -> Any:
        nonlocal is_complete
        if is_complete:  # the outermost map comes last
            raise ValueError("maps within maps")
        if found.keys() == {"dtype", "shape", "data"}:
            return _unpack_array(**found)
        is_complete = True
        return found

    def check_shape(found: list[Any]) -> list[Any]:
        if any(type(size) is not int or size < 0 for size in found):
            raise ValueError("lists that are not shapes of arrays")
        return found

    if isinstance(data, str):
        raise ValueError("the message is a text; msgpack is expected")
    try:
        message = msgpack.unpackb(
            data,
            object_hook=unpack_map,
            list_hook=check_shape,
            max_map_len=max_entries,
            max_array_len=max_dimensions,
            max_ext_len=0,
        )
    except Exception as error:
        raise ValueError(f"the message cannot be read: {error or type(error).__name__}") from error
    if not isinstance(message, dict):
        raise ValueError("the message is not a map of names to values")
    return message


def _unpack_array(dtype: Any, shape: Any, data: Any) -> Any:
    if not re.fullmatch(r"[<>|=]?[biuf](1|2|4|8)", str(dtype)):
        raise ValueError(f"an array of type {str(dtype)[:40]!r}")
    array = np.frombuffer(data, np.dtype(dtype))
    if array.size != math.prod(shape):
        raise ValueError(f"an array of shape {tuple(shape)} with {array.size} values")
    return array.reshape(shape).copy()  # frombuffer gives arrays that cannot be changed


def describe_error(error: BaseException) -> str:
    """An error of a planner as one line: its type, its message, and the line of the planner."""
    try:
        message = " ".join(str(error).encode(errors="replace").decode().split())
    except Exception:  # of anybody's class of errors
        message = ""
    text = f"{type(error).__name__}: {message}".rstrip(": ")
    for frame in reversed(traceback.extract_tb(error.__traceback__)):
        if not (frame.filename.startswith("<") or frame.filename == __file__) and (
            "/lib/python3" not in frame.filename
        ):
            return f"{text} ({Path(frame.filename).name}:{frame.lineno})"
    return text


class RemotePlanner:
    """A planner that another process serves.

    Example::

        with RemotePlanner("ws://127.0.0.1:9000") as planner:
            answer = planner.plan(observation)
    """

    def __init__(self, url: str, timeout: float = 60.0) -> None:
        """Connects.

        Args:
            url: address, such as `ws://127.0.0.1:9000`.
            timeout: time to wait for each answer [s].

        Raises:
            OSError: there is no server at the address.
            ValueError: the server is not one of planners.
        """
        self.url, self.timeout, self.name = url, timeout, ""
        self._socket: Any = None
        self._connect()

    def plan(self, observation: Observation) -> dict[str, Any]:
        """The answer to an observation. Connects again if the connection was lost.

        Raises:
            RuntimeError: the planner failed; the message is its error.
            TimeoutError: the answer took too long.
            OSError, ValueError: the connection broke, or the answer cannot be read.
        """
        message = pack_message(observation.arrays())
        if self._socket is None or self._socket.close_code is not None:
            self._connect()
        try:
            answer = self._exchange(message, self.timeout)
        except BaseException:
            # An answer that comes late must not be taken for that to the next observation.
            self._abort()
            raise
        if "error" in answer:
            raise RuntimeError(str(answer["error"]))
        return answer

    def _connect(self) -> None:
        connect_timeout = 10.0  # seconds
        from websockets.exceptions import WebSocketException
        from websockets.sync.client import connect

        self._abort()
        try:
            self._socket = connect(
                self.url,
                open_timeout=connect_timeout,
                close_timeout=1.0,
                max_size=MAX_ANSWER_BYTES,
                compression=None,
                # Pings would end the connection while the planner keeps Python busy. A planner is
                # asked directly, not through the proxy of the system.
                ping_interval=None,
                proxy=None,
            )
        except (WebSocketException, ValueError) as error:
            raise ValueError(f"{self.url} is not a planner: {error}") from error
        except TimeoutError as error:
            raise ConnectionError(f"no connection within {connect_timeout:g} s") from error
        try:
            try:
                # It may still work on an observation of which the answer was not waited for.
                patience = max(connect_timeout, self.timeout)
                greeting = self._exchange(None, patience)
            except TimeoutError as error:
                raise ConnectionError(f"no greeting within {patience:g} s") from error
            if greeting.get("protocol") != PROTOCOL_NAME:
                raise ValueError(f"{self.url} is not a planner: it sends no {PROTOCOL_NAME!r}")
            if greeting.get("version") != PROTOCOL_VERSION:
                raise ValueError(
                    f"{self.url} has version {greeting.get('version')!r} of the protocol, this is"
                    f" {PROTOCOL_VERSION}; copy burg_planner.py again"
                )
        except BaseException:
            self._abort()
            raise
        self.name = str(greeting.get("name", ""))

    def _exchange(self, message: bytes | None, timeout: float) -> dict[str, Any]:
        """Sends a message, if any, and receives one."""
        from websockets.exceptions import ConnectionClosed

        # Closing the connection also ends a wait for a server that does not read the message.
        timer = threading.Timer(timeout, self._socket.close_socket)
        begun = time.monotonic()
        timer.start()
        try:
            if message is not None:
                self._socket.send(message)
            return unpack_message(self._socket.recv())
        except (ConnectionClosed, OSError) as error:
            if time.monotonic() - begun >= timeout:
                raise TimeoutError(f"no answer within {timeout:g} s") from error
            raise OSError(f"the planner closed the connection: {error}") from error
        finally:
            timer.cancel()

    def _abort(self) -> None:
        if self._socket is not None:
            self._socket.close_socket()
            self._socket = None

    def close(self) -> None:
        """Ends the connection."""
        if self._socket is not None:
            self._socket.close()

    def __enter__(self) -> RemotePlanner:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def serve(plan: PlanFunction, port: int, host: str = "127.0.0.1", name: str = "") -> None:
    """Answers observations over a websocket until the process is interrupted.

    A planner that raises an error answers with its text, and goes on with the next observation.

    Args:
        plan: the planner; it is called in this thread, with one observation at a time.
        port: port to listen on; 0 for any free one, which is printed.
        host: address to listen on; by default only programs of this machine can connect.
        name: name of the planner; that of the function if empty.

    Raises:
        OSError: the port is in use.
    """
    import msgpack  # noqa: F401  # fails before the first observation
    from websockets.exceptions import ConnectionClosed
    from websockets.sync.server import ServerConnection, serve as serve_websocket

    name = name or getattr(plan, "__name__", "planner")
    greeting = {"protocol": PROTOCOL_NAME, "version": PROTOCOL_VERSION, "name": name}
    questions: queue.SimpleQueue[tuple[ServerConnection, Any, Any]] = queue.SimpleQueue()

    def talk(client: ServerConnection) -> None:
        replies: queue.SimpleQueue[bytes] = queue.SimpleQueue()
        try:
            questions.put((client, None, replies))  # greet it when the planner is free
            client.send(replies.get())
            for data in client:
                questions.put((client, data, replies))
                client.send(replies.get())
        except ConnectionClosed:
            pass

    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.create_server((host, port), family=family) as listener:
        address, listening = listener.getsockname()[:2]
        options: dict[str, Any] = {"max_size": MAX_OBSERVATION_BYTES, "compression": None}
        if int(version("websockets").partition(".")[0]) >= 15:
            options.update(ping_interval=None, max_queue=1)
        # Browsers always send an origin; pages of other sites must not reach the planner.
        server = serve_websocket(talk, sock=listener, origins=[None], **options)
        # The threads of the clients are daemons, too, and end with the process.
        threading.Thread(target=server.serve_forever, daemon=True).start()
        shown = f"[{address}]" if ":" in address else address
        print(f"planner {name} listens on ws://{shown}:{listening}", flush=True)
        try:
            while True:
                _answer_next(plan, questions, greeting)
        finally:
            server.shutdown()


def _answer_next(plan: PlanFunction, questions: Any, greeting: Mapping[str, Any]) -> None:
    """Waits a moment for a new client, and greets it, or for an observation, and answers it."""
    try:
        # A wait without end could not be interrupted.
        client, data, replies = questions.get(timeout=0.5)
    except queue.Empty:
        return
    if client.close_code is not None:  # it did not wait for the answer
        replies.put(b"")
        return
    if data is None:
        replies.put(pack_message(greeting))
        return
    try:
        observation = Observation.from_arrays(unpack_message(data))
        reply = pack_message(answer_observation(plan, observation))
        if len(reply) > MAX_ANSWER_BYTES:
            raise ValueError(f"the answer has {len(reply)} bytes; at most {MAX_ANSWER_BYTES}")
    except (Exception, SystemExit) as error:
        traceback.print_exc()
        reply = pack_message({"error": describe_error(error)})
    replies.put(reply)


def run(plan: PlanFunction, arguments: list[str] | None = None) -> None:
    """Runs a planner as a program; see the text of this file.

    Args:
        plan: the planner.
        arguments: arguments of the program; those of the command line if None.
    """
    parser = argparse.ArgumentParser(description="Answer burg_drake with grasps.")
    parser.add_argument("files", nargs="*", metavar="FILE", help="observation.npz answer.npz")
    parser.add_argument("--port", type=int, help="answer over a websocket at this port")
    parser.add_argument("--host", default="127.0.0.1", help="address to listen on")
    given = parser.parse_args(arguments)
    if given.port is not None and not given.files:
        try:
            serve(plan, given.port, given.host, Path(sys.argv[0]).stem)
        except KeyboardInterrupt:
            sys.exit(130)
        except ImportError as error:
            sys.exit(f"{error}; --port needs: pip install msgpack websockets")
        except (OSError, OverflowError) as error:
            reason = getattr(error, "strerror", None) or error
            sys.exit(f"cannot listen on port {given.port} of {given.host}: {reason}")
    elif len(given.files) == 2 and given.port is None:
        try:
            observation = Observation.from_arrays(read_arrays(given.files[0]))
        except (OSError, ValueError, KeyError) as error:
            sys.exit(f"{given.files[0]} cannot be read as an observation: {error}")
        write_arrays(given.files[1], answer_observation(plan, observation))
    else:
        parser.error("give --port, or the file of an observation and the file for the answer")
