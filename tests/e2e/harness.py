"""Starts the real server and runs the real command line, for the end-to-end tests.

Run a test by hand:  python3 tests/e2e/cli_test.py --bin build/release/bin [-v] [TestClass.test_name]
"""

import argparse
import json
import os
import pathlib
import select
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import time
import unittest
import zlib

START_TIMEOUT_S = 30
STOP_TIMEOUT_S = 30
COMMAND_TIMEOUT_S = 240

options = argparse.Namespace(bin=None)


class Server:
    """A server on a free loopback port with a data folder of its own."""

    def __init__(self, workers=2):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="tessera-e2e-"))
        self.workers = workers
        self.process = None
        self.address = None
        self.start()

    def start(self):
        self.log = open(self.folder / "server.log", "ab")
        self.process = subprocess.Popen(
            [options.bin / "tessera-server", "--data", self.folder / "data", "--listen", "127.0.0.1:0",
             "--workers", str(self.workers)],
            stdout=subprocess.PIPE, stderr=self.log)
        ready, _, _ = select.select([self.process.stdout], [], [], START_TIMEOUT_S)
        line = self.process.stdout.readline().decode() if ready else ""
        if not line.startswith("listening on "):
            self.process.kill()
            raise RuntimeError(f"the server said {line!r}; its log:\n{self.log_text()}")
        self.address = line.split()[-1]

    def log_text(self):
        return (self.folder / "server.log").read_text(errors="replace")

    def stop(self):
        self.process.send_signal(signal.SIGTERM)
        code = self.process.wait(STOP_TIMEOUT_S)
        self.process.stdout.close()
        self.log.close()
        return code

    def close(self):
        if self.process.poll() is None:
            self.stop()
        shutil.rmtree(self.folder, ignore_errors=True)


class Result:
    def __init__(self, command, process):
        self.command = " ".join(str(word) for word in command)
        self.code = process.returncode
        self.out = process.stdout
        self.err = process.stderr

    def json(self):
        return json.loads(self.out)

    def __str__(self):
        return f"$ {self.command}\nexit {self.code}\nstdout:\n{self.out}\nstderr:\n{self.err}"


class CommandTest(unittest.TestCase):
    """Runs `tessera` in a folder of its own against one server per class."""

    @classmethod
    def setUpClass(cls):
        cls.server = Server()
        cls.folder = pathlib.Path(tempfile.mkdtemp(prefix="tessera-e2e-"))

    @classmethod
    def tearDownClass(cls):
        cls.server.close()
        shutil.rmtree(cls.folder, ignore_errors=True)

    @classmethod
    def environment(cls):
        return dict(os.environ, TESSERA_SERVER=cls.server.address, XDG_CACHE_HOME=str(cls.folder / "cache"))

    @classmethod
    def command(cls, *words):
        return [options.bin / "tessera", *[str(word) for word in words]]

    @classmethod
    def tessera(cls, *words, environment=None):
        command = cls.command(*words)
        return Result(command, subprocess.run(command, cwd=cls.folder, env=environment or cls.environment(), text=True,
                                              stdin=subprocess.DEVNULL, capture_output=True,
                                              timeout=COMMAND_TIMEOUT_S))

    def run_ok(self, *words):
        result = self.tessera(*words)
        self.assertEqual(result.code, 0, result)
        return result

    def run_json(self, *words):
        return self.run_ok(*words, "--json").json()

    def assert_fails(self, code, *words, reason=None, says=None):
        """The exit code, nothing on stdout, and one JSON error on stderr with --json."""
        plain = self.tessera(*words)
        self.assertEqual(plain.code, code, plain)
        self.assertEqual(plain.out, "", plain)
        if says:
            self.assertIn(says, plain.err, plain)
        result = self.tessera(*words, "--json")
        self.assertEqual(result.code, code, result)
        self.assertEqual(result.out, "", result)
        error = json.loads(result.err.splitlines()[-1])["error"]
        self.assertEqual(error["exit_code"], code)
        if reason:
            self.assertEqual(error["reason"], reason, result)
        return error


def encode_png(rows):
    """8-bit RGB PNG of a [height][width][3] array of bytes."""
    height, width, _ = rows.shape

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    raw = b"".join(b"\0" + row.tobytes() for row in rows)
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)) +
            chunk(b"IDAT", zlib.compress(raw)) + chunk(b"IEND", b""))


def decode_png(data):
    """(width, height, channels, rows of bytes) of an 8-bit PNG without interlace, filters undone."""
    assert data[:8] == b"\x89PNG\r\n\x1a\n", "not a PNG"
    position, idat, header = 8, b"", None
    while position < len(data):
        size, kind = struct.unpack(">I4s", data[position:position + 8])
        body = data[position + 8:position + 8 + size]
        assert zlib.crc32(kind + body) == struct.unpack(">I", data[position + 8 + size:position + 12 + size])[0]
        if kind == b"IHDR":
            header = struct.unpack(">IIBBBBB", body)
        elif kind == b"IDAT":
            idat += body
        position += 12 + size
    width, height, depth, colour, _, _, interlace = header
    assert depth == 8 and interlace == 0
    channels = {0: 1, 2: 3, 4: 2, 6: 4}[colour]
    raw, stride, rows = zlib.decompress(idat), width * channels, []
    previous = bytearray(stride)
    for y in range(height):
        kind, row = raw[y * (stride + 1)], bytearray(raw[y * (stride + 1) + 1:(y + 1) * (stride + 1)])
        for i in range(stride):
            left = row[i - channels] if i >= channels else 0
            up = previous[i]
            corner = previous[i - channels] if i >= channels else 0
            if kind == 1:
                row[i] = (row[i] + left) & 255
            elif kind == 2:
                row[i] = (row[i] + up) & 255
            elif kind == 3:
                row[i] = (row[i] + (left + up) // 2) & 255
            elif kind == 4:
                distances = abs(up - corner), abs(left - corner), abs(left + up - 2 * corner)
                nearest = left if distances[0] <= min(distances[1:]) else up if distances[1] <= distances[2] else corner
                row[i] = (row[i] + nearest) & 255
        rows.append(row)
        previous = row
    return width, height, channels, rows


def wait_until(condition, timeout_s):
    end = time.monotonic() + timeout_s
    while time.monotonic() < end:
        if condition():
            return True
        time.sleep(0.05)
    return False


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--bin", type=pathlib.Path, required=True, help="folder of tessera and tessera-server")
    parser.add_argument("--build", type=pathlib.Path, help="build folder, where a test installs from it")
    parser.add_argument("--proto", type=pathlib.Path, help="folder of the .proto files")
    parser.parse_known_args(namespace=options)
    options.bin = options.bin.resolve()
    _, rest = parser.parse_known_args()
    unittest.main(module="__main__", argv=[sys.argv[0], *rest], verbosity=2)
