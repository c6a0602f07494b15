"""A process that has a tiny field optimised and prints every event: `python -m tests.tasks.parent STORE [part.key=value ...]`."""

from __future__ import annotations

import json
import sys

from storage.store import open_store
from tasks.encoders import card
from tasks.step import Event, Place, perform
from tasks.steps import ENCODE, OPTIMIZE
from tests.tasks.tiny import tiny


def main(address: str, *settings: str) -> None:
    """Encode and optimise."""

    def tell(event: Event) -> None:
        print(json.dumps(event), flush=True)

    config, place = tiny(*settings), Place(open_store(address), tell)
    guide = card(config.guidance.name).digest
    words = perform(ENCODE, place, config, {"caption": "a red mushroom", "guide": guide})
    field = perform(OPTIMIZE, place, config, {"text_embedding": words.output("text_embedding.npy"), "guide": guide})
    tell({"event": "record", "cached": field.cached, "key": field.record.key, "outputs": [ref.to_json() for ref in field.record.outputs]})


if __name__ == "__main__":
    main(*sys.argv[1:])
