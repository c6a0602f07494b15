"""Published models on disk: from a folder, or fetched once from the hub or a plain address, and verified by digest.

The hub's client and its cache do the fetching: HF_HOME and HF_HUB_OFFLINE are respected, progress is shown, a download that was cut
off goes on where it stopped. What is in the cache is used without asking the network.
"""

import hashlib
import os
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from storage.digests import sha256_file
from storage.errors import MissingWeights, StorageError, UnreadableWeights
from storage.local import explained
from storage.resumed import fetch_blob


class NoNetwork(StorageError):
    """A model is not on disk and cannot be fetched now; the next attempt may succeed."""


class Offline(StorageError):
    """A model is not on disk, and fetching it is switched off."""


class NotPublished(StorageError):
    """No such model, or it lacks a file that is needed."""


@dataclass(frozen=True)
class ModelFiles:
    """Where a model's files lie. origin: the folder, or repository@commit. paths: name -> path."""

    origin: str
    paths: dict[str, Path]

    def text(self, name: str) -> str:
        """A file's text. Raises: UnreadableWeights."""
        try:
            return self.paths[name].read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as problem:
            raise UnreadableWeights(f"Expected text in {self.paths[name]}, got '{problem}': fetch the file again.") from problem

    def digest(self, names: Sequence[str]) -> str:
        """One sha256 over the digests of these files, in this order."""
        return hashlib.sha256("\n".join(file_digest(self.paths[name]) for name in names).encode("ascii")).hexdigest()


def from_folder(folder: Path) -> ModelFiles:
    """The files of a model in a folder. Raises: MissingWeights."""
    if not folder.is_dir():
        raise MissingWeights(f"Expected a folder with a published model at {folder}, found none: check the path.")
    found = {path.name: path for path in sorted(folder.iterdir()) if path.is_file() and not path.name.startswith(".")}
    if not found:
        raise MissingWeights(
            f"Expected a model's files in {folder}, found it empty: put config.json, tokenizer.json and the weights there."
        )
    return ModelFiles(str(folder), found)


def from_hub(
    repository: str, layouts: Sequence[Sequence[str]], *, revision: str | None = None, sha256: Mapping[str, str] | None = None
) -> ModelFiles:
    """The first of several sets of files that the hub's repository has whole, from the cache or else fetched, each file verified.

    Args:
      layouts: sets of names, the preferred first.
      revision: a branch, tag or commit; None means the commit that is in the cache, or else the newest.
      sha256: known digests, name -> sha256, that must hold besides the hub's own.

    Raises: NoNetwork, Offline, NotPublished, UnreadableWeights, StorageFull, StoreNotWritable, StoreUnreachable.
    """
    for look in (cached, _fetch):
        if paths := _whole(look, repository, layouts, revision):
            for name, path in paths.items():
                _verify(path, (sha256 or {}).get(name), repository)
            return ModelFiles(f"{repository}@{next(iter(paths.values())).parent.name}", paths)
    wanted = " or ".join(" with ".join(layout) for layout in layouts)
    raise NotPublished(f"Expected {wanted} in {repository}, but the repository has no such files: use another one.")


def on_disk(repository: str, layouts: Sequence[Sequence[str]], *, revision: str | None = None) -> dict[str, Path]:
    """What `from_hub` would find without asking the network, not verified; nothing where a file is missing."""
    return _whole(cached, repository, layouts, revision)


def _whole(
    look: Callable[[str, str, str | None], Path | None], repository: str, layouts: Sequence[Sequence[str]], revision: str | None
) -> dict[str, Path]:
    for layout in layouts:
        paths = {}
        for name in layout:
            if (path := look(repository, name, revision)) is None:
                break
            paths[name] = path
        else:
            return paths
    return {}


def cached(repository: str, name: str, revision: str | None = None) -> Path | None:
    """The file in the hub's cache, if it is there whole. Raises: NotPublished, where the name can be no repository's."""
    from huggingface_hub import errors, try_to_load_from_cache

    try:
        found = try_to_load_from_cache(repository, name, revision=revision)
    except errors.HFValidationError:
        raise _no_name(repository) from None
    return Path(found) if isinstance(found, str) else None


