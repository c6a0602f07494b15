"""Bytes, arrays and addresses: where everything that a run makes is kept. Knows no field and no mesh.

    errors       every way that this package refuses, by name
    contract     what every store does
    store        `open_store` for folders, s3:// and memory://
    local        a folder: nothing half-written is ever visible
    objects      object stores through obstore
    digests      sha256 and canonical JSON
    sealed       small JSON records that carry their own checksum
    artifacts    content-addressed files and the references that travel between steps
    steps        the record of one finished step: the cache that survives everything
    mirror       small objects, listed but not read again while they are the same
    locks        one process at a time, released by the kernel
    zarr_zip     a dict of arrays as one deterministic zarr v3 zip
    checkpoints  committed by a manifest, fenced by an epoch
    saver        checkpoints written behind the training loop's back
    weights      safetensors, read without pickle
    mapped       arrays of a published model's file, read one at a time
    published    the files of published models: a folder, or the hub's cache, verified
    resumed      a large file of the hub, which goes on where it was cut off
    download     a file from a plain address, once

Imports are cheap: zarr is loaded when the first checkpoint is read, obstore when the first object store is opened.
"""
