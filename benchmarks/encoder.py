"""Image tower forward and gradient in the picture: ours against PyTorch's CLIP, taking turns in one run.

Both hold the same weights, in processes of their own, and are asked in turn, so that whatever else the machine does falls on both.
Reported: median and quartiles of the wall and processor time of a call, the largest difference of the two gradients, and the
memory that each process needed at its peak and before its model.

    python -m benchmarks.encoder --rounds 9
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

Call = Callable[[np.ndarray], np.ndarray]
"""Pictures [B, 224, 224, 3] in [0, 1] -> gradient of their mean cosine with a fixed vector, same shape."""


def target(dim: int) -> np.ndarray:
    """The vector that pictures are compared with."""
    vector = np.random.default_rng(1).normal(size=dim).astype(np.float32)
    return vector / np.linalg.norm(vector)


def load_torch(folder: Path) -> Call:
    """PyTorch, as the hub's library runs it: its fastest attention, no gradient for weights."""
    import torch
    import transformers

    torch.set_num_threads(os.cpu_count() or 1)
    model = transformers.CLIPVisionModelWithProjection.from_pretrained(folder).eval().requires_grad_(False)
    mean, std = torch.tensor([0.48145466, 0.4578275, 0.40821073]), torch.tensor([0.26862954, 0.26130258, 0.27577711])
    goal = torch.tensor(target(model.config.projection_dim))

    def call(pictures: np.ndarray) -> np.ndarray:
        given = torch.tensor(pictures, requires_grad=True)
        embedding = model(pixel_values=((given - mean) / std).permute(0, 3, 1, 2)).image_embeds
        (torch.nn.functional.normalize(embedding, dim=-1) @ goal).mean().backward()
        assert given.grad is not None
        return given.grad.numpy()

    return call


def load_jax(folder: Path) -> Call:
    """Ours, compiled."""
    import jax
    import jax.numpy as jnp

    from dreamfields_core.guidance.families import read_architecture
    from dreamfields_core.guidance.published import encoder, read_weights
    from storage.mapped import map_arrays

    arch = read_architecture(json.loads((folder / "config.json").read_text(encoding="utf-8")))
    params = read_weights(map_arrays([folder / "model.safetensors"]), arch, towers=("image",))
    model = encoder("benchmark", "", arch, params, lambda captions: np.zeros((len(captions), 1), np.int32))
    goal = jnp.asarray(target(model.dim))
    gradient = jax.jit(jax.grad(lambda images, params: jnp.mean(model.encode_image(params, images) @ goal)))
    return lambda pictures: np.asarray(gradient(jnp.asarray(pictures), params))


def worker(kind: str, folder: Path, batch: int) -> None:
    """Answer one call a line with its times; at the end of input, with the memory that was needed."""
    pictures = np.random.default_rng(0).random((batch, 224, 224, 3), np.float32)
    __import__("torch" if kind == "torch" else "jax")
    before = peak()
    call = (load_torch if kind == "torch" else load_jax)(folder)
    np.save(folder / f"{kind}.npy", call(pictures))
    print(json.dumps({"ready": True}), flush=True)
    for _ in sys.stdin:
        wall, processor = time.perf_counter(), time.process_time()
        call(pictures)
        print(json.dumps({"wall": time.perf_counter() - wall, "processor": time.process_time() - processor}), flush=True)
    print(json.dumps({"peak": peak(), "before": before}), flush=True)


def peak() -> float:
    """Largest resident memory of this process so far, MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def write_model(folder: Path, patch: int) -> None:
    """A CLIP of random weights, in a process of its own so that its memory is nobody's."""
    code = (
        "import sys, transformers; "
        "transformers.CLIPModel(transformers.CLIPConfig(vision_config={'patch_size': int(sys.argv[1])})).save_pretrained(sys.argv[2])"
    )
    subprocess.run([sys.executable, "-c", code, str(patch), str(folder)], check=True, stderr=subprocess.DEVNULL)


def spread(values: list[float]) -> dict[str, float]:
    """Median and quartiles."""
    low, middle, high = np.quantile(values, [0.25, 0.5, 0.75])
    return {"median": round(float(middle), 4), "low": round(float(low), 4), "high": round(float(high), 4)}


def compare(patch: int, *, batch: int, rounds: int) -> dict[str, Any]:
    """One model, both implementations in turn."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_model(folder, patch)
        workers = {
            kind: subprocess.Popen(
                [sys.executable, "-m", "benchmarks.encoder", "--worker", kind, "--folder", name, "--batch", str(batch)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                text=True,
            )
            for kind in ("jax", "torch")
        }
        for process in workers.values():
            _answer(process)
        times: dict[str, list[dict[str, float]]] = {kind: [] for kind in workers}
        for turn in range(rounds + 1):
            for kind in sorted(workers, reverse=bool(turn % 2)):
                process = workers[kind]
                assert process.stdin is not None
                process.stdin.write("\n")
                process.stdin.flush()
                times[kind].append(_answer(process))
                time.sleep(0.3)  # let the other's threads stop spinning
        memory = {}
        for kind, process in workers.items():
            assert process.stdin is not None
            process.stdin.close()
            memory[kind] = _answer(process)
            process.wait()
        ours, theirs = np.load(folder / "jax.npy"), np.load(folder / "torch.npy")
    rows = {
        kind: {
            "wall_s": spread([one["wall"] for one in times[kind][1:]]),
            "processor_s": spread([one["processor"] for one in times[kind][1:]]),
            "peak_mb": round(memory[kind]["peak"]),
            "before_model_mb": round(memory[kind]["before"]),
        }
        for kind in workers
    }
    pairs = [theirs["wall"] / ours["wall"] for ours, theirs in zip(times["jax"][1:], times["torch"][1:])]
    return {
        "model": f"CLIP B/{patch}",
        "batch": batch,
        "rounds": rounds,
        **rows,
        "torch_over_jax": spread(pairs),
        "gradient_difference": float(np.linalg.norm(ours - theirs) / np.linalg.norm(theirs)),
    }


def _answer(process: subprocess.Popen[str]) -> dict[str, float]:
    assert process.stdout is not None
    line = process.stdout.readline()
    if not line:
        raise SystemExit("expected both implementations to run, but one process ended: install the extra `parity`")
    return json.loads(line)


def main(arguments: list[str] | None = None) -> int:
    """Print a row per model; `--out` keeps them as JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--patches", type=int, nargs="+", default=[32, 16], help="patch sizes of the models")
    parser.add_argument("--batch", type=int, default=8)
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--worker", choices=("jax", "torch"), help=argparse.SUPPRESS)
    parser.add_argument("--folder", type=Path, help=argparse.SUPPRESS)
    given = parser.parse_args(arguments)
    if given.worker:
        worker(given.worker, given.folder, given.batch)
        return 0
    results = []
    for patch in given.patches:
        results.append(compare(patch, batch=given.batch, rounds=given.rounds))
        print(json.dumps(results[-1], indent=1), flush=True)
    if given.out:
        given.out.write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
