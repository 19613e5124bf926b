"""Photos at the size of training: averaged over the area of each pixel, as litetex does."""
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
    image = numpy.asarray(Image.open(path).convert("RGB"), dtype=numpy.float64)
    rows, columns = weights(image.shape[0], height), weights(image.shape[1], width)
    means = numpy.einsum("yr,rxc->yxc", rows, numpy.einsum("rsc,xs->rxc", image, columns))
    return Image.fromarray(numpy.clip(numpy.round(means), 0, 255).astype(numpy.uint8))


def write_like(photos, renders, targets):
    """Writes the photo of each render, at its size and under its name, unless it is there."""
    targets.mkdir(parents=True, exist_ok=True)
    for render in sorted(renders.glob("*.png")):
        target = targets / render.name
        if not target.exists():
            photo = next(path for path in sorted(photos.iterdir()) if path.stem == render.stem)
            reduced(photo, *Image.open(render).size).save(target)
