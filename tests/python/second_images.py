"""Image readers of the second renderer: PNG (8-bit RGB) and OpenEXR (scan lines, uncompressed or ZIP).

Written from the public specifications with zlib and numpy only, so that the second renderer shares no image code with
the program under test.
"""

import struct
import zlib

import numpy as np

PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
EXR_MAGIC = 20000630
# Scan lines per block, by the code of the compression attribute.
EXR_BLOCK_LINES = {0: 1, 2: 1, 3: 16}
EXR_PIXEL_TYPES = {0: "<u4", 1: "<f2", 2: "<f4"}


def png_chunks(data):
    """Yields (kind, content) of each chunk after checking the signature and the checksums."""
    assert data[:8] == PNG_SIGNATURE, "not a PNG"
    at = 8
    while at < len(data):
        length, kind = struct.unpack_from(">I4s", data, at)
        content = data[at + 8 : at + 8 + length]
        (crc,) = struct.unpack_from(">I", data, at + 8 + length)
        assert crc == zlib.crc32(kind + content), f"chunk {kind} is damaged"
        yield kind, content
        at += 12 + length


def unfiltered_row(kind, row, above, step):
    """Undoes the PNG filter of a row of bytes; `above` is the unfiltered previous row, `step` the bytes per pixel."""
    if kind == 0:
        return row
    if kind == 1:
        return np.cumsum(row.reshape(-1, step), axis=0, dtype=np.uint64).astype(np.uint8).reshape(-1)
    if kind == 2:
        return row + above
    out, up = bytearray(row.tobytes()), above.tobytes()
    for k in range(len(out)):
        a = out[k - step] if k >= step else 0
        b, c = up[k], up[k - step] if k >= step else 0
        if kind == 3:
            predicted = (a + b) // 2
        else:
            assert kind == 4, f"filter {kind}"
            pa, pb, pc = abs(b - c), abs(a - c), abs(a + b - 2 * c)
            predicted = a if pa <= pb and pa <= pc else (b if pb <= pc else c)
        out[k] = (out[k] + predicted) & 255
    return np.frombuffer(bytes(out), np.uint8)


def read_png(data):
    """Codes (height, width, 3), u8, of an 8-bit RGB PNG that is not interlaced."""
    chunks = list(png_chunks(data))
    width, height, depth, colour, _, _, interlace = struct.unpack(">IIBBBBB", dict(chunks)[b"IHDR"])
    assert (depth, colour, interlace) == (8, 2, 0), f"PNG of depth {depth}, colour type {colour}, interlace {interlace}"
    raw = zlib.decompress(b"".join(content for kind, content in chunks if kind == b"IDAT"))
    lines = np.frombuffer(raw, np.uint8).reshape(height, 1 + 3 * width)
    codes = np.zeros((height, 3 * width), np.uint8)
    above = np.zeros(3 * width, np.uint8)
    for j, line in enumerate(lines):
        above = codes[j] = unfiltered_row(line[0], line[1:], above, 3)
    return codes.reshape(height, width, 3)


def exr_text(data, at):
    """A zero-terminated string and the offset after it."""
    end = data.index(b"\0", at)
    return data[at:end].decode(), end + 1


def exr_header(data):
    """Attributes {name: bytes} of a single-part scan-line file, and the offset after the header."""
    magic, version = struct.unpack_from("<II", data)
    assert magic == EXR_MAGIC, "not an OpenEXR file"
    assert version & 0x1A00 == 0, "tiles, deep pixels or several parts"
    attributes, at = {}, 8
    while data[at]:
        name, at = exr_text(data, at)
        _, at = exr_text(data, at)
        (size,) = struct.unpack_from("<i", data, at)
        attributes[name] = data[at + 4 : at + 4 + size]
        at += 4 + size
    return attributes, at + 1


def exr_channels(content):
    """(name, dtype) of the channels, in file order."""
    channels, at = [], 0
    while content[at]:
        name, at = exr_text(content, at)
        kind, _, x_step, y_step = struct.unpack_from("<iB3xii", content, at)
        assert (x_step, y_step) == (1, 1), "subsampled channel"
        channels.append((name, np.dtype(EXR_PIXEL_TYPES[kind])))
        at += 16
    return channels


def exr_unzipped(block, size):
    """Decodes a ZIP block: inflates it, undoes the differences and interleaves the two halves."""
    if len(block) == size:
        return block
    packed = np.frombuffer(zlib.decompress(block), np.uint8).astype(np.uint64)
    packed[1:] += 128  # differences are stored with an offset of 128, modulo 256
    summed = np.cumsum(packed).astype(np.uint8)
    half = (size + 1) // 2
    out = np.empty(size, np.uint8)
    out[0::2], out[1::2] = summed[:half], summed[half:]
    return out.tobytes()


def read_exr(data):
    """Image (height, width, 3), f64, of the channels R, G, B."""
    attributes, at = exr_header(data)
    left, top, right, bottom = struct.unpack("<4i", attributes["dataWindow"])
    width, height = right - left + 1, bottom - top + 1
    channels = exr_channels(attributes["channels"])
    compression = attributes["compression"][0]
    assert compression in EXR_BLOCK_LINES, f"compression {compression}"
    step = EXR_BLOCK_LINES[compression]
    line_bytes = sum(kind.itemsize for _, kind in channels) * width
    planes = {name: np.zeros((height, width)) for name, _ in channels}
    for (offset,) in struct.iter_unpack("<Q", data[at : at + 8 * -(-height // step)]):
        line, size = struct.unpack_from("<ii", data, offset)
        line -= top
        count = min(step, height - line)
        block = exr_unzipped(data[offset + 8 : offset + 8 + size], count * line_bytes)
        place = 0
        for j in range(line, line + count):
            for name, kind in channels:
                planes[name][j] = np.frombuffer(block, kind, width, place)
                place += kind.itemsize * width
    return np.stack([planes[name] for name in "RGB"], axis=2)
