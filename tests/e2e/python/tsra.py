"""Reads containers of tile sets and dressings and decodes BTFels, with numpy alone.

Written from the rules of btf/codec/FORMAT.md, sections 1 to 3, 5 and 6; neither the library nor the example at the end of
that page is used, and the harmonics are those of the definition, not of the recurrence: so the page suffices and is right.
"""

import json
import struct
import zlib

import numpy

DTYPES = {"u8": "<u1", "u16": "<u2", "u32": "<u4", "f32": "<f4", "f64": "<f8"}


class Container:
    def __init__(self, data):
        magic, version, header_bytes = struct.unpack_from("<8sII", data)
        assert magic == b"TESSERA\0" and version == 1, (magic, version)
        self.header = json.loads(data[16:16 + header_bytes])
        self.kind = self.header["kind"]
        self.sections = {}
        for section in self.header["sections"]:
            stored = data[section["offset"]:section["offset"] + section["stored_bytes"]]
            assert section["offset"] % 64 == 0 and len(stored) == section["stored_bytes"], section
            assert section["encoding"] == "none", "numpy alone reads what is not compressed"
            assert zlib.crc32(stored) == section["crc32"], section
            array = numpy.frombuffer(stored, DTYPES[section["dtype"]])
            self.sections[section["name"]] = array.reshape(section["shape"])

    def __getitem__(self, name):
        return self.sections[name]


def spherical_harmonics(count, direction):
    """The first `count` real orthonormal functions, no Condon-Shortley sign, index l (l + 1) + m."""
    degree = int(round(count ** 0.5)) - 1
    x, y, z = direction
    phi = numpy.arctan2(y, x)
    sine = numpy.hypot(x, y)
    # Associated Legendre functions P(l, m)(z) without (-1)^m, by the textbook recurrence.
    legendre = {(0, 0): 1.0}
    for m in range(1, degree + 1):
        legendre[m, m] = (2 * m - 1) * sine * legendre[m - 1, m - 1]
    for m in range(degree):
        legendre[m + 1, m] = (2 * m + 1) * z * legendre[m, m]
        for l in range(m + 2, degree + 1):
            legendre[l, m] = ((2 * l - 1) * z * legendre[l - 1, m] - (l + m - 1) * legendre[l - 2, m]) / (l - m)
    values = numpy.zeros(count)
    factorial = numpy.cumprod([1.0] + list(range(1, 2 * degree + 1)))
    for l in range(degree + 1):
        for m in range(-l, l + 1):
            order = abs(m)
            scale = numpy.sqrt((2 * l + 1) / (4 * numpy.pi) * factorial[l - order] / factorial[l + order])
            angular = 1.0 if m == 0 else numpy.sqrt(2) * (numpy.cos(m * phi) if m > 0 else numpy.sin(order * phi))
            values[l * (l + 1) + m] = scale * legendre[l, order] * angular
    return values


def clamp_polar(direction, limit_cos):
    """The direction with its polar angle not beyond the limit."""
    if direction[2] >= limit_cos:
        return direction
    limit_sin = numpy.sqrt(1 - limit_cos ** 2)
    horizontal = direction[:2] * (limit_sin / numpy.hypot(direction[0], direction[1]))
    return numpy.array([horizontal[0], horizontal[1], limit_cos])


class TileSet:
    """Tiles that decode to reflectance: decode(tile, row, column, light, view)."""

    def __init__(self, container, obey_turns=True):
        assert container.kind == "tile_set"
        codec = container.header["codec"]
        assert (codec["id"], codec["version"]) == ("dsh-cls", 1), codec
        self.obey_turns = obey_turns
        self.tile_index = container["tile_index"]
        self.tile_codes = container["tile_codes"]
        parts, order = [], container["btfel_order"]
        while f"btfels.{len(parts)}" in container.sections:
            parts.append(container[f"btfels.{len(parts)}"])
        by_energy = numpy.concatenate(parts, axis=1)
        codes = numpy.empty_like(by_energy)
        codes[:, order] = by_energy
        self.kl, self.kv = codec["parameters"]["kl"], codec["parameters"]["kv"]
        self.values = container["offset"].astype(float) + container["step"].astype(float) * codes
        self.basis_light = container["basis_light"].astype(float)
        self.basis_view = container["basis_view"].astype(float)
        self.light_limit_cos = max(0.0, container["lights"][:, 2].min().astype(float))
        self.view_limit_cos = max(0.0, container["views"][:, 2].min().astype(float))

    def decode(self, tile, row, column, light, view):
        """RGB reflectance, light and view unit vectors in the tile's frame: x along columns, y up, z out."""
        entry = int(self.tile_index[tile, row, column])
        if self.obey_turns:
            for _ in range(entry >> 30):
                light = numpy.array([light[1], -light[0], light[2]])
                view = numpy.array([view[1], -view[0], view[2]])
        if light[2] <= 0 or view[2] <= 0:
            return numpy.zeros(3)
        scale = min(1.0, light[2] / self.light_limit_cos) if self.light_limit_cos > 0 else 1.0
        kl, kv = self.kl, self.kv
        y_light = self.basis_light @ spherical_harmonics(kl, clamp_polar(light, self.light_limit_cos))
        y_view = self.basis_view @ spherical_harmonics(kv, clamp_polar(view, self.view_limit_cos))
        # k index = (channel * kv + j) * kl + i
        coefficients = self.values[entry & 0x3FFFFFFF].reshape(3, kv, kl)
        return numpy.maximum(scale * numpy.einsum("cji,j,i->c", coefficients, y_view, y_light), 0.0)


class Dressing:
    def __init__(self, container):
        assert container.kind == "dressing"
        self.arrangement = container.header["arrangement"]
        self.positions = container["positions"].astype(float)
        self.quads = container["quads"]
        self.tile = container["tile"]
        self.turns = container["turns"]

    def tile_corners(self, quad):
        """Where the tile's corners south-west, south-east, north-east and north-west lie: tile side j is on face
        side (j + turns) mod 4, and face side k runs from vertex k to vertex k + 1."""
        corners = self.quads[quad]
        return [self.positions[corners[(k + self.turns[quad]) % 4]] for k in range(4)]
