"""tileset pull for a scene: only its tiles, a mip level, an error or a number of bytes; what is moved and what is kept."""

import pathlib

import harness


class PullTest(harness.CommandTest):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        generate = ["material", "generate", "wrinkles", "--name", "skin", "--size", 64, "--lights", "4x6", "--views", "4x6",
                    "--kl", 9, "--kv", 9]
        synthesize = ["tileset", "synthesize", "skin", "--arrangement", "surface-96", "--tile", 16, "--strip", 8, "--force"]
        dress = ["mesh", "dress", "builtin:torus", "--arrangement", "surface-96", "-o", "torus.tsra"]
        for words in generate, synthesize, dress:
            result = cls.tessera(*words)
            assert result.code == 0, result
        # Two quads of the torus: a scene that shows few tiles.
        quad = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n"
        (cls.folder / "quad.obj").write_text(quad)
        result = cls.tessera("mesh", "dress", "quad.obj", "--arrangement", "surface-96", "-o", "quad.tsra")
        assert result.code == 0, result

    def pull(self, *words):
        answer = self.run_json("tileset", "pull", "surface-96/skin", "-o", "part.tsra", *words)
        self.assertTrue((self.folder / "part.tsra").read_bytes().startswith(b"TESSERA\0"))
        return answer["stream"]

    def test_only_the_tiles_of_a_dressing(self):
        whole = self.pull("--level", 0)
        self.assertEqual((whole["num_tiles"], whole["rmse"]), (96, 0.0))
        self.assertEqual(whole["num_coefficients"], 243)
        few = self.pull("--for-dressing", "quad.tsra")
        self.assertLess(few["num_tiles"], 96)
        self.assertLess(few["part_bytes"], whole["part_bytes"])
        # The part dresses what it was pulled for, and says why it dresses nothing else.
        self.run_ok("mesh", "redress", "quad.tsra", "--tileset", "part.tsra")
        self.assert_fails(5, "mesh", "redress", "torus.tsra", "--tileset", "part.tsra", says="is not among the")
        text = self.run_ok("tileset", "pull", "surface-96/skin", "-o", "part.tsra", "--for-dressing", "quad.tsra").out
        self.assertIn(f"{few['num_tiles']} of 96 tiles at level 0", text)
        self.assertIn("of the whole set's", text)

    def test_errors_fall_with_bytes_and_bounds_hold(self):
        whole = self.pull("--level", 0)
        errors = [part["rmse"] for part in whole["parts"]]
        self.assertEqual(errors, sorted(errors, reverse=True))
        bound = errors[len(errors) // 2]
        coarse = self.pull("--max-error", bound)
        self.assertLessEqual(coarse["rmse"], bound)
        self.assertLess(coarse["part_bytes"], whole["part_bytes"])
        small = self.pull("--max-bytes", "100KB", "--light", "environment")
        self.assertLessEqual(small["part_bytes"], 100000)
        self.assertGreater(small["rmse"], 0)
        self.assertIn("soft lights", small["directions"])

    def test_far_scenes_move_a_level(self):
        far = self.pull("--pixels-per-quad", 2, "--for-dressing", "torus.tsra", "--max-error", 0.01)
        self.assertEqual((far["level"], far["tile_size"]), (2, 8))
        self.run_ok("mesh", "redress", "torus.tsra", "--tileset", "part.tsra")
        self.assertLess(far["part_bytes"], self.pull("--for-dressing", "torus.tsra")["part_bytes"] / 2)

    def test_the_cache_moves_nothing_twice(self):
        first = self.pull("--level", 1)
        again = self.pull("--level", 1)
        self.assertEqual(again["part_bytes"], first["part_bytes"])
        self.assertLess(again["moved_bytes"], 4096)
        for file in pathlib.Path(self.folder, "cache", "tessera", "blobs").rglob("*"):
            if file.is_file():
                file.write_bytes(file.read_bytes()[:-1])
        repaired = self.pull("--level", 1)
        self.assertGreater(repaired["moved_bytes"], first["part_bytes"])

    def test_what_cannot_be_is_refused(self):
        def refused(code, *words, reason=None, says):
            self.assert_fails(code, "tileset", "pull", "surface-96/skin", "-o", "x.tsra", *words, reason=reason, says=says)
            self.assertFalse((self.folder / "x.tsra").exists())

        refused(5, "--level", 5, reason="ARGUMENT_INVALID", says="levels 0 to 4")
        refused(5, "--level", -1, reason="ARGUMENT_INVALID", says="levels 0 to 4")
        refused(5, "--max-error", "-0.5", reason="ARGUMENT_INVALID", says="max_error -0.5")
        refused(5, "--max-error", "nan", reason="ARGUMENT_INVALID", says="max_error nan")
        refused(5, "--max-bytes", 0, reason="ARGUMENT_INVALID", says="max_bytes 0")
        refused(5, "--max-bytes", 10, reason="BOUND_NOT_REACHED", says="max_bytes is 10")
        refused(5, "--pixels-per-quad", 0, reason="ARGUMENT_INVALID", says="pixels per quad 0")
        refused(4, "--for-dressing", "none.tsra", says="none.tsra")
        self.run_ok("mesh", "dress", "builtin:torus", "--arrangement", "plane-16", "-o", "plane.tsra")
        refused(5, "--for-dressing", "plane.tsra", says="is a dressing of plane-16")
        for words in (["--level", 1, "--pixels-per-quad", 3], ["--light", "moon"], ["--max-bytes", "many"]):
            result = self.tessera("tileset", "pull", "surface-96/skin", "-o", "x.tsra", *words)
            self.assertEqual(result.code, 2, result)


if __name__ == "__main__":
    harness.main()
