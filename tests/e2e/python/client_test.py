"""A client that has no code of ours: gRPC stubs generated from proto/, and numpy.

It uploads an archive of images it made itself, has it imported and synthesised, dresses a plane through the RPC,
downloads the tile set and the dressing, decodes both with tsra.py and compares every texel's colour with the picture that
the server renders. So the protocol and the written format suffice for a client in any language, and the renderer decodes
by the written rule: turns, frames and low lights included.
"""

import hashlib
import io
import pathlib
import subprocess
import sys
import zipfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))

import grpc  # noqa: E402
import numpy  # noqa: E402

import harness  # noqa: E402
from tsra import Container, Dressing, TileSet  # noqa: E402

CHUNK_BYTES = 1 << 20
MATERIAL_SIZE = 48
TILE_SIZE = 16
STRIP_HEIGHT = 8

# The picture shows the texels of the plane with this many pixels each, an odd number, so that a pixel's centre is the
# texel's centre; there bilinear filtering gives that texel alone.
PIXELS_PER_TEXEL = 9
PICTURE_SIZE = 576
EYE_DISTANCE = 0.4

# Measured: RMSE 0.0001 to 0.0002, worst 0.001. What is left are half floats (1/2048 of the value), the directions, which the
# renderer interpolates in single precision, and a pixel's centre beside the texel's by up to 1/1000 pixel. Reading the
# texels' turns wrongly is off by more than forty times the limit of the mean.
RMSE_LIMIT = 0.0005
WORST_LIMIT = 0.004
WRONG_RULE_RMSE = 0.02


def load_stubs():
    """Generates the Python stubs into a folder of the test's own and imports them."""
    folder = pathlib.Path(harness.tempfile.mkdtemp(prefix="tessera-stubs-"))
    subprocess.run([sys.executable, "-m", "grpc_tools.protoc", "-I", str(harness.options.proto), "--python_out", str(folder),
                    "--grpc_python_out", str(folder), "tessera/v1/tessera.proto"], check=True)
    sys.path.insert(0, str(folder))
    from tessera.v1 import tessera_pb2, tessera_pb2_grpc
    return folder, tessera_pb2, tessera_pb2_grpc


def periodic_noise(rng, size, wavelength):
    """Isotropic noise of one scale, periodic, zero mean, unit variance."""
    frequencies = numpy.fft.fftfreq(size)
    radius = numpy.hypot(*numpy.meshgrid(frequencies, frequencies)) * wavelength
    noise = numpy.fft.ifft2(numpy.fft.fft2(rng.standard_normal((size, size))) * numpy.exp(-8 * (radius - 1) ** 2)).real
    return (noise - noise.mean()) / noise.std()


