"""The viewer against a real server: what its window shows, in memory and in a window on a virtual screen."""

import json
import shutil
import subprocess
import unittest

import harness

GENERATE = ["--size", 32, "--lights", "4x6", "--views", "4x6", "--codec", "dfmf", "--rank", 16]
SYNTHESIZE = ["--arrangement", "surface-96", "--tile", 16, "--strip", 8, "--force"]
SIZE = (900, 560)
# Of the window: where the picture of the mesh lies, and the first thumbnail.
SCENE = (280, 10, 590, 550)
THUMBNAILS = (12, 52, 84, 124)
# The torus covers about a fifth of the picture.
LEAST_SHARE = 0.08


class Picture:
    def __init__(self, path):
        self.width, self.height, self.channels, self.rows = harness.decode_png(path.read_bytes())

    def pixels(self, box):
        left, top, right, bottom = box
        c = self.channels
        return [bytes(self.rows[y][x * c:x * c + 3]) for y in range(top, bottom) for x in range(left, right)]

    def share_different(self, other, box, by=12):
        mine, others = self.pixels(box), other.pixels(box)
        changed = sum(max(abs(a - b) for a, b in zip(p, q)) > by for p, q in zip(mine, others))
        return changed / len(mine)

    def share_coloured(self, box, by=20):
        """The background and an empty window are grey."""
        pixels = self.pixels(box)
        return sum(max(p) - min(p) > by for p in pixels) / len(pixels)


