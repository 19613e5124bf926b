"""Photos as litetex sees them: over black where they are transparent, and averaged over the area of each pixel."""
import numpy
from PIL import Image


def weights(size, target):
    """Share of each source pixel in each target pixel, along one axis."""
    edges = numpy.arange(target + 1) * (size / target)
    cells = numpy.arange(size)
    overlap = numpy.minimum(edges[1:, None], cells + 1) - numpy.maximum(edges[:-1, None], cells)
    return numpy.clip(overlap, 0, None) * (target / size)


def reduced(path, width, height):
    """A photo in 8 bits at this size."""
    pixels = numpy.asarray(Image.open(path).convert("RGBA"), dtype=numpy.float64)
    image = pixels[..., :3] * (pixels[..., 3:] / 255)
    rows, columns = weights(image.shape[0], height), weights(image.shape[1], width)
    means = numpy.einsum("yr,rsc,xs->yxc", rows, image, columns, optimize=True)
    return Image.fromarray(numpy.clip(numpy.round(means), 0, 255).astype(numpy.uint8))


def write_like(photos, renders, targets):
    """Writes each photo, given by the name of its render, at the size of that render, unless it is there."""
    for name, photo in photos.items():
        target = targets / name
        if not target.exists():
            target.parent.mkdir(parents=True, exist_ok=True)
            reduced(photo, *Image.open(renders / name).size).save(target)
