"""What a printer would make of a PDF: its pages as pixels, and the words on them."""

from __future__ import annotations

import math
from collections.abc import Collection

import numpy as np
import pypdfium2


def rasterised(
    pdf: bytes, dpi: int, *, only: Collection[int] = (), grey: bool = True
) -> list[np.ndarray]:
    """Pages as pixels: (H, W) of grey, or (H, W, 3) of blue, green and red; `only` some, from 1.

    A pixel is 1/dpi of an inch; the lower left corners of page and pixels are the same. What a page
    lacks to whole pixels is white, at its upper and right edges.
    """
    per_point = dpi / 72
    images = []
    with pypdfium2.PdfDocument(pdf) as document:
        for number, page in enumerate(document, start=1):
            if only and number not in only:
                continue
            pixels = [math.ceil(side * per_point) for side in page.get_size()]
            # PDFium stretches a page to whole pixels; a page of as many is not stretched.
            page.set_mediabox(0, 0, *((side - 1e-3) / per_point for side in pixels))
            image = page.render(scale=per_point, grayscale=grey).to_numpy()
            assert image.shape[1::-1] == tuple(pixels)
            images.append(image.copy())
    return images


def words(pdf: bytes) -> list[str]:
    """Text of each page, spaces made single."""
    with pypdfium2.PdfDocument(pdf) as document:
        return [" ".join(page.get_textpage().get_text_bounded().split()) for page in document]
