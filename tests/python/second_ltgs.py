#!/usr/bin/env python3
"""A second reader of `.ltgs` files, written from their specification alone.

It shares no code with the program. Its only sources are `exporters/schema/ltgs.md`, whose sections comments cite, and
`ltgs-words.txt` beside it. It checks all lengths and checksums of a file and the hash of the decoded arrays, and raises
ValueError if anything is wrong.

    second_ltgs.py FILE.ltgs...    checks files

Needs numpy, xxhash and zstandard. Decodes about 1,200 splats a second.
"""

import json
import math
import os
import struct
import sys
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import xxhash
import zstandard

HEADER = "<4sHHIIQBBHIIIQQQ"
ENTRY = np.dtype([("blocks", "<u8", (3, 3)), ("texels", "<u8"), ("splats", "<u4"), ("layer", "<u4"), ("box", "<f4", (2, 3))])
QUALITIES = ("lossless", "balanced", "tiny", "custom")
CHUNK, MAX_SIDE = 4096, 4096
LN_2 = 0.6931471805599453
Y_00 = 0.28209479177387814
WORDS = os.path.join(os.path.dirname(__file__), "..", "..", "exporters", "schema", "ltgs-words.txt")
F32_MIN, F32_MAX = 1.1754944e-38, 3.4028235e38

# What damaged bytes can raise.
DAMAGE = (ValueError, LookupError, TypeError, ArithmeticError, RecursionError, struct.error, zstandard.ZstdError)

xxh3 = xxhash.xxh3_64_intdigest


def check(holds: bool, what: str, found: object, expected: object) -> None:
    if not holds:
        raise ValueError(f"{what}: found {found}, expected {expected}")


def unpacked(data: bytes, count: int, words: bytes | None = None) -> bytes:
    """The `count` bytes in one zstd frame. `words`: the content of its dictionary."""
    words = None if words is None else zstandard.ZstdCompressionDict(words, dict_type=zstandard.DICT_TYPE_RAWCONTENT)
    return zstandard.ZstdDecompressor(words).decompress(data, max_output_size=count, allow_extra_data=False)


# -------------------------------------------------------------------------------------------------- streams: section 2

