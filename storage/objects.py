"""Object stores through obstore: S3 and what speaks like it, and one in memory.

Uploads are one request each (`use_multipart=False`): a killed multipart upload dangles in the bucket, unseen and paid for.
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import timedelta
from typing import Any
from urllib.parse import urlsplit

import obstore
from obstore.exceptions import AlreadyExistsError, BaseError, PermissionDeniedError, UnauthenticatedError

from storage.contract import Entry, Store, check_key
from storage.errors import BadAddress, MissingObject, StorageFull, StoreNotWritable, StoreUnreachable

RETRIES = 5  # of one request, within a minute


class ObjectStore(Store):
    """Keys are object names below the prefix that `backend`, an obstore store, was opened with."""

    def __init__(self, url: str, backend: Any) -> None:
        self.url = url
        self._backend = backend

    def put(self, key: str, data: bytes) -> None:
        with self._explained(key, len(data)):
            obstore.put(self._backend, check_key(key), data, use_multipart=False)

    def create(self, key: str, data: bytes) -> None:
        try:
            with self._explained(key, len(data)):
                obstore.put(self._backend, check_key(key), data, use_multipart=False, mode="create")
        except AlreadyExistsError:
            self._settle_create(key, data)

    def get(self, key: str) -> bytes:
        with self._explained(key):
            return bytes(obstore.get(self._backend, check_key(key)).bytes())

    def head(self, key: str) -> int | None:
        try:
            with self._explained(key):
                return int(obstore.head(self._backend, check_key(key))["size"])
        except MissingObject:
            return None

    def entries(self, prefix: str = "") -> list[Entry]:
        folder = check_key(prefix) if prefix else None  # obstore takes whole segments
        with self._explained(prefix or "everything"):
            found = [item for batch in obstore.list(self._backend, prefix=folder) for item in batch]
        return sorted((Entry(i["path"], i["size"], i["last_modified"].timestamp()) for i in found), key=lambda entry: entry.key)

    def delete(self, key: str) -> None:
        try:
            with self._explained(key, 0):
                obstore.delete(self._backend, check_key(key))
        except MissingObject:
            pass

    @contextmanager
    def _explained(self, key: str, writing: int | None = None) -> Iterator[None]:
        """Turn obstore's errors into ours; `writing` is the number of bytes on their way."""
        where = f"{self.url.rstrip('/')}/{key}"
        try:
            yield
        except AlreadyExistsError:
            raise
        except FileNotFoundError as problem:
            if writing:
                raise StoreNotWritable(
                    f"Expected to write {where}, but there is no such bucket: create it, or check its name."
                ) from problem
            raise MissingObject(f"Expected an object at {where}, found none: was it deleted, or is this another store?") from problem
        except (PermissionDeniedError, UnauthenticatedError) as problem:
            kind = StoreUnreachable if writing is None else StoreNotWritable
            raise kind(f"Expected access to {where}, but it was refused: check AWS_ACCESS_KEY_ID and the bucket's policy.") from problem
        except BaseError as problem:
            said = str(problem).split("\n")[0][:300]
            if any(sign in said for sign in ("StorageFull", "QuotaExceeded", "507 Insufficient")):
                raise StorageFull(f"Expected room for {writing} bytes at {where}, but the store is full: free some space.") from problem
            raise StoreUnreachable(
                f"Expected an answer for {where}, got '{said}': check AWS_ENDPOINT_URL, AWS_REGION, the credentials and the network."
            ) from problem


def memory_store() -> Store:
    """A new store that lives as long as this object: for tests."""
    return ObjectStore("memory://", obstore.store.MemoryStore())


def s3_store(url: str) -> Store:
    """The store at s3://bucket/prefix, with everything else from the AWS_* environment. Raises: BadAddress."""
    parts = urlsplit(url)
    if not parts.netloc or parts.query or parts.fragment:
        raise BadAddress(f"Expected s3://bucket/prefix, got {url!r}: name the bucket, and a prefix without '?' or '#'.")
    endpoint = os.environ.get("AWS_ENDPOINT_URL_S3") or os.environ.get("AWS_ENDPOINT_URL", "")
    options: dict[str, Any] = {"connect_timeout": timedelta(seconds=5), "timeout": timedelta(seconds=120)}
    if endpoint.startswith("http://"):  # whoever writes http:// there has allowed it
        options["allow_http"] = True
    backend = obstore.store.S3Store(
        parts.netloc,
        prefix=parts.path.strip("/") or None,
        client_options=options,  # type: ignore[arg-type]
        retry_config={"max_retries": RETRIES, "retry_timeout": timedelta(seconds=60)},
    )
    return ObjectStore(url, backend)
