"""The chunks of an HDF5 array, measured before the HDF5 library takes them.

The library does not compare the length of a chunk, as it lies in the file or unpacked, with what an array needs: where
one is too short, whatever lies behind it in memory comes out as numbers, or the process ends.
"""

import math
import zlib
from typing import Any


def check_chunks(node: Any, unpack: bool = True) -> None:
    """Raise ValueError where a chunk of an array does not hold what it should; `unpack`: measured unpacked, too."""
    from h5py import h5d, h5z

    plan = node.get_create_plist()
    if plan.get_layout() != h5d.CHUNKED:
        return
    whole = math.prod(plan.get_chunk()) * node.get_type().get_size()
    filters = [plan.get_filter(i)[0] for i in range(plan.get_nfilters())]
    added = {h5z.FILTER_SHUFFLE: 0, h5z.FILTER_FLETCHER32: 4}  # bytes, by filters that do not pack

    def look(info: Any) -> None:
        length, packed_by = whole, None  # as the filters were used, one after another
        for i, way in enumerate(filters):
            if info.filter_mask >> i & 1:
                continue
            if way not in added:
                packed_by = packed_by or way
            elif packed_by is None:
                length += added[way]
        if packed_by is None:
            fits = info.size == length
        else:
            fits = info.size > 4 * filters.count(h5z.FILTER_FLETCHER32)
            if fits and unpack and packed_by == h5z.FILTER_DEFLATE:
                _, packed = node.read_direct_chunk(info.chunk_offset)
                fits = len(zlib.decompressobj().decompress(packed, length + 1)) == length
        if not fits:
            raise ValueError("a chunk of it has a wrong length")

    try:
        node.chunk_iter(look)
    except zlib.error:
        raise ValueError("a chunk of it cannot be unpacked") from None