Q = [11, 18, 30, 49, 81, 133, 219, 360, 589, 961, 1554, 2486, 3906, 5978, 8813, 12371, 16384, 20397, 23955]
Q += [26790, 28862, 30282, 31214, 31807, 32179, 32408, 32549, 32635, 32687, 32719, 32738, 32750, 32757]
ODDS = range(-2047, 2048)
# S(d) at d + 2047, D(z) at floor(z / 8), and p at d + 2047 (rules 1 to 3).
S = [(Q[d // 128 + 16] * (128 - d % 128) + Q[d // 128 + 17] * (d % 128) + 64) // 128 for d in ODDS]
D = [next((d for d in ODDS if S[d + 2047] >= 8 * z + 4), 2047) for z in range(4096)]
P = [min(max(s, 32), 32736) for s in S]
RATES = [min(6, (c + 2).bit_length() - 1) for c in range(256)]
NODES = 33 + 3 * 32


class Numbers:
    """Reads the numbers of a stream with codec 2."""

    def __init__(self, data: bytes, contexts: int) -> None:
        self.data, self.taken, self.lengths = data, 4, (0, 0)
        self.range, self.code = 2**32 - 1, int.from_bytes(data[:4].ljust(4, b"\0"))
        # For each context and value of it: z and c of all nodes.
        self.tables = [defaultdict(lambda: ([16384] * NODES, [0] * NODES)) for _ in range(contexts)]
        self.weights = [[65536 // contexts] * contexts for _ in range(34)]

    def bit(self, p: int) -> int:
        """Reads a bit whose probability to be 0 is p / 2^15."""
        bound = (self.range >> 15) * p
        bit = int(self.code >= bound)
        self.code, self.range = (self.code - bound, self.range - bound) if bit else (self.code, bound)
        while self.range < 1 << 24:
            byte = self.data[self.taken] if self.taken < len(self.data) else 0
            self.range, self.code = self.range << 8, (self.code << 8 | byte) & 0xFFFFFFFF
            self.taken += 1
        return bit

    def adaptive_bit(self, node: int, states: list) -> int:
        """Reads the bit of a node and learns from it (rules 3 and 4)."""
        if len(states) == 1:
            bit = self.bit(states[0][0][node])
        else:
            weights, odds = self.weights[min(node, 33)], [D[z[node] >> 3] for z, _ in states]
            d = sum([w * o for w, o in zip(weights, odds)]) >> 16
            p = P[min(max(d, -2047), 2047) + 2047]
            bit = self.bit(p)
            error = -p if bit else 32768 - p
            weights[:] = [min(max(w + (o * error >> 13), -(1 << 20)), 1 << 20) for w, o in zip(weights, odds)]
        for z, counts in states:
            rate = RATES[counts[node]]
            learnt = z[node] - (z[node] >> rate) if bit else z[node] + (32768 - z[node] >> rate)
            z[node] = min(max(learnt, 32), 32736)
            counts[node] = min(counts[node] + 1, 255)
        return bit

    def next(self, *contexts: int) -> int:
        """Reads a number; its first context follows from the two numbers before it."""
        contexts = (min(11, sum(self.lengths)), *contexts)
        states = [table[value] for table, value in zip(self.tables, contexts, strict=True)]
        length = 0
        while length < 32 and self.adaptive_bit(length, states):
            length += 1
        self.lengths = (self.lengths[1], length)
        value, node = 1, 30 + 3 * length
        for k in range(length):
            bit = self.adaptive_bit(node, states) if k < 2 else self.bit(16384)
            value, node = 2 * value + bit, node + 1 + bit
        check(value <= 2**32, "number", value - 1, "at most 32 bits")
        return value - 1

    def end(self) -> None:
        """Checks that the stream is spent."""
        rest = len(self.data) + 4 - self.taken
        check(0 <= rest <= 4, "coded bytes behind those taken", rest, "0 to 4")
        check(rest == 0 or self.data[-1] != 0, "last coded byte", 0, "another")


def signed(number: int) -> int:
    return -(number + 1 >> 1) if number & 1 else number >> 1


def bits_of(number: int) -> int:
    """len of section 4.3."""
    return (number + 1).bit_length() - 1


class Block:
    """The streams of a block, one after the other."""

    def __init__(self, data: bytes) -> None:
        self.data, self.at = data, 0

    def take(self, count: int) -> bytes:
        check(count <= len(self.data) - self.at, "bytes left in a block", len(self.data) - self.at, count)
        self.at += count
        return self.data[self.at - count : self.at]

    def varint(self) -> int:
        value, shift, byte = 0, 0, 128
        while byte >= 128 and shift < 70:
            (byte,) = self.take(1)
            value, shift = value | (byte & 127) << shift, shift + 7
        check(byte < 128 and value < 2**64, "varint", value, "at most 64 bits")
        return value

    def stream(self, codecs: Sequence[int], counts: Sequence[int]) -> tuple[int, int, bytes]:
        """Codec, number of values and coded bytes of the next stream."""
        (codec,) = self.take(1)
        check(codec in codecs, "codec", codec, codecs)
        count, size = self.varint(), self.varint()
        check(count in counts, "values of a stream", count, counts)
        check(count > 0 or size == 0, "coded bytes without values", size, 0)
        return codec, count, self.take(size)

    def bytes(self, count: int) -> bytes:
        codec, _, data = self.stream((0, 1), (count,))
        data = unpacked(data, count) if codec == 1 and count > 0 else data
        check(len(data) == count, "bytes of a stream", len(data), count)
        return data

    def numbers(
        self, count: int, *contexts: Iterable[int], absent: int | None = None, into: list[int] | None = None
    ) -> list[int]:
        """Numbers, or none for `count` times `absent`. They fill `into`, where contexts find those read before."""
        _, found, data = self.stream((2,), (count,) if absent is None else (count, 0))
        if found == 0:
            return [absent] * count
        values, numbers = [] if into is None else into, Numbers(data, 1 + len(contexts))
        for *own, _ in zip(*contexts, range(count), strict=True):
            values.append(numbers.next(*own))
        numbers.end()
        return values

    def signed(self, count: int, *contexts: Iterable[int], absent: int | None = None) -> list[int]:
        return [signed(u) for u in self.numbers(count, *contexts, absent=absent)]

    def planes(self, count: int, components: int, kind: str = "<f4") -> np.ndarray:
        """(count, components) from planes of bytes (section 3)."""
        size = np.dtype(kind).itemsize
        planes = np.frombuffer(b"".join(self.bytes(components * count) for _ in range(size)), np.uint8)
        by_value = planes.reshape(size, components, count).transpose(2, 1, 0)
        return np.ascontiguousarray(by_value).view(kind)[..., 0]


# ------------------------------------------------------------------------------------- lossless files: sections 2 and 3


@dataclass
class Splats:
    """Decoded arrays, one row per splat, in the local frame (y down)."""

    positions: np.ndarray  # (n, 3)
    rotations: np.ndarray  # (n, 4), wxyz
    sigmas: np.ndarray  # (n, 2), along u and v
    opacities: np.ndarray  # (n,)
    sh: np.ndarray  # (n, (largest degree + 1)^2, 3)
    sides: np.ndarray  # (n, 2), rows and columns; 0 without a map
    texel_sizes: np.ndarray  # (n, 2), along u and v
    shifts: np.ndarray  # (n, 2), half texels along u and v
    degrees: np.ndarray  # (n,)
    texels: np.ndarray  # (texels, 3), map by map, row by row


def checked_sides(rows: Sequence[int], columns: Sequence[int]) -> np.ndarray:
    sides = np.stack([rows, columns], axis=1).astype(np.int64)
    check(((sides[:, 0] > 0) == (sides[:, 1] > 0)).all(), "maps with one side of 0", "some", "none")
    check(0 <= sides.min() and sides.max() <= MAX_SIDE, "sides of a map", (sides.min(), sides.max()), "0 to 4096")
    return sides


def read_shifts(block: Block, sides: np.ndarray, *contexts: tuple) -> np.ndarray:
    textured = sides[:, 0] > 0
    shifts = np.zeros(sides.shape, np.int64)
    for axis in range(2):
        shifts[textured, axis] = block.signed(int(textured.sum()), *(c[axis] for c in contexts), absent=0)
    check(-(2**15) <= shifts.min() and shifts.max() < 2**15, "shifts", (shifts.min(), shifts.max()), "16 bits")
    return shifts


class Lossless:
    """Reads the blocks of a lossless chunk."""

    def __init__(self, degree: int) -> None:
        self.degree = degree

    def geometry(self, block: Block, count: int) -> Splats:
        sides = checked_sides(*(block.planes(count, 1, "<u2")[:, 0] for _ in range(2)))
        size_u, crossed = (block.planes(count, 1, "<u4") for _ in range(2))
        sizes = np.concatenate([size_u, size_u ^ crossed], axis=1).view("<f4")
        shifts = read_shifts(block, sides)
        sh = np.zeros((count, (self.degree + 1) ** 2, 3), np.float32)
        positions, rotations, sigmas, opacities, sh[:, 0] = (block.planes(count, k) for k in (3, 4, 2, 1, 3))
        for _ in range(3):
            block.signed(count)  # means of maps, for viewers without texels
        degrees = np.zeros(count, np.int64)
        return Splats(positions, rotations, sigmas, opacities[:, 0], sh, sides, sizes, shifts, degrees, None)

    def sh(self, block: Block, splats: Splats) -> None:
        splats.degrees = self.read_degrees(block, len(splats.sh))
        for l in range(1, self.degree + 1):
            own = splats.degrees >= l
            values = block.planes(int(own.sum()), 3 * (2 * l + 1))
            splats.sh[own, l * l : (l + 1) ** 2] = values.reshape(-1, 2 * l + 1, 3)

    def read_degrees(self, block: Block, count: int, *contexts: Sequence[int]) -> np.ndarray:
        degrees = np.array(block.numbers(count, *contexts, absent=self.degree))
        check(degrees.max() <= self.degree, "SH degree", degrees.max(), f"at most {self.degree}")
        return degrees

    def texels(self, block: Block, splats: Splats, count: int) -> None:
        splats.texels = block.planes(count, 3)


# ----------------------------------------------------------------------------------------------- other files: section 4


def flog2(x: float) -> int:
    return math.frexp(x)[1] - 1


def exp2(x: np.ndarray) -> np.ndarray:
    x = np.clip(x, -1000, 1000)
    w = np.floor(x + 0.5)
    y, s = (x - w) * LN_2, np.ones_like(x)
    for n in range(15, 0, -1):
        s = 1 + s * y / n
    return np.ldexp(s, w.astype(np.int64))


def log256(x: float) -> int:
    y, f = x / 2.0 ** flog2(x), 0
    for _ in range(8):
        y, f = y * y, 2 * f
        y, f = (y / 2, f + 1) if y >= 2 else (y, f)
    return 256 * flog2(x) + f


def nearest(y: float) -> int:
    """R of section 4.1."""
    return min(max(math.floor(y + 0.5), -(2**30)), 2**30)


def wrapped(code: int) -> int:
    """A code modulo 2^32, as a signed number (section 4.1)."""
    return (code + 2**31) % 2**32 - 2**31


def as_f32(x: np.ndarray, high: float = F32_MAX) -> np.ndarray:
    return np.clip(x.astype(np.float32), np.float32(F32_MIN), np.float32(high))


def rgb(channels: np.ndarray) -> np.ndarray:
    """RGB of luma, green and red, along the last axis (section 4.1)."""
    luma, green, red = np.moveaxis(channels, -1, 0)
    o = luma - 0.5 * green
    return np.stack([o + 0.5 * red, luma + 0.5 * green, o - 0.5 * red], axis=-1)


def summed(terms: np.ndarray) -> np.ndarray:
    """Sum over the first axis, from 0, one term after the other: `cumsum` adds them so, no `sum` does."""
    return 0.0 + np.cumsum(terms, axis=0)[-1]


def mean_of_map(texels: np.ndarray, du: np.ndarray, dv: np.ndarray, area: float) -> np.ndarray:
    """Section 4.2. `area`: 2 pi sigma_u sigma_v / (k_u k_v)."""
    along_u, along_v = (exp2(-0.5 * d * d / LN_2) for d in (du, dv))
    weights = (along_u[:, None] * along_v).reshape(-1, 1)
    total = max(summed(weights)[0], area)
    return summed(weights * texels) / total if 0 < total < math.inf else np.zeros(3)


class Rounded(Lossless):
    """Reads the blocks of a balanced, tiny or custom chunk."""

    def __init__(self, degree: int, steps: dict, grid: dict) -> None:
        names = ("position", "tilt", "twist", "log2Scale", "log2Opacity", "sh0", "texel", "chroma", "log2TexelSize")
        for step in [steps[name] for name in names] + steps["shRest"]:
            check(2**-30 <= step <= 16, "step", step, "2^-30 to 16")
        check(len(steps["shRest"]) == 3 and len(grid["origin"]) == 3, "`shRest`, `origin`", "others", "3 numbers each")
        bits, cell_bits = grid["bits"], grid["cellBits"]
        check(bits <= 31 and 0 <= cell_bits <= bits <= cell_bits + 21, "grid", (bits, cell_bits), "section 4")
        check(0 < grid["reach"] < math.inf, "reach", grid["reach"], "a positive number")
        self.degree, self.steps, self.grid = degree, steps, grid

    def geometry(self, block: Block, count: int) -> Splats:
        """Section 4.1; streams 1, 13 and 14 here."""
        self.exponents = block.signed(count)
        check(-8 <= min(self.exponents) and max(self.exponents) <= 8, "exponents", set(self.exponents), "-8 to 8")
        self.x, self.scale = [8 + x for x in self.exponents], np.ldexp(1.0, self.exponents)
        self.sides = self.read_sides(block, count)
        logs_u, self.sigmas = self.read_sigmas(block, count)
        sizes, shifts = self.read_maps(block)
        rotations, positions = self.read_rotations(block, count), self.read_positions(block, count)
        contexts = [40 * x + 20 + min(max(math.floor(log), -20), 19) for x, log in zip(self.x, logs_u)]
        codes = np.array(block.numbers(count, contexts))
        opacities = as_f32(exp2(-(codes * np.minimum(self.steps["log2Opacity"] * self.scale, 1))), 1)
        sh = np.zeros((count, (self.degree + 1) ** 2, 3), np.float32)
        sh[:, 0] = self.read_sh_0(block, count)
        degrees = np.zeros(count, np.int64)
        return Splats(positions, rotations, self.sigmas, opacities, sh, self.sides, sizes, shifts, degrees, None)

    def read_sides(self, block: Block, count: int) -> np.ndarray:
        """Streams 2 and 3."""
        rows = np.array(block.numbers(count, self.x))
        columns, textured = rows.copy(), rows > 0
        less = block.signed(int(textured.sum()), np.minimum(rows[textured], 12).tolist())
        columns[textured] = [wrapped(r + d) for r, d in zip(rows[textured].tolist(), less)]
        self.r_c = (np.clip(rows, 0, 6) * 7 + np.clip(columns, 0, 6)).tolist()
        return checked_sides(rows, columns)

    def read_sigmas(self, block: Block, count: int) -> tuple[list[float], np.ndarray]:
        """Streams 4 and 5: code * s along u, and standard deviations."""
        steps = np.minimum(self.steps["log2Scale"] * self.scale, 1).tolist()
        rests, less = block.signed(count, self.x), block.numbers(count, self.x, self.r_c)
        logs_u, logs_v = [], []
        for rest, difference, step in zip(rests, less, steps):
            before = np.array(logs_u[-8:])
            code = wrapped(rest + nearest(summed(before) / len(before) / step) if len(before) > 0 else rest)
            logs_u.append(code * step)
            logs_v.append(wrapped(code - difference) * step)
        self.logs = self.grid["log2Scale"] + np.array([logs_u, logs_v])
        return logs_u, as_f32(exp2(self.logs.T), 1e6)

    def read_maps(self, block: Block) -> tuple[np.ndarray, np.ndarray]:
        """Stream 6: texel sizes and shifts."""
        textured = self.sides[:, 0] > 0
        sides, count, r_c = self.sides[textured], int(textured.sum()), np.array(self.r_c)[textured].tolist()
        m, p = np.array(block.signed(count, r_c)), np.array(block.signed(count, r_c, absent=0))
        q = np.array(block.signed(count, absent=0))
        shifts = read_shifts(block, self.sides, np.minimum(sides, 12).T.tolist())
        areas = np.array([log256(r * c) / 256 for r, c in sides.tolist()])
        step = np.array([self.steps["log2TexelSize"] * 2.0 ** -flog2(max(own)) for own in sides.tolist()])
        e = 0.5 * (self.logs[0, textured] + self.logs[1, textured] - areas) + self.grid["log2TexelSize"]
        h, g = 0.5 * (p + q * step), e + m * step
        sizes = np.zeros(self.sides.shape, np.float32)
        sizes[textured] = as_f32(exp2(np.stack([g - h, g + h], axis=1)))
        return sizes, shifts

    def read_rotations(self, block: Block, count: int) -> np.ndarray:
        """Streams 7 to 9."""
        sigma_u, sigma_v = self.sigmas.astype(np.float64).T
        least = np.where(self.sides[:, 0] > 0, 0.375, 0.0625)
        anisotropy = np.clip(np.abs(sigma_u / sigma_v - sigma_v / sigma_u), least, 4096)
        swing = np.minimum(self.steps["tilt"] * self.scale, 0.25)
        twist = np.minimum(self.steps["twist"] * self.scale / anisotropy, 0.25)
        p, q = (np.array(block.signed(count, self.x)) * swing for _ in range(2))
        contexts = [min(max(-log256(step) // 64, 0), 127) for step in twist.tolist()]
        s = np.clip(np.array(block.signed(count, contexts)) * twist, -1, 1)
        length = np.sqrt(np.maximum(p * p + q * q, 1))
        p, q = p / length, q / length
        w, c = np.sqrt(np.maximum(1 - (p * p + q * q), 0)), np.sqrt(np.maximum(1 - s * s, 0))
        return np.stack([w * c, p * c + q * s, q * c - p * s, w * s], axis=1).astype(np.float32)

    def read_positions(self, block: Block, count: int) -> np.ndarray:
        """Streams 10 to 12."""
        high, low = block.numbers(count), block.numbers(count, self.x)
        cell_bits, reach = self.grid["cellBits"], self.grid["reach"]
        sizes = np.sqrt(self.sigmas.astype(np.float64).prod(axis=1)) / reach
        lacks = [min(max(flog2(s) + x, 0), cell_bits) for s, x in zip(sizes.tolist(), self.exponents)]
        place_bits = 3 * sum(cell_bits - b for b in lacks)
        places, morton, corners = int.from_bytes(block.bytes(-(-place_bits // 8)), "little"), 0, []
        for upper, lower, b in zip(high, low, lacks):
            morton += upper * 2**31 + lower
            for axis in range(3):
                cell = sum((morton >> 3 * k + axis & 1) << k for k in range(21))
                corners.append((cell << cell_bits) + ((places & (1 << cell_bits - b) - 1) << b))
                places >>= cell_bits - b
        check(places == 0, "last bits of the places", places, 0)
        check(morton < 8 ** (self.grid["bits"] - cell_bits), "last cell", morton, "one of the grid")
        self.corners = np.array(corners, np.float64).reshape(count, 3)
        centres = (self.corners + 0.5 * np.ldexp(1.0, lacks)[:, None]) * (self.steps["position"] * reach)
        return (np.array(self.grid["origin"]) + centres).astype(np.float32)

    def read_sh_0(self, block: Block, count: int) -> np.ndarray:
        """Stream 14: degree 0 with the means of the maps."""
        luma = block.numbers(count, self.x)
        by_luma = [33 * x + bits_of(u) for x, u in zip(self.x, luma)]
        green = block.numbers(count, by_luma, self.x)
        red = block.numbers(count, by_luma, [33 * x + bits_of(u) for x, u in zip(self.x, green)])
        codes = np.zeros((count, 3))
        for k, rests in enumerate(zip(luma, green, red)):
            codes[k] = [wrapped(signed(u) + p) for u, p in zip(rests, self.predicted_sh_0(k, codes))]
        return self.colours(codes, self.steps["sh0"] * self.scale)

    def predicted_sh_0(self, k: int, codes: np.ndarray) -> list[int]:
        if k == 0:
            return [0, 0, 0]
        before = slice(max(k - 32, 0), k)
        x, y, z = (self.corners[before] - self.corners[k]).T
        distance = x * x + y * y + z * z
        weights = 1 / ((distance + 1) * (distance + 1))
        sums = summed((weights * self.scale[before])[:, None] * codes[before])
        return [nearest(v) for v in (sums / summed(weights) / self.scale[k]).tolist()]

    def colours(self, codes: np.ndarray, step: np.ndarray) -> np.ndarray:
        """RGB as f32 from codes (n, 3) of luma, green and red; `step`: that of luma."""
        return rgb(codes * self.steps_of_channels(step)).astype(np.float32)

    def steps_of_channels(self, step: np.ndarray) -> np.ndarray:
        chroma = step * self.steps["chroma"]
        return np.stack([step, chroma, chroma], axis=-1)

    def sh(self, block: Block, splats: Splats) -> None:
        count = len(splats.sh)
        splats.degrees = self.read_degrees(block, count, self.x)
        sums = [[0] * count for _ in range(3)]
        for l in range(1, self.degree + 1):
            own = np.nonzero(splats.degrees >= l)[0]
            places = [(k, i) for k in range(l * l, (l + 1) ** 2) for i in own.tolist()]
            codes, known = [], [0] * len(places)
            for ch in range(3):
                numbers = []
                block.numbers(len(places), self.sh_contexts(places, sums[ch], numbers), known, into=numbers)
                known = [y_g + (10, 1, 0)[ch] * min(bits_of(u), 9) for y_g, u in zip(known, numbers)]
                codes.append([signed(u) for u in numbers])
            steps = np.tile(self.steps["shRest"][l - 1] * self.scale[own], 2 * l + 1)
            values = self.colours(np.array(codes, np.float64).T, steps).reshape(2 * l + 1, len(own), 3)
            splats.sh[own, l * l : (l + 1) ** 2] = values.transpose(1, 0, 2)

    def sh_contexts(self, places: list, sums: list[int], numbers: list[int]) -> Iterator[int]:
        """Second contexts of a channel. `places`: coefficient k and splat of each number; `sums`: t of each splat."""
        for at, (k, i) in enumerate(places):
            yield 20 * self.x[i] + (min(19, 2 * sums[i] // (k - 1)) if k > 1 else 0)
            sums[i] += bits_of(numbers[at])

    def texels(self, block: Block, splats: Splats, count: int) -> None:
        """Section 4.2."""
        maps, places = [], []
        for k in np.nonzero(self.sides[:, 0])[0].tolist():
            sizes, shifts, sigmas = (a[k].tolist() for a in (splats.texel_sizes, splats.shifts, self.sigmas))
            sides = rows, columns = self.sides[k].tolist()
            centres = [0.5 * (side - 1 - shift) for side, shift in zip(sides, shifts)]
            du, dv = ((np.arange(side) - c) * k / s for side, c, k, s in zip(sides, centres, sizes, sigmas))
            squares = (du * du)[:, None] + dv * dv
            falloffs = sum((j * LN_2 < squares).astype(np.int64) for j in (1, 3, 5, 7))
            exponents = np.clip(self.exponents[k] + falloffs, -16, 16)
            maps.append((k, exponents, du, dv, 2 * math.pi * sigmas[0] * sigmas[1] / (sizes[0] * sizes[1])))
            backs = [(3 * (j > 0), 3 * columns * (i > 0)) for i in range(rows) for j in range(columns)]
            places += zip(exponents.reshape(-1).tolist(), backs)
        numbers = []
        contexts = around_contexts(places, numbers), channel_contexts(places, numbers)
        block.numbers(3 * count, *contexts, into=numbers)
        codes = np.array([signed(u) for u in numbers], np.float64).reshape(-1, 3)
        splats.texels = np.zeros((count, 3), np.float32)
        at = 0
        for k, exponents, du, dv, area in maps:
            own = slice(at, at + exponents.size)
            splats.texels[own] = self.texels_of_map(exponents, codes[own])
            mean = mean_of_map(splats.texels[own], du, dv, area)
            splats.sh[k, 0] = splats.sh[k, 0].astype(np.float64) - mean / Y_00
            at = own.stop

    def texels_of_map(self, exponents: np.ndarray, codes: np.ndarray) -> np.ndarray:
        rows, columns = exponents.shape
        rests = codes.reshape(rows, columns, 3) * self.steps_of_channels(np.ldexp(self.steps["texel"], exponents))
        # Channels with zeros above and to the left.
        values = np.zeros((rows + 1, columns + 1, 3))
        for i in range(rows):
            for j in range(columns):
                values[i + 1, j + 1] = 0.35 * (values[i + 1, j] + values[i, j + 1]) + rests[i, j]
        return rgb(values[1:, 1:]).clip(-1, 1).astype(np.float32).reshape(-1, 3)


def around_contexts(places: list, numbers: list[int]) -> Iterator[int]:
    """Second contexts of texels. `places`: t, and how far back the numbers left and above are (0: outside the map)."""
    for texel, (t, backs) in enumerate(places):
        for at in range(3 * texel, 3 * texel + 3):
            a = sum(min(abs(signed(numbers[at - back])), 65536) for back in backs if back > 0)
            yield 400 * (at % 3) + 20 * min(max(t + 8, 0), 19) + min(bits_of(a), 19)


def channel_contexts(places: list, numbers: list[int]) -> Iterator[int]:
    """Third contexts of texels."""
    for t, _ in places:
        context = 300 * min(max(t, 0), 3)
        yield context
        context += 10 * min(bits_of(numbers[-1]), 9)
        yield 100 + context
        context += min(bits_of(numbers[-1]), 9)
        yield 200 + context


# ------------------------------------------------------------------------------------------------------ file: section 1


def check_layers(counts: list[int], layers: list[int], lossless: bool) -> None:
    """The rules of section 1.3 for layers and the splats of their chunks."""
    follows = [layer - before for before, layer in zip([0, *layers], layers)]
    check(set(follows) <= {0, 1} and sum(follows[:1]) == 0, "layers of the chunks", layers, "0, then the same or the next")
    check(not lossless or set(layers) <= {0}, "layers of a lossless file", layers, 0)
    for k, (count, layer) in enumerate(zip(counts, layers)):
        fewest = CHUNK if layers[k + 1 : k + 2] == [layer] else 1
        check(fewest <= count <= CHUNK, f"splats of chunk {k}", count, f"{fewest} to {CHUNK}")


def read_entries(data: bytes, start: int, chunks: int, totals: tuple, lossless: bool) -> tuple[np.ndarray, list]:
    """Entries of the table of contents and (offset, bytes, checksum) of their blocks (section 1.3).

    `totals`: splats and texels of the header."""
    entries = np.frombuffer(data, ENTRY, chunks, start)
    found = tuple(sum(entries[name].tolist()) for name in ("splats", "texels"))
    check(found == totals, "splats and texels of the chunks", found, totals)
    layers = entries["layer"].tolist()
    check_layers(entries["splats"].tolist(), layers, lossless)
    blocks, end = entries["blocks"].tolist(), start + entries.nbytes
    # By layer, then by kind, then by chunk.
    places = sorted((layer, kind, k) for k, layer in enumerate(layers) for kind in range(3))
    for offset, size, checksum in [blocks[k][kind] for _, kind, k in places]:
        check(end <= offset <= offset + size <= len(data), "block", (offset, size), f"{end} to {len(data)}")
        end, found = offset + size, xxh3(data[offset : offset + size])
        check(found == checksum, "checksum of a block", found, checksum)
    return entries, blocks


def read_chunk(data: bytes, entry: np.void, spans: list, reader: Lossless) -> Splats:
    geometry, sh, texels = blocks = [Block(data[offset : offset + size]) for offset, size, _ in spans]
    splats = reader.geometry(geometry, int(entry["splats"]))
    box = np.stack([splats.positions.min(axis=0), splats.positions.max(axis=0)])
    check((box == entry["box"]).all(), "box of a chunk", box, entry["box"])
    if reader.degree > 0:
        reader.sh(sh, splats)
    area = int(splats.sides.prod(axis=1).sum())
    check(area == entry["texels"], "rows times columns of the maps", area, entry["texels"])
    reader.texels(texels, splats, area)
    for block in blocks:
        check(block.at == len(block.data), "bytes of streams in a block", block.at, len(block.data))
    return splats


def joined(chunks: list[Splats], degree: int) -> Splats:
    shapes = [(3,), (4,), (2,), (), ((degree + 1) ** 2, 3), (2,), (2,), (2,), (), (3,)]
    none = Splats(*(np.zeros((0, *shape), np.float32) for shape in shapes))
    kinds = dict(sides="<u2", shifts="<i2", degrees="u1")
    arrays = {name: np.concatenate([getattr(c, name) for c in chunks or [none]]) for name in vars(none)}
    return Splats(**{name: array.astype(kinds.get(name, "<f4")) for name, array in arrays.items()})


def content_hash(splats: Splats, meta: dict) -> str:
    """`hash` of section 1.2."""
    s, count = splats, len(splats.positions)
    hasher = xxhash.xxh3_64(struct.pack("<IIf", count, ("none", "ewa").index(meta["filter"]), meta["near"]))
    own = np.arange(s.sh.shape[1]) < (s.degrees[:, None].astype(np.int64) + 1) ** 2
    maps = np.zeros(count, [("sides", "<u2", 2), ("sizes", "<f4", 2), ("shifts", "<i2", 2)])
    maps["sides"], maps["sizes"], maps["shifts"] = s.sides, s.texel_sizes, s.shifts
    for part in (s.positions, s.rotations, s.sigmas, s.opacities, s.degrees, s.sh[own], maps, s.texels):
        hasher.update(part.tobytes())
    return hasher.hexdigest()


def rotation_rows(rotation: list[float]) -> list[list[float]]:
    """The rows of the matrix of a quaternion wxyz (section 1.2)."""
    w, x, y, z = np.array(rotation) / np.linalg.norm(rotation)
    return [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]


def read_about(data: bytes, count: int) -> dict:
    """The metadata, with the rotations of all cameras as `rotationRows`."""
    with open(WORDS, "rb") as file:
        text = unpacked(data, count, file.read())
    check(len(text) == count, "bytes of the metadata", len(text), count)
    about = json.loads(text.decode())
    for camera in about["meta"]["cameras"]:
        if "rotation" in camera:
            camera["rotationRows"] = rotation_rows(camera.pop("rotation"))
    return about


def decoded(data: bytes) -> tuple[Splats, dict]:
    check(data[:6] == b"LTGS\3\0", "magic and major version", data[:6], b"LTGS\3\0")
    _, _, _, flags, splats, texels, degree, profile, _, meta_bytes, text_bytes, chunks, size, tables, own = (
        struct.unpack_from(HEADER, data)
    )
    check(own == xxh3(data[:56]), "checksum of the header", xxh3(data[:56]), own)
    start, counts = 64 + meta_bytes, (flags, splats, texels, degree, profile, text_bytes, chunks)
    most = (0, 2**24, 2**32 - 1, 3, len(QUALITIES) - 1, 2**24, splats)
    enough = chunks >= -(-splats // CHUNK)
    check(enough and all(c <= m for c, m in zip(counts, most)), "numbers of the header", counts, most)
    check(size == len(data), "bytes of the file", len(data), size)
    found = xxh3(data[64 : start + ENTRY.itemsize * chunks])
    check(found == tables, "checksum of the tables", found, tables)
    about, quality = read_about(data[64:start], text_bytes), QUALITIES[profile]
    label, labels = (about["quality"], about["order"]), (quality, "morton" if profile > 0 else "given")
    check(label == labels, "quality and order", label, labels)
    quantiser = about["quantiser"] if profile > 0 else None
    reader = Rounded(degree, quantiser["steps"], quantiser["grid"]) if quantiser else Lossless(degree)
    entries, blocks = read_entries(data, start, chunks, (splats, texels), quantiser is None)
    scene = joined([read_chunk(data, entry, spans, reader) for entry, spans in zip(entries, blocks)], degree)
    check(scene.degrees.max(initial=0) == degree, "largest SH degree", scene.degrees.max(initial=0), degree)
    found = content_hash(scene, about["meta"])
    check(found == about["hash"], "hash", found, about["hash"])
    return scene, about["meta"]


def read_ltgs(path: str) -> tuple[Splats, dict]:
    """The splats and `meta` of a file; ValueError with what was found and expected if anything is wrong."""
    with open(path, "rb") as file:
        data = file.read()
    try:
        with np.errstate(all="ignore"):
            return decoded(data)
    except DAMAGE as error:
        raise ValueError(f"{path}: {error}") from error


if __name__ == "__main__":
    for name in sys.argv[1:]:
        found, _ = read_ltgs(name)
        print(f"{name}: {len(found.positions)} splats, {len(found.texels)} texels, the hash agrees")
