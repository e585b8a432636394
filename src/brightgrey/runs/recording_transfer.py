"""Calls on their way to another process: a recording travels to each worker once, then only its name does."""

from __future__ import annotations

import io
import pickle
from collections import OrderedDict
from collections.abc import Callable, Mapping
from concurrent.futures import CancelledError, Executor, Future
from typing import Any

from brightgrey.recordings import Recording
from brightgrey.runs.blas_threads import limit_blas_threads
from brightgrey.runs.serialisation import code

__all__ = ["RecordingTransferExecutor"]

_MOST = 32  # recordings that a worker holds
_HELD: OrderedDict[str, Recording] = OrderedDict()
"""Recordings of this process, if it is a worker, by fingerprint: what makes them travel once. Nothing depends on it."""


class _Missing(Exception):  # noqa: N818 - a question, not an error
    """A worker has not got a recording."""


class _Packer(pickle.Pickler):
    """Leaves recordings at home and notes which."""

    def __init__(self, file: io.BytesIO) -> None:
        super().__init__(file, protocol=pickle.HIGHEST_PROTOCOL)
        self.left: dict[str, Recording] = {}

    def persistent_id(self, obj: Any) -> str | None:
        if not isinstance(obj, Recording):
            return None
        self.left[obj.fingerprint] = obj
        return obj.fingerprint


class _Unpacker(pickle.Unpickler):
    def persistent_load(self, pid: Any) -> Recording:
        if pid not in _HELD:
            raise _Missing
        return _HELD[pid]


def _open(sender: str, packed: bytes, sent: Mapping[str, Recording] | None = None) -> tuple[bool, Any]:
    """Make a call in a worker; gives whether it could, and its result."""
    limit_blas_threads()
    if sender != code():
        raise RuntimeError(f"the worker runs another brightgrey (code {code()}, not {sender}); results might differ")
    for name, recording in (sent or {}).items():
        _HELD[name] = recording
        while len(_HELD) > _MOST:
            _HELD.popitem(last=False)
    try:
        function, arguments = _Unpacker(io.BytesIO(packed)).load()
    except _Missing:
        return False, None
    return True, function(*arguments)


class RecordingTransferExecutor(Executor):
    """Sends calls to the workers of `inner`, with the recordings only where they are asked for."""

    def __init__(self, inner: Executor) -> None:
        self._inner = inner

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Result of ``fn(*args)``; keyword arguments are refused (TypeError)."""
        if kwargs:
            raise TypeError("evaluations are called without keywords")
        file = io.BytesIO()
        packer = _Packer(file)
        packer.dump((fn, args))
        packed, out = file.getvalue(), _Sent()
        self._send(out, packed, packer.left, None)
        return out

    def _send(
        self, out: _Sent, packed: bytes, left: Mapping[str, Recording], sent: Mapping[str, Recording] | None
    ) -> None:
        def back(inner: Future[Any]) -> None:
            try:
                made, result = inner.result()
                if made:
                    out.set_result(result)
                else:
                    self._send(out, packed, left, left)
            except CancelledError:
                out.give_up()
            except BaseException as error:
                out.set_exception(error)

        out.inner = self._inner.submit(_open, code(), packed, *([sent] if sent else []))
        out.inner.add_done_callback(back)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End `inner`."""
        self._inner.shutdown(wait=wait, cancel_futures=cancel_futures)


class _Sent(Future[Any]):
    """Result that is under way; to cancel it is to cancel what was sent."""

    inner: Future[Any]

    def cancel(self) -> bool:
        """Cancel it where it waits; what runs comes to its end."""
        return self.inner.cancel()

    def give_up(self) -> None:
        """Be cancelled, as what was sent has been."""
        super().cancel()
        self.set_running_or_notify_cancel()
