"""Installs the package into a folder of its own, builds the example against nothing but that folder and the system, and
runs it against a server."""

import os
import pathlib
import subprocess

import harness

SOURCE = pathlib.Path(__file__).resolve().parent / "sdk_example"


class InstalledSdkTest(harness.CommandTest):
    def run_tool(self, *words):
        words = [str(word) for word in words]
        done = subprocess.run(words, text=True, capture_output=True, timeout=harness.COMMAND_TIMEOUT_S)
        self.assertEqual(done.returncode, 0, f"$ {' '.join(words)}\n{done.stdout}\n{done.stderr}")
        return done.stdout

    def test_the_example_builds_outside_the_tree_and_redresses(self):
        prefix, build = self.folder / "prefix", self.folder / "build"
        self.run_tool("cmake", "--install", harness.options.build, "--prefix", prefix)
        for program in ("tessera", "tessera-server"):
            self.assertTrue(os.access(prefix / "bin" / program, os.X_OK), program)
        self.run_tool("cmake", "-S", SOURCE, "-B", build, "-G", "Ninja", f"-DCMAKE_PREFIX_PATH={prefix}",
                      "-DCMAKE_BUILD_TYPE=Release")
        self.run_tool("cmake", "--build", build)
        # No trace of the source tree: what compiles here compiles on another machine.
        self.assertNotIn(str(SOURCE.parents[2] / "btf"), (build / "build.ninja").read_text())

        self.run_ok("material", "generate", "reactdiffuse", "--name", "leopard", "--size", 64, "--lights", "4x6", "--views",
                    "4x6", "--kl", 4, "--kv", 4)
        self.run_ok("tileset", "synthesize", "leopard", "--arrangement", "surface-96", "--tile", 16, "--strip", 8, "--force")
        out = self.run_tool(build / "redress", self.server.address, "torus", "surface-96")
        self.assertRegex(out, r"surface-96/leopard: \d+ quads bound in [\d.]+ ms, first texel [\d.]+ [\d.]+ [\d.]+")


if __name__ == "__main__":
    harness.main()
