"""Reads the PNG that Chromium writes: 8 bits a channel, RGB or RGBA, not interlaced.

Invariant: what it can't read it refuses; it never guesses.
"""

import struct
import zlib


class Image:
    """Pixels of a PNG; `image[x, y]` is (red, green, blue)."""

    def __init__(self, png):
        if png[:8] != b"\x89PNG\r\n\x1a\n":
            raise ValueError("not a PNG")
        at, packed = 8, b""
        while at < len(png):
            length, kind = struct.unpack(">I4s", png[at:at + 8])
            body = png[at + 8:at + 8 + length]
            if kind == b"IHDR":
                self.width, self.height, depth, color, _, _, interlaced = struct.unpack(">IIBBBBB", body)
            elif kind == b"IDAT":
                packed += body
            at += 12 + length
        if depth != 8 or color not in (2, 6) or interlaced:
            raise ValueError(f"depth {depth}, color type {color}, interlaced {interlaced}")
        self.channels = 3 if color == 2 else 4
        self.rows = self._unfilter(zlib.decompress(packed))

    def _unfilter(self, raw):
        size, step = self.width * self.channels, self.channels
        rows, above = [], bytearray(size)
        for start in range(0, len(raw), size + 1):
            kind, row = raw[start], bytearray(raw[start + 1:start + 1 + size])
            for i in range(size):
                left = row[i - step] if i >= step else 0
                if kind == 1:
                    row[i] = (row[i] + left) & 255
                elif kind == 2:
                    row[i] = (row[i] + above[i]) & 255
                elif kind == 3:
                    row[i] = (row[i] + (left + above[i]) // 2) & 255
                elif kind == 4:
                    corner = above[i - step] if i >= step else 0
                    guess = left + above[i] - corner
                    near = min((left, above[i], corner), key=lambda one: abs(guess - one))
                    row[i] = (row[i] + near) & 255
            rows.append(row)
            above = row
        return rows

    def __getitem__(self, place):
        x, y = place
        at = x * self.channels
        return tuple(self.rows[y][at:at + 3])

    def count(self, color, tolerance=24, box=None):
        """How many pixels are `color`, each channel within `tolerance`, in `box` (left, top, right, bottom) or everywhere."""
        left, top, right, bottom = box or (0, 0, self.width, self.height)
        return sum(close(self[x, y], color, tolerance) for y in range(top, bottom) for x in range(left, right))

    def colors(self, every=3):
        """The colors of every so many pixels, as a set."""
        return {self[x, y] for y in range(0, self.height, every) for x in range(0, self.width, every)}


def close(one, other, tolerance=24):
    """Whether two colors are alike."""
    return all(abs(a - b) <= tolerance for a, b in zip(one, other))

