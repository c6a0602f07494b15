"""A large file of the hub into the client's own cache, so that a download that was cut off goes on where it stopped.

The client itself goes on only as long as its process lives: it throws away what it has when it gives up or is stopped. So the bytes
come into a file of ours beside the blobs; once it is whole and its digest is the hub's, it takes the blob's name, and the client finds
the blob in its cache.
"""

import os
import re
from pathlib import Path

from storage.digests import sha256_file
from storage.errors import UnreadableWeights


def fetch_blob(repository: str, name: str, revision: str | None) -> None:
    """See to it that the blob of this file is in the cache, whole; a small file, which the hub names otherwise, is left to the client.

    One process at a time fetches a blob; its progress is the client's own bar.

    Raises: UnreadableWeights, and whatever the client raises.
    """
    from huggingface_hub import constants, get_hf_file_metadata, hf_hub_url
    from huggingface_hub.file_download import http_get, repo_folder_name
    from huggingface_hub.utils import WeakFileLock, build_hf_headers

    address = hf_hub_url(repository, name, revision=revision)
    stated = get_hf_file_metadata(address)
    if stated.etag is None or not re.fullmatch(r"[0-9a-f]{64}", stated.etag):
        return
    folder, cache = repo_folder_name(repo_id=repository, repo_type="model"), Path(constants.HF_HUB_CACHE)
    blob, lock = cache / folder / "blobs" / stated.etag, cache / ".locks" / folder / f"{stated.etag}.lock"
    part = blob.with_name(f"{stated.etag}.part")
    for path in (blob, lock):
        path.parent.mkdir(parents=True, exist_ok=True)
    with WeakFileLock(lock):  # the client's own lock on this blob
        if blob.exists():
            return
        with part.open("ab") as file:
            if stated.size is not None and file.tell() > stated.size:
                file.truncate(0)
            http_get(address, file, resume_size=file.tell(), headers=build_hf_headers(), expected_size=stated.size, displayed_filename=name)
        if (found := sha256_file(part)) != stated.etag:
            part.unlink()
            raise UnreadableWeights(f"Expected digest {stated.etag[:12]} for {name} of {repository}, got {found[:12]}: fetch it again.")
        os.replace(part, blob)