def make_archive():
    """A BTF of a bumpy, coloured, slightly glossy surface in the UBO2003 layout, as the bytes of a zip archive."""
    rng = numpy.random.default_rng(5)
    height = periodic_noise(rng, MATERIAL_SIZE, 10)
    albedo = numpy.stack([0.45 + 0.1 * periodic_noise(rng, MATERIAL_SIZE, 12) for _ in range(3)], axis=-1)
    # Slopes along x (columns) and y (up, towards row 0).
    slope_x = (numpy.roll(height, -1, 1) - numpy.roll(height, 1, 1)) / 2
    slope_y = (numpy.roll(height, 1, 0) - numpy.roll(height, -1, 0)) / 2
    normal = numpy.stack([-slope_x, -slope_y, numpy.full_like(height, 1.5)], axis=-1)
    normal /= numpy.linalg.norm(normal, axis=-1, keepdims=True)
    directions = [(0, 0)] + [(polar, azimuth) for polar, count in ((30, 6), (60, 10)) for azimuth in
                             [360 * i // count for i in range(count)]]

    def vector(polar, azimuth):
        polar, azimuth = numpy.radians([polar, azimuth])
        return numpy.array([numpy.sin(polar) * numpy.cos(azimuth), numpy.sin(polar) * numpy.sin(azimuth), numpy.cos(polar)])

    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_STORED) as files:
        number = 0
        for view in directions:
            for light in directions:
                wi, wo = vector(*light), vector(*view)
                half = (wi + wo) / numpy.linalg.norm(wi + wo)
                gloss = 0.2 * numpy.maximum(normal @ half, 0) ** 8
                value = (albedo + gloss[..., None]) * numpy.maximum(normal @ wi, 0)[..., None]
                codes = numpy.round(255 * numpy.clip(value, 0, 1) ** (1 / 2.2)).astype(numpy.uint8)
                name = f"tv{view[0]:03}_pv{view[1]:03}/{number:05} tl{light[0]:03} pl{light[1]:03} " \
                       f"tv{view[0]:03} pv{view[1]:03}.png"
                files.writestr("TINY/" + name, harness.encode_png(codes))
                number += 1
    return archive.getvalue()


def decode_exr(data):
    """{channel: [height][width] float array} of an uncompressed or ZIP-compressed half or float scanline EXR."""
    import struct
    import zlib
    assert data[:4] == b"\x76\x2f\x31\x01"
    position, attributes = 8, {}

    def text():
        nonlocal position
        end = data.index(b"\0", position)
        value, position = data[position:end].decode(), end + 1
        return value

    while name := text():
        kind = text()
        size, = struct.unpack_from("<I", data, position)
        attributes[name] = (kind, data[position + 4:position + 4 + size])
        position += 4 + size
    left, top, right, bottom = struct.unpack("<4i", attributes["dataWindow"][1])
    width, height = right - left + 1, bottom - top + 1
    lines = {0: 1, 2: 1, 3: 16}[attributes["compression"][1][0]]  # none, zips, zip
    channels, listed = [], attributes["channels"][1]
    while listed[0]:
        end = listed.index(b"\0")
        channels.append((listed[:end].decode(), {1: "<f2", 2: "<f4"}[struct.unpack_from("<I", listed, end + 1)[0]]))
        listed = listed[end + 17:]
    picture = {name: numpy.zeros((height, width)) for name, _ in channels}
    offsets = struct.unpack_from(f"<{-(-height // lines)}Q", data, position)
    row_bytes = sum(numpy.dtype(kind).itemsize for _, kind in channels) * width
    for offset in offsets:
        row, size = struct.unpack_from("<iI", data, offset)
        row -= top
        block, expected = data[offset + 8:offset + 8 + size], row_bytes * min(lines, height - row)
        if size < expected:  # else stored as it is
            raw = numpy.frombuffer(zlib.decompress(block), numpy.uint8).astype(numpy.int64)
            raw[1:] -= 128
            raw = numpy.cumsum(raw).astype(numpy.uint8)
            block = numpy.empty(expected, numpy.uint8)
            block[0::2], block[1::2] = raw[:(expected + 1) // 2], raw[(expected + 1) // 2:]
            block = block.tobytes()
        start = 0
        for y in range(row, min(row + lines, height)):
            for name, kind in channels:
                picture[name][y] = numpy.frombuffer(block, kind, width, start)
                start += numpy.dtype(kind).itemsize * width
    return picture


class PythonClientTest(harness.unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.stubs_folder, cls.pb, stubs = load_stubs()
        cls.server = harness.Server()
        cls.channel = grpc.insecure_channel(cls.server.address)
        for name in ("Materials", "TileSets", "Jobs", "Dressings", "Previews", "Blobs", "ServerInfo"):
            setattr(cls, name.lower(), getattr(stubs, name + "Stub")(cls.channel))

    @classmethod
    def tearDownClass(cls):
        cls.channel.close()
        cls.server.close()
        harness.shutil.rmtree(cls.stubs_folder, ignore_errors=True)

    def upload(self, data):
        sha256 = hashlib.sha256(data).hexdigest()
        status = self.blobs.BeginUpload(self.pb.BeginUploadRequest(sha256=sha256, size_bytes=len(data)))
        if not status.complete:
            offsets = range(status.committed_bytes, len(data), CHUNK_BYTES)
            status = self.blobs.WriteBlob(iter([
                self.pb.WriteChunk(sha256=sha256 if i == 0 else "", offset=offset, data=data[offset:offset + CHUNK_BYTES])
                for i, offset in enumerate(offsets)]))
        self.assertTrue(status.complete)
        return sha256

    def download(self, blob):
        data = b"".join(chunk.data for chunk in self.blobs.ReadBlob(self.pb.ReadBlobRequest(sha256=blob.sha256)))
        self.assertEqual(len(data), blob.size_bytes)
        self.assertEqual(hashlib.sha256(data).hexdigest(), blob.sha256)
        return data

    def finish(self, job):
        last_sequence = 0
        for event in self.jobs.WatchJob(self.pb.WatchJobRequest(name=job.name)):
            self.assertGreater(event.sequence, last_sequence)
            last_sequence, job = event.sequence, event.job
        self.assertEqual(job.state, self.pb.Job.SUCCEEDED, job)
        return job.result_name

    def test_everything_from_outside(self):
        material = self.finish(self.materials.ImportMaterial(self.pb.ImportMaterialRequest(
            name="materials/tiny", archive_sha256=self.upload(make_archive()), layout="ubo2003", transfer="gamma:2.2",
            encode=self.pb.EncodeOptions(kl=9, kv=9), provenance=self.pb.Provenance(source="this test", licence="CC0-1.0"))))
        self.assertEqual(material, "materials/tiny")
        name = self.finish(self.tilesets.SynthesizeTileSet(self.pb.SynthesizeTileSetRequest(
            name="arrangements/surface-96/tileSets/tiny", material=material, tile_size=TILE_SIZE,
            strip_height=STRIP_HEIGHT, seed=2, force=True)))
        described = self.tilesets.GetTileSet(self.pb.GetTileSetRequest(name=name))
        self.assertEqual(described.provenance.source, "this test")
        container = Container(self.download(described.blob))
        tile_set = TileSet(container)
        self.assertEqual(tile_set.tile_index.shape, (96, TILE_SIZE, TILE_SIZE))
        self.assertGreater((tile_set.tile_index >> 30).max(), 0, "no turned texel: nothing would test the turns")

        dressed = self.dressings.DressMesh(self.pb.DressMeshRequest(
            builtin="plane", arrangement="arrangements/surface-96", seed=11))
        dressing = Dressing(Container(self.download(dressed.dressing)))
        self.assertEqual(len(dressing.quads), dressed.num_quads)
        self.assertEqual(dressing.arrangement["sha256"], container.header["arrangement"]["sha256"])

        # The second stands lower than any light of the archive: its polar angle is clamped.
        for light in (self.pb.Light(x=0.6, y=-0.3, z=0.7), self.pb.Light(x=0.8, y=0.5, z=0.25),
                      self.pb.Light(kind=self.pb.Light.POINT, x=-0.3, y=0.4, z=0.5)):
            with self.subTest(light=light):
                errors = self.compare(tile_set, dressing, dressed.dressing.sha256, light)
                rmse, worst = numpy.sqrt((errors ** 2).mean()), numpy.abs(errors).max()
                print(f"{errors.shape[0]} texels, RMSE {rmse:.5f}, worst {worst:.5f}", file=sys.stderr)
                self.assertLess(rmse, RMSE_LIMIT)
                self.assertLess(worst, WORST_LIMIT)

        # The comparison sees what it is meant to see: the same texels without their turns do not fit.
        wrong = self.compare(TileSet(container, obey_turns=False), dressing, dressed.dressing.sha256,
                             self.pb.Light(x=0.6, y=-0.3, z=0.7))
        self.assertGreater(numpy.sqrt((wrong ** 2).mean()), WRONG_RULE_RMSE)

    def compare(self, tile_set, dressing, dressing_sha256, light):
        """Errors [texels][3] of the rendered picture against the decoded texels that it shows."""
        side = numpy.ptp(dressing.positions[:, 0])                     # of the plane, a square around the origin
        texel = side / (numpy.sqrt(len(dressing.quads)) * TILE_SIZE)
        focal = PIXELS_PER_TEXEL / texel * EYE_DISTANCE                # pixels
        fov_y = 2 * numpy.degrees(numpy.arctan(PICTURE_SIZE / 2 / focal))
        eye = numpy.array([0.0, 0.0, EYE_DISTANCE])
        data = b"".join(chunk.data for chunk in self.previews.RenderPreview(self.pb.RenderPreviewRequest(
            tile_set="arrangements/surface-96/tileSets/tiny", dressing_sha256=dressing_sha256, width=PICTURE_SIZE,
            height=PICTURE_SIZE, lights=[light], format=self.pb.RenderPreviewRequest.EXR,
            camera=self.pb.Camera(eye_z=EYE_DISTANCE, fov_y_deg=fov_y))))
        channels = decode_exr(data)
        picture = numpy.stack([channels[name] for name in "RGB"], axis=-1)
        errors = []
        for quad in range(len(dressing.quads)):
            south_west, south_east, north_east, north_west = dressing.tile_corners(quad)
            for row in range(TILE_SIZE):
                for column in range(TILE_SIZE):
                    u, v = (column + 0.5) / TILE_SIZE, 1 - (row + 0.5) / TILE_SIZE
                    point = (1 - v) * ((1 - u) * south_west + u * south_east) + v * ((1 - u) * north_west + u * north_east)
                    x = PICTURE_SIZE / 2 + focal * point[0] / EYE_DISTANCE
                    y = PICTURE_SIZE / 2 - focal * point[1] / EYE_DISTANCE
                    if not (1 < x < PICTURE_SIZE - 1 and 1 < y < PICTURE_SIZE - 1):
                        continue
                    self.assertLess(abs(x % 1 - 0.5) + abs(y % 1 - 0.5), 1e-3, "texel centres are not pixel centres")
                    # The frame of the tile: x along its columns, y up, z out of the plane.
                    tangent = (south_east - south_west) / numpy.linalg.norm(south_east - south_west)
                    bitangent = (north_west - south_west) / numpy.linalg.norm(north_west - south_west)
                    frame = numpy.array([tangent, bitangent, numpy.cross(tangent, bitangent)])
                    to_light = numpy.array([light.x, light.y, light.z])
                    irradiance = numpy.pi
                    if light.kind == self.pb.Light.POINT:
                        to_light = to_light - point
                        irradiance /= to_light @ to_light
                    wi = frame @ (to_light / numpy.linalg.norm(to_light))
                    wo = frame @ ((eye - point) / numpy.linalg.norm(eye - point))
                    decoded = tile_set.decode(dressing.tile[quad], row, column, wi, wo) * irradiance / numpy.pi
                    errors.append(picture[int(y), int(x)] - decoded)
        self.assertGreater(len(errors), 3000)
        return numpy.array(errors)


if __name__ == "__main__":
    harness.main()