def cache_folder() -> Path:
    """Where the hub's client keeps what it has fetched."""
    from huggingface_hub import constants

    return Path(constants.HF_HUB_CACHE)


def _fetch(repository: str, name: str, revision: str | None) -> Path | None:
    """The file's path; None where the repository has no such file."""
    from huggingface_hub import constants, errors, hf_hub_download

    try:
        if name.endswith(".safetensors"):
            fetch_blob(repository, name, revision)
        return Path(hf_hub_download(repository, name, revision=revision))
    except errors.GatedRepoError:
        raise NotPublished(f"Expected free access to {repository}, got a licence to accept first: accept it there and log in.") from None
    except errors.RepositoryNotFoundError:
        raise NotPublished(f"Expected a repository {repository} on the hub, got none of that name, or a private one: check it.") from None
    except errors.RevisionNotFoundError:
        raise NotPublished(f"Expected revision {revision} of {repository}, got none of that name: check it.") from None
    except errors.RemoteEntryNotFoundError:
        return None
    except errors.HFValidationError:
        raise _no_name(repository) from None
    except (errors.LocalEntryNotFoundError, errors.OfflineModeIsEnabled):
        if constants.HF_HUB_OFFLINE:
            raise Offline(_got_neither(repository, name, "HF_HUB_OFFLINE is set")) from None
        raise NoNetwork(_got_neither(repository, name, "the hub did not answer")) from None
    except (errors.HfHubHTTPError, ConnectionError, TimeoutError) as problem:
        raise NoNetwork(_got_neither(repository, name, _brief(problem))) from None
    except OSError as problem:
        if problem.errno is None:  # the client's word for a file that came short
            raise _broken_off(repository, name, problem) from None
        with explained(cache_folder() / name, 0):
            raise
    except Exception as problem:  # the client lets its HTTP library's own errors through
        if type(problem).__module__.startswith(("httpx", "httpcore")):
            raise _broken_off(repository, name, problem) from None
        raise


def _broken_off(repository: str, name: str, problem: Exception) -> NoNetwork:
    return NoNetwork(_got_neither(repository, name, f"the download broke off, {_brief(problem)}; the next attempt goes on from there"))


def _no_name(repository: str) -> NotPublished:
    return NotPublished(
        f'Expected a folder that is there, owner/name on the hub, or a short name, got "{repository[:200]}": '
        "`dreamfields models` lists names."
    )


def _brief(problem: Exception) -> str:
    return (str(problem).splitlines() or [type(problem).__name__])[0][:120]


def _got_neither(repository: str, name: str, why: str) -> str:
    return (
        f"Expected {name} of {repository} from the hub or in {cache_folder()}, got neither ({why}): "
        "use --guidance embedded, or give the path of a folder that holds the model."
    )


def _verify(path: Path, sha256: str | None, repository: str) -> None:
    """The cache names each blob by the hub's own digest: sha256 for large files, git's for small ones."""
    blob = path.resolve().name
    checks: list[tuple[str, Callable[[Path], str]]] = []
    if re.fullmatch(r"[0-9a-f]{64}", blob):
        checks.append((blob, file_digest))
    elif re.fullmatch(r"[0-9a-f]{40}", blob):
        checks.append((blob, _git_digest))
    if sha256:
        checks.append((sha256.lower(), file_digest))
    for expected, digest in checks:
        if (found := digest(path)) != expected:
            raise UnreadableWeights(
                f"Expected digest {expected[:12]} for {path.name} of {repository}, got {found[:12]}: "
                f"remove {path.resolve()} and fetch it again."
            )


def file_digest(path: Path) -> str:
    """The sha256 of a file; within a process a file that has not changed is read once."""
    status = path.stat()
    return _file_digest(path, status.st_size, status.st_mtime_ns)


@lru_cache(maxsize=256)
def _file_digest(path: Path, size: int, changed: int) -> str:
    return sha256_file(path)


def _git_digest(path: Path) -> str:
    """What git calls a file: sha1 over its length and bytes."""
    data = path.read_bytes()
    return hashlib.sha1(b"blob %d\0" % len(data) + data, usedforsecurity=False).hexdigest()


def size_on_disk(paths: Iterable[Path]) -> int:
    """Bytes of these files together."""
    return sum(os.stat(path).st_size for path in paths)
