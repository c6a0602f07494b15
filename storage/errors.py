"""Every way that the storage refuses. Each message is one sentence: what was expected, what came, the way out."""


class StorageError(Exception):
    """Base of all of them: catch this one to catch them all."""


class BadKey(StorageError):
    """A key is not a clean relative path."""


class BadAddress(StorageError):
    """A store's address has a scheme that nobody serves, or lacks its bucket."""


class StorageFull(StorageError):
    """No room for these bytes; whatever was saved before is still there."""


class StoreNotWritable(StorageError):
    """The store cannot be written: rights, a read-only disk, or a file where a folder should be."""


class StoreUnreachable(StorageError):
    """The store did not answer, or answered with an error of its own."""


class MissingObject(StorageError):
    """No object under this key."""


class AlreadyExists(StorageError):
    """A create-only write met an object with other bytes."""


class NotJson(StorageError):
    """A value has no canonical JSON form: NaN, infinity, a key that is no string, an object."""


class DamagedRecord(StorageError):
    """A JSON record does not fit its own checksum or lacks a field."""


class BadReference(StorageError):
    """A JSON object is no artifact reference."""


class MissingArtifact(StorageError):
    """An artifact is not in the store."""


class DamagedArtifact(StorageError):
    """An artifact's bytes do not fit its digest."""


class BadLeaf(StorageError):
    """An array's name or dtype cannot be written to a checkpoint."""


class DamagedCheckpoint(StorageError):
    """A checkpoint's bytes do not fit its manifest, or cannot be decoded."""


class FencedError(StorageError):
    """A newer writer has opened the run: this one must stop."""


class StepWentBack(StorageError):
    """A writer was given an earlier step than it has already saved."""


class UnreadableWeights(StorageError):
    """A weights file is truncated, invalid, of an unknown dtype, or not the expected one."""


class MissingWeights(StorageError):
    """No such weights file."""