class ViewerTest(harness.CommandTest):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        for kind in ("holes", "weave"):
            for words in (["material", "generate", kind, "--name", kind, *GENERATE],
                          ["tileset", "synthesize", kind, *SYNTHESIZE],
                          ["tileset", "thumbnail", f"surface-96/{kind}", "-o", f"{kind}-thumbnail.png"]):
                result = cls.tessera(*words)
                assert result.code == 0, result

    def viewer(self, *words, before=(), environment=None):
        size = [] if "--size" in words else ["--size", "%dx%d" % SIZE]
        command = [*before, harness.options.bin / "tessera-viewer", *size, *[str(word) for word in words]]
        return harness.Result(command, subprocess.run(
            command, cwd=self.folder, env=environment or self.environment(), text=True, stdin=subprocess.DEVNULL,
            capture_output=True, timeout=harness.COMMAND_TIMEOUT_S))

    def show(self, tile_set, name):
        result = self.viewer("--mesh", "builtin:torus", "--tileset", tile_set, "--offscreen", name)
        self.assertEqual(result.code, 0, result)
        self.assertEqual(result.err, "", result)
        return Picture(self.folder / name)

    def test_two_tile_sets_on_one_mesh(self):
        holes = self.show("surface-96/holes", "holes.png")
        weave = self.show("surface-96/weave", "weave.png")
        self.assertEqual((holes.width, holes.height), SIZE)
        for picture in (holes, weave):
            self.assertGreater(picture.share_coloured(SCENE), LEAST_SHARE, "the torus covers a part of the picture")
            self.assertGreater(picture.share_coloured(THUMBNAILS), 0.5)
        self.assertGreater(holes.share_different(weave, SCENE), LEAST_SHARE)
        self.assertLess(holes.share_different(weave, THUMBNAILS), 0.01)

    def test_a_script_redresses_and_moves(self):
        (self.folder / "script").write_text("\n".join(json.dumps(step) for step in [
            {"wait": "loaded"}, {"select": "surface-96/weave"}, {"select": "surface-96/holes"},
            {"screenshot": "one.png"}, {"select": "surface-96/weave"}, {"screenshot": "two.png"},
            {"light": [300, 5]}, {"screenshot": "dark.png"}, {"orbit": [90, 20]}, {"zoom": -3},
            {"screenshot": "away.png"}, {"select": "surface-96/holes"}]))
        result = self.viewer("--tileset", "surface-96/holes", "--offscreen", "last.png", "--script", "script")
        self.assertEqual(result.code, 0, result)
        one, two, dark, away = (Picture(self.folder / f"{name}.png") for name in ("one", "two", "dark", "away"))
        for before, after in ((one, two), (two, dark), (dark, away)):
            self.assertGreater(before.share_different(after, SCENE), LEAST_SHARE)
        first, again, again_too, last = [json.loads(line) for line in result.out.splitlines()]
        self.assertFalse(first["cached"], result)
        for redressed in (again, again_too, last):
            self.assertTrue(redressed["shown"] and redressed["cached"], result)
            self.assertEqual(redressed["pictures"], 1, "a resident tile set is in the next picture")
            self.assertEqual((redressed["load_ms"], redressed["prepare_ms"]), (0, 0), result)

    def test_far_away_and_developed(self):
        """Mip levels are drawn above two texels a pixel; exposure and tone change the mesh alone."""
        (self.folder / "far-script").write_text("\n".join(json.dumps(step) for step in [
            {"wait": "loaded"}, {"select": "surface-96/weave"}, {"screenshot": "plain.png"},
            {"exposure": -3}, {"screenshot": "under.png"}, {"exposure": 0}, {"tone": "filmic"},
            {"screenshot": "filmic.png"}, {"tone": "none"}, {"screenshot": "plain-again.png"}, {"zoom": -25},
            {"select": "surface-96/holes"}, {"select": "surface-96/weave"}]))
        result = self.viewer("--tileset", "surface-96/holes", "--offscreen", "far.png", "--script", "far-script")
        self.assertEqual(result.code, 0, result)
        plain, under, filmic, again = (Picture(self.folder / f"{name}.png")
                                       for name in ("plain", "under", "filmic", "plain-again"))
        near, *far = [json.loads(line) for line in result.out.splitlines()]
        self.assertLess(near["texels_per_pixel"], 2, result)
        self.assertEqual(near["mips"], "not needed", result)
        for redressed in far:
            self.assertGreater(redressed["texels_per_pixel"], 2, result)
            self.assertEqual(redressed["mips"], "drawn", result)
        for developed in (under, filmic):
            self.assertGreater(plain.share_different(developed, SCENE), LEAST_SHARE)
        self.assertEqual(plain.share_different(again, SCENE, by=0), 0)

    def test_light_from_all_around(self):
        """An environment lights the mesh alone, and turns."""
        (self.folder / "sky.hdr").write_bytes(
            b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4 +X 8\n" +
            b"".join(bytes((128, 96, 64, 130 if i % 8 < 4 else 126)) for i in range(32)))
        (self.folder / "sky-script").write_text("\n".join(json.dumps(step) for step in [
            {"wait": "loaded"}, {"screenshot": "sky.png"}, {"sky": [180, 1]}, {"screenshot": "turned.png"},
            {"sky": [0, 0]}, {"screenshot": "dark.png"}, {"sky": [0, 1]}, {"screenshot": "sky-again.png"}]))
        result = self.viewer("--tileset", "surface-96/weave", "--env", "sky.hdr", "--offscreen", "end.png", "--script",
                             "sky-script")
        self.assertEqual(result.code, 0, result)
        sky, turned, dark, again = (Picture(self.folder / f"{name}.png")
                                    for name in ("sky", "turned", "dark", "sky-again"))
        for other in (turned, dark):
            self.assertGreater(sky.share_different(other, SCENE), LEAST_SHARE)
        self.assertEqual(sky.share_different(again, SCENE, by=0), 0)

    def test_what_is_wrong_is_told(self):
        nowhere = dict(self.environment(), TESSERA_SERVER="127.0.0.1:1")
        cases = [(["--tileset", "surface-96/weave"], nowhere, "no server at 127.0.0.1:1"),
                 (["--tileset", "surface-96/none"], None, "surface-96/none"),
                 (["--tileset", "surface-96/weave", "--arrangement", "plane-16"], None, "plane-16"),
                 (["--mesh", "nowhere.obj"], None, "nowhere.obj")]
        for words, environment, says in cases:
            result = self.viewer(*words, "--offscreen", "wrong.png", environment=environment)
            self.assertEqual(result.code, 0, result)
            self.assertIn("error: ", result.err, result)
            self.assertIn(says, result.err, result)
            # Light red over the picture's grey.
            shown = Picture(self.folder / "wrong.png").pixels((275, 0, 590, 40))
            self.assertTrue(any(p[0] > 200 and p[2] < 150 for p in shown), result)

    def test_mistakes_on_the_command_line(self):
        (self.folder / "bad").write_text('{"jump": 1}\n')
        for words, code, says in ((["--offscreen", "x.png", "--size", "9x9"], 1, "320 to 8192"),
                                  (["--offscreen", "x.png", "--script", "bad"], 1, "line 1"),
                                  (["--offscreen", "nowhere/x.png"], 1, "nowhere"),
                                  (["--jump"], 2, "jump")):
            result = self.viewer(*words)
            self.assertEqual(result.code, code, result)
            self.assertIn(says, result.err, result)

    @unittest.skipUnless(shutil.which("Xvfb") and shutil.which("xvfb-run"), "there is no Xvfb")
    def test_a_window(self):
        (self.folder / "window-script").write_text("\n".join(json.dumps(step) for step in [
            {"wait": "loaded"}, {"select": "surface-96/weave"}, {"frames": 3}, {"screenshot": "window.png"},
            {"select": "surface-96/holes"}, {"screenshot": "window2.png"}]))
        result = self.viewer("--tileset", "surface-96/holes", "--script", "window-script",
                             before=["xvfb-run", "-a", "-s", "-screen 0 1280x800x24"])
        self.assertEqual(result.code, 0, result)
        weave, holes = Picture(self.folder / "window.png"), Picture(self.folder / "window2.png")
        self.assertEqual((weave.width, weave.height), SIZE)
        self.assertGreater(weave.share_coloured(SCENE), LEAST_SHARE)
        self.assertGreater(weave.share_different(holes, SCENE), LEAST_SHARE)
        in_memory = self.show("surface-96/weave", "in-memory.png")
        self.assertLess(weave.share_different(in_memory, SCENE), 0.02, "both draw the same")


if __name__ == "__main__":
    harness.main()
