"""A hub of one repository on the loopback, which can break a download off in the middle, or stall. It counts what it was asked for."""

from __future__ import annotations

import hashlib
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

COMMIT = "c0ffee" + "0" * 34


@dataclass
class Hub:
    """files: name -> bytes, all of them under any repository called "good/...".

    break_after, stall_after: bytes after which the next GET of weights ends, or says no more. mute: no GET of weights gets a byte.
    """

    files: dict[str, bytes]
    break_after: int | None = None
    stall_after: int | None = None
    mute: bool = False
    asked: list[tuple[str, str, str | None]] = field(default_factory=list)
    lies: bool = False
    port: int = 0

    @property
    def address(self) -> str:
        return f"http://127.0.0.1:{self.port}"


@contextmanager
def served(hub: Hub) -> Iterator[Hub]:
    """The hub, answering until the block is left."""

    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def do_HEAD(self) -> None:
            self.answer(body=False)

        def do_GET(self) -> None:
            self.answer(body=True)

        def log_message(self, *_: object) -> None:
            """Quiet."""

        def answer(self, *, body: bool) -> None:
            hub.asked.append((self.command, self.path, self.headers.get("Range")))
            name = self.path.rsplit("/", 1)[-1].partition("?")[0]
            if "/good/" not in self.path or name not in hub.files:
                self.send_response(404)
                self.send_header("X-Error-Code", "EntryNotFound" if "/good/" in self.path else "RepoNotFound")
                self.send_header("X-Repo-Commit", COMMIT)
                self.send_header("Content-Length", "0")
                self.end_headers()
                return
            data = hub.files[name]
            digest = hashlib.sha256(data).hexdigest()
            start = int((self.headers.get("Range") or "bytes=0-").removeprefix("bytes=").split("-")[0])
            self.send_response(206 if start else 200)
            self.send_header("X-Repo-Commit", COMMIT)
            self.send_header("ETag", f'"{digest[::-1] if hub.lies else digest}"')
            self.send_header("Accept-Ranges", "bytes")
            if start:
                self.send_header("Content-Range", f"bytes {start}-{len(data) - 1}/{len(data)}")
            self.send_header("Content-Length", str(len(data) - start))
            self.end_headers()
            if body and hub.stall_after is not None and name.endswith(".safetensors"):
                self.wfile.write(data[start : hub.stall_after])
                hub.stall_after = None
                self.connection.recv(1)  # until the other side has gone
            elif body and hub.mute and name.endswith(".safetensors"):
                self.close_connection = True
            elif body:
                end = hub.break_after if hub.break_after is not None and name.endswith((".safetensors", ".npz")) else None
                self.wfile.write(data[start:end])
                if end is not None:
                    hub.break_after = None
                    self.close_connection = True

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    server.daemon_threads = True
    hub.port = server.server_port
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    try:
        yield hub
    finally:
        server.shutdown()
        server.server_close()
