#!/usr/bin/env python3
"""Checks the second reader of `.ltgs` against the test vectors of the coder, and on files with layers.

    coder_vectors.py [CODER.json]    by default, samples/conformance/coder.json

Prints what is checked; exits with 1 if anything is wrong. Needs numpy, xxhash and zstandard. Takes about 15 s.
"""

import json
import os
import sys
from collections.abc import Iterator

import numpy as np

sys.dont_write_bytecode = True

from second_ltgs import D, S, Numbers, read_ltgs, xxh3

ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..")
CODER = os.path.join(ROOT, "samples", "conformance", "coder.json")
CORPUS = os.path.join(ROOT, "exporters", "tests", "corpus")
REFUSED = (
    "first_layer_missing",
    "layer_left_out",
    "layers_out_of_order",
    "short_chunk_within_a_layer",
    "huge_count_of_chunks",
    "cut_off_behind_a_layer",
)


def hashed(numbers: list[int], kind: str) -> str:
    return f"{xxh3(np.array(numbers, kind).tobytes()):016x}"


def generated(count: int) -> list[int]:
    """The numbers of a long stream, as the README of the pack defines them."""
    state, numbers = 1, []
    for i in range(count):
        state = (state * 6364136223846793005 + 1442695040888963407) % 2**64
        if i >= 2000:
            numbers.append(int(i == count - 1))
        elif i % 100 == 99:
            numbers.append((2**32 - 1 - i) // 2 ** (i // 100))
        else:
            numbers.append((state >> 40) % 2**16 // 2 ** (2 * (i % 7) + 2) + 5 * (i % 3))
    return numbers


def decoded(data: bytes, stream: dict) -> list[int]:
    contexts = stream["contexts"]
    reader, numbers = Numbers(data, 1 + len(contexts)), []
    for i in range(stream["count"]):
        own = (i % (7, 3)[k] if isinstance(c, str) else c[i] for k, c in enumerate(contexts))
        numbers.append(reader.next(*own))
    if numbers:
        reader.end()
    return numbers


def differs(data: bytes, stream: dict, numbers: list[int]) -> bool:
    """Whether damaged bytes are noticed or give other numbers."""
    try:
        return decoded(data, stream) != numbers
    except ValueError:
        return True


def check_coder(path: str = CODER) -> Iterator[str]:
    """Yields what is wrong with the vectors."""
    with open(path, encoding="utf-8") as file:
        vectors = json.load(file)
    for name, table, kind in (("S", S, "<u2"), ("D", D, "<i2")):
        if vectors["tables"][name] != hashed(table, kind):
            yield f"coder: table {name} differs"
    for stream in vectors["streams"]:
        name = f"{stream['name']}, {1 + len(stream['contexts'])} contexts"
        data = bytes.fromhex(stream["bytes"])
        numbers = stream.get("numbers") or generated(stream["count"])
        stated = stream["numbersXxh3"], stream["bytesXxh3"]
        if (hashed(numbers, "<u4"), f"{xxh3(data):016x}") != stated:
            yield f"coder: {name}: checksums differ"
        if decoded(data, stream) != numbers:
            yield f"coder: {name}: other numbers"
        if data and not differs(bytes([data[0] ^ 64]) + data[1:], stream, numbers):
            yield f"control: {name}: a changed byte was not noticed"
    print(f"coder: {len(vectors['streams'])} streams")


def check_layers() -> Iterator[str]:
    """Yields what is wrong with the files of the corpus that have layers."""
    scene, _ = read_ltgs(os.path.join(CORPUS, "layers.ltgs"))
    print(f"layers.ltgs: {len(scene.positions)} splats, the hash agrees")
    for name in REFUSED:
        try:
            read_ltgs(os.path.join(CORPUS, f"{name}.ltgs"))
            yield f"control: {name}.ltgs was read"
        except ValueError as error:
            print(f"control: {str(error).removeprefix(CORPUS + os.sep)}")


if __name__ == "__main__":
    problems = [*check_coder(*sys.argv[1:2]), *check_layers()]
    for problem in problems:
        print(f"WRONG: {problem}")
    sys.exit(1 if problems else 0)
