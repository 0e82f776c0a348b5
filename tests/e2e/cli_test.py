"""The command line as a newcomer meets it: every noun once, through a real socket, from generating a material to the
pictures of a re-dressed mesh."""

import contextlib
import csv
import json
import os
import re
import signal
import sqlite3
import subprocess
import xml.etree.ElementTree

import harness
from harness import decode_png

# Small enough for a test, large enough for the synthesis to work with.
GENERATE = ["--size", 64, "--lights", "4x6", "--views", "4x6", "--kl", 4, "--kv", 4]
SYNTHESIZE = ["--arrangement", "surface-96", "--tile", 16, "--strip", 8]
REDRESS_LIMIT_MS = 10
CHOOSE = ["material", "generate", "weave", "--name", "x", "--size", 32, "--lights", "4x8", "--views", "4x8", "--codec", "auto"]


class NoServerTest(harness.unittest.TestCase):
    """What works, and what is said, where no server is."""

    def tessera(self, *words, timeout=60, **variables):
        environment = {key: value for key, value in os.environ.items() if key != "TESSERA_SERVER"}
        command = [harness.options.bin / "tessera", *[str(word) for word in words]]
        return harness.Result(command, subprocess.run(command, env=dict(environment, **variables), text=True,
                                                      capture_output=True, timeout=timeout))

    def test_no_server_is_3_and_tells_how_to_start_one(self):
        result = self.tessera("server", "status", "--server", "127.0.0.1:1")
        self.assertEqual(result.code, 3, result)
        self.assertIn("no server at 127.0.0.1:1", result.err)
        self.assertIn("tessera-server --data DIR --listen 127.0.0.1:1", result.err)
        self.assertEqual(result.out, "")
        error = json.loads(self.tessera("server", "status", "--json", TESSERA_SERVER="127.0.0.1:1").err)["error"]
        self.assertEqual((error["code"], error["exit_code"]), ("UNAVAILABLE", 3))
        self.assertIn("tessera-server", error["hint"])

    def test_usage_is_2(self):
        for words in ([], ["material"], ["nonsense"], ["material", "show"], ["material", "list", "--nonsense"],
                      ["server", "status", "--server", "nowhere"],
                      ["preview", "surface-96/x", "--mesh", "builtin:torus", "--size", "3x4", "-o", "x.png"],
                      ["preview", "surface-96/x", "--mesh", "builtin:torus", "-o", "x.jpg"],
                      ["preview", "surface-96/x", "-o", "x.png"],
                      [*CHOOSE, "--max-error", 0.1, "--max-bytes", "1MiB"], [*CHOOSE, "--max-error", "-1"],
                      [*CHOOSE, "--max-error", "little"], [*CHOOSE, "--max-bytes", "1 parsec"],
                      [*CHOOSE, "--max-error", 0.1, "--for", "discos"],
                      ["material", "generate", "holes", "--name", "x", "--codec", "dfmf", "--rank", 0],
                      ["material", "generate", "holes", "--name", "x", "--codec", "dfmf", "--rank", 3, "--max-bytes", 9]):
            result = self.tessera(*words)
            self.assertEqual(result.code, 2, result)
            self.assertEqual(result.out, "", result)

    def test_help_lists_nouns_and_exit_codes(self):
        result = self.tessera("--help")
        self.assertEqual(result.code, 0, result)
        for word in ("material", "arrangement", "tileset", "mesh", "preview", "job", "server", "TESSERA_SERVER",
                     "Exit codes", "130"):
            self.assertIn(word, result.out)
        self.assertRegex(self.tessera("--version").out, r"^tessera \d+\.\d+\.\d+\n$")

    def test_bash_completes_commands_options_and_nothing_wrong(self):
        script = self.tessera("completion", "bash").out

        def complete(*words):
            shell = f"{script}\nCOMP_WORDS=({' '.join(words)}); COMP_CWORD={len(words) - 1}; _tessera; " \
                    "printf '%s\\n' \"${COMPREPLY[@]}\""
            done = subprocess.run(["bash", "-c", shell], text=True, capture_output=True, timeout=60)
            self.assertEqual((done.returncode, done.stderr), (0, ""))
            return done.stdout.split()

        self.assertEqual(complete("tessera", "til"), ["tileset"])
        self.assertEqual(complete("tessera", "tileset", "syn"), ["synthesize"])
        self.assertEqual(complete("tessera", "--json", "tileset", "synthesize", "wool", "--arr"), ["--arrangement"])
        self.assertEqual(complete("tessera", "tileset", "zzz"), [])

    def test_meshes_need_no_server(self):
        folder = harness.pathlib.Path(harness.tempfile.mkdtemp(prefix="tessera-e2e-"))
        try:
            output = folder / "torus.tsra"
            result = self.tessera("mesh", "dress", "builtin:torus", "--arrangement", "surface-96", "-o", str(output),
                                  "--json", TESSERA_SERVER="127.0.0.1:1")
            self.assertEqual(result.code, 0, result)
            self.assertGreater(result.json()["num_quads"], 0)
            self.assertEqual(output.read_bytes()[:8], b"TESSERA\0")
            info = self.tessera("mesh", "info", "builtin:genus3", "--json").json()
            self.assertEqual((info["genus"], info["num_boundary_edges"]), (3, 0))

            triangle = folder / "triangle.obj"
            triangle.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
            refused = self.tessera("mesh", "dress", str(triangle), "--arrangement", "surface-96", "-o",
                                   str(folder / "t.tsra"))
            self.assertEqual(refused.code, 5, refused)
            self.assertIn("triangle.obj", refused.err)
            self.assertIn("not closed", refused.err)
            box = folder / "box.off"
            box.write_text("OFF\n8 7 0\n" + "".join(f"{i & 1} {i >> 1 & 1} {i >> 2}\n" for i in range(8)) +
                           "4 0 2 3 1\n4 4 5 7 6\n4 0 1 5 4\n4 2 6 7 3\n4 0 4 6 2\n3 1 3 7\n3 1 7 5\n")
            quads = folder / "quads.obj"
            report = self.tessera("mesh", "remesh", str(box), "--quads", 300, "-o", str(quads), "--json").json()
            self.assertTrue(270 <= report["num_quads"] <= 330, report)
            self.assertEqual((report["num_flipped"], report["genus_in"], report["genus_out"]), (0, 0, 0))
            self.assertLess(report["angle_deviation_deg"]["mean"], 15)
            info = self.tessera("mesh", "info", str(quads), "--json").json()
            self.assertEqual((info["num_quads"], info["remeshed"]), (report["num_quads"], False))
            dressed = folder / "box.tsra"
            on_the_way = self.tessera("mesh", "dress", str(box), "--quads", 300, "--arrangement", "surface-96", "-o",
                                      str(dressed), "--json")
            self.assertEqual(on_the_way.json()["num_quads"], report["num_quads"])
            self.assertIn("remeshed", on_the_way.err)
            for path in (box, quads, dressed):
                path.unlink()
            missing = self.tessera("mesh", "info", str(folder / "none.obj"))
            self.assertEqual(missing.code, 4, missing)
            unwritable = self.tessera("mesh", "dress", "builtin:torus", "--arrangement", "surface-96", "-o",
                                      str(folder / "no" / "x.tsra"))
            self.assertEqual(unwritable.code, 4, unwritable)
            # Nothing half-written, whatever happened.
            self.assertEqual(sorted(path.name for path in folder.iterdir()), ["torus.tsra", "triangle.obj"])
        finally:
            harness.shutil.rmtree(folder)


    def test_charts_need_no_server(self):
        folder = harness.pathlib.Path(harness.tempfile.mkdtemp(prefix="tessera-e2e-"))
        try:
            source = "generated:weave,size=32,views=2x5,lights=2x5,area-samples=1,bounces=0"
            made = self.tessera("chart", "codecs", source, "--quick", "-o", str(folder / "new" / "chart"), "--json",
                                timeout=280, TESSERA_SERVER="127.0.0.1:1")
            self.assertEqual(made.code, 0, made)
            page, table = folder / "new" / "chart" / "codecs.html", folder / "new" / "chart" / "codecs.csv"
            self.assertEqual(made.json()["files"], [str(page), str(table)])
            with table.open(newline="") as rows:
                rows = list(csv.DictReader(rows))
            self.assertEqual({row["source"] for row in rows}, {source})
            self.assertEqual({row["split"] for row in rows}, {"sampled", "held-out lights", "held-out views"})
            self.assertGreaterEqual({row["method"] for row in rows}, {"dsh", "dsh-cls", "dfmf", "view-pca", "JPEG images"})
            self.assertTrue(all(0 < float(row["rmse"]) and 0 < int(row["bytes"]) for row in rows), rows)

            root = xml.etree.ElementTree.fromstring(page.read_text())
            self.assertEqual(root.tag, "html")
            # 3 metrics of 3 splits against 3 costs, 3 plots by angle.
            plots = [e for e in root.iter("{http://www.w3.org/2000/svg}svg") if e.get("class") == "plot"]
            self.assertEqual(len(plots), 3 * 3 * 3 + 3)
            pictures = [e.get("src") for e in root.iter("img")]
            self.assertGreater(len(pictures), 20)
            self.assertTrue(all(src.startswith("data:image/png;base64,") for src in pictures))
            self.assertEqual([e for e in root.iter() if e.get("href") or e.tag in ("script", "link")], [])
        finally:
            harness.shutil.rmtree(folder)

    def test_synthesis_is_charted(self):
        folder = harness.pathlib.Path(harness.tempfile.mkdtemp(prefix="tessera-e2e-"))
        try:
            source = "generated:holes,size=64,views=2x5,lights=2x5,area-samples=1,bounces=0"
            made = self.tessera("chart", "synthesis", source, "--quick", "-o", str(folder), "--json", timeout=280,
                                TESSERA_SERVER="127.0.0.1:1")
            self.assertEqual(made.code, 0, made)
            page, table = folder / "synthesis.html", folder / "synthesis.csv"
            self.assertEqual(made.json()["files"][:2], [str(page), str(table)])
            pictures = made.json()["files"][2:]
            self.assertEqual(len(pictures), 4)
            self.assertTrue(all(harness.pathlib.Path(p).read_bytes()[1:4] == b"PNG" for p in pictures))
            with table.open(newline="") as rows:
                rows = list(csv.DictReader(rows))
            self.assertEqual({(row["method"], row["seam_rule"]) for row in rows},
                             {("diamond-dp", "mismatch"), ("diamond-cut", "mismatch"), ("frame", "mismatch"),
                              ("frame", "excess")})
            root = xml.etree.ElementTree.fromstring(page.read_text())
            self.assertEqual([e for e in root.iter() if e.get("href") or e.tag in ("script", "link")], [])
        finally:
            harness.shutil.rmtree(folder)

    def test_charts_say_what_is_wrong(self):
        folder = harness.pathlib.Path(harness.tempfile.mkdtemp(prefix="tessera-e2e-"))
        try:
            output = str(folder / "chart")
            (folder / "file").write_text("")
            for code, says, words in ((2, "no SOURCE", ["-o", output]),
                                      (2, "twice", ["generated:weave", "generated:weave", "-o", output]),
                                      (5, "reactdiffuse", ["generated:marble", "-o", output]),
                                      (5, "colour-scale", ["generated:weave,colour-scale=2", "-o", output]),
                                      (4, "no such folder or file", [str(folder / "none"), "-o", output]),
                                      (3, "no server", ["wool", "-o", output, "--server", "127.0.0.1:1"]),
                                      (5, "file", ["generated:weave", "-o", str(folder / "file")])):
                result = self.tessera("chart", "codecs", *words)
                self.assertEqual(result.code, code, result)
                self.assertIn(says, result.err)
                self.assertEqual(result.out, "")
            self.assertFalse((folder / "chart" / "codecs.html").exists())
        finally:
            harness.shutil.rmtree(folder)


class MainJobTest(harness.CommandTest):
    """One server, one story; the tests run in alphabetical order and build on each other."""

    def picture(self, name):
        """Width, height, and how many different pixels: a picture of one colour shows nothing."""
        width, height, channels, rows = decode_png((self.folder / name).read_bytes())
        pixels = {bytes(row[i:i + channels]) for row in rows for i in range(0, len(row), channels)}
        return width, height, len(pixels)

    def test_a_generate(self):
        made = self.run_json("material", "generate", "reactdiffuse", "--name", "leopard", "--seed", 3, *GENERATE)
        self.assertEqual(made["material"]["name"], "leopard")
        self.assertEqual((made["material"]["width"], made["material"]["num_coefficients"]), (64, 48))
        self.assertTrue(made["stages"])
        few = self.run_json("material", "generate", "weave", "--name", "cloth", "--size", 32, "--lights", 81, "--views", 81,
                            "--kl", 1, "--kv", 1)["material"]
        self.assertEqual((few["num_lights"], few["num_views"]), (81, 81))
        self.run_ok("material", "delete", "cloth")
        text = self.run_ok("material", "generate", "wrinkles", "--name", "skin", *GENERATE)
        self.assertRegex(text.out, r"skin: 64x64 texels, 24 views, 24 lights")
        # Off a terminal nothing is animated.
        self.assertNotRegex(text.err, r"[\r\033]")
        self.assertEqual([m["name"] for m in self.run_json("material", "list")["materials"]], ["leopard", "skin"])
        self.assertIn("leopard", self.run_ok("material", "list").out)
        self.assertEqual(self.run_json("material", "show", "leopard")["codec"], "dsh-cls")

    def test_b_names_that_are_taken_or_not_there(self):
        again = ["material", "generate", "reactdiffuse", "--name", "leopard", *GENERATE]
        self.assert_fails(5, *again, reason="NAME_TAKEN")
        self.assert_fails(5, "material", "generate", "marble", "--name", "m", *GENERATE)
        self.assert_fails(5, "material", "generate", "holes", "--name", "m", "--lights", "82", says="ubo81")
        self.assert_fails(5, "material", "show", "No Such Name", reason="NAME_INVALID")
        self.assert_fails(4, "material", "show", "none", reason="NOT_FOUND")
        self.assert_fails(4, "material", "pull", "none", "-o", "none.tsra", reason="NOT_FOUND")
        self.assert_fails(4, "tileset", "show", "surface-96/none", reason="NOT_FOUND")
        self.assert_fails(4, "arrangement", "show", "plane-17", reason="NOT_FOUND")
        self.assert_fails(4, "job", "show", "999999", reason="NOT_FOUND")
        self.assert_fails(4, "material", "import", "no-such-folder", "--name", "x")
        self.assertFalse((self.folder / "none.tsra").exists())

    def test_c_materials_decode(self):
        self.run_ok("material", "decode", "leopard", "--light", "45,90", "--view", "0,0", "-o", "flat.png")
        width, height, colours = self.picture("flat.png")
        self.assertEqual((width, height), (64, 64))
        self.assertGreater(colours, 20)
        self.run_ok("material", "decode", "leopard", "--light", "45,90", "--view", "0,0", "-o", "flat.exr")
        self.assertEqual((self.folder / "flat.exr").read_bytes()[:4], b"\x76\x2f\x31\x01")
        self.run_ok("material", "pull", "leopard", "-o", "leopard.tsra")
        self.assertEqual((self.folder / "leopard.tsra").read_bytes()[:8], b"TESSERA\0")

    def test_d_synthesize(self):
        for material in ("leopard", "skin"):
            made = self.run_json("tileset", "synthesize", material, *SYNTHESIZE, "--force")
            self.assertEqual(made["tile_set"]["name"], f"surface-96/{material}")
            self.assertEqual((made["tile_set"]["num_tiles"], made["tile_set"]["tile_size"]), (96, 16))
        names = [t["name"] for t in self.run_json("tileset", "list", "--arrangement", "surface-96")["tile_sets"]]
        self.assertEqual(names, ["surface-96/leopard", "surface-96/skin"])
        self.assertEqual(self.run_json("tileset", "list", "--arrangement", "plane-16")["tile_sets"], [])
        self.assertIn("surface-96/skin", self.run_ok("tileset", "list").out)
        self.assertEqual(self.run_json("tileset", "show", "surface-96/skin")["strip_height"], 8)
        shown = self.run_json("tileset", "show", "surface-96/skin")["certificate"]
        self.assertLess(shown["images"]["count"], shown["images"]["of"])
        again = self.run_json("tileset", "certify", "surface-96/skin")["certificate"]
        self.assertEqual(again, shown)
        whole = self.run_json("tileset", "certify", "surface-96/skin", "--full")["certificate"]
        self.assertEqual(whole["images"]["count"], shown["images"]["of"])
        self.assertEqual(self.run_json("tileset", "show", "surface-96/skin")["certificate"], whole)
        self.assert_fails(5, "tileset", "synthesize", "skin", *SYNTHESIZE, "--force", reason="NAME_TAKEN")
        self.assertEqual(self.run_json("tileset", "show", "surface-96/skin")["metadata"]["method"], "frame")
        self.assertEqual(self.tessera("tileset", "synthesize", "skin", *SYNTHESIZE, "--effort", 101).code, 2)
        made = self.run_json("tileset", "synthesize", "skin", *SYNTHESIZE, "--force", "--name", "longer",
                             "--effort", 2)
        self.assertEqual(made["tile_set"]["metadata"]["parameters"]["effort"], 2)
        self.run_ok("tileset", "delete", "surface-96/longer")
        made = self.run_json("tileset", "synthesize", "skin", *SYNTHESIZE, "--force", "--name", "diamonds",
                             "--method", "diamond-cut")
        self.assertEqual(made["tile_set"]["metadata"]["method"], "diamond-cut")
        self.assertIn("diamond-cut", self.run_ok("tileset", "show", "surface-96/diamonds").out)
        self.run_ok("tileset", "delete", "surface-96/diamonds")
        measured = self.run_json("material", "show", "skin", "--pattern")["pattern"]
        self.assertEqual(made["tile_set"]["metadata"]["pattern"], measured)
        self.assertIn("pattern: anisotropy ", self.run_ok("material", "show", "skin", "--pattern").out)
        by_rule = self.tessera("tileset", "synthesize", "skin", "--arrangement", "plane-16", "--tile", 32, "--force",
                               "--name", "by-rule")
        self.assertEqual(by_rule.code, 0, by_rule)
        self.assertIn("strips 8 high", by_rule.out)
        self.assertIn(f"strip 8: features of {measured['feature_size']:.1f} texels", by_rule.err)
        self.run_ok("tileset", "delete", "plane-16/by-rule")
        unknown = self.tessera("tileset", "synthesize", "skin", *SYNTHESIZE, "--method", "hexagon")
        self.assertEqual((unknown.code, unknown.out), (2, ""), unknown)
        self.assertIn("hexagon", unknown.err)
        self.run_ok("tileset", "pull", "surface-96/skin", "-o", "skin-tiles.tsra")
        mips = self.run_json("tileset", "mips", "surface-96/skin")
        self.assertEqual([level["tile_size"] for level in mips["levels"]], [8, 4, 2, 1])
        self.assertEqual(mips["size_bytes"], sum(level["size_bytes"] for level in mips["levels"]))
        for level in mips["levels"]:
            self.assertTrue(0 < level["quantisation_rmse"] < 0.01, level)
        self.assertIn("8x8", self.run_ok("tileset", "mips", "surface-96/skin").out)
        self.run_ok("tileset", "sheet", "surface-96/skin", "-o", "tiles.png")
        self.assertGreater(self.picture("tiles.png")[2], 20)
        self.run_ok("tileset", "sheet", "surface-96/skin", "--heat", "-o", "heat.png")
        self.assertGreater(self.picture("heat.png")[0], 1.8 * self.picture("tiles.png")[0])
        # A strip that is as large as the material cannot be cut from it.
        result = self.tessera("tileset", "synthesize", "skin", "--arrangement", "surface-96", "--tile", 128, "--strip", 64,
                              "--force", "--name", "too-large", "--json")
        self.assertIn(result.code, (5, 6), result)
        self.assertEqual(json.loads(result.err.splitlines()[-1])["error"]["reason"], "MATERIAL_TOO_SMALL", result)

    def test_d_thumbnail(self):
        """Made by a job of its own, kept by another certificate, and missing where the catalog is older."""
        self.run_ok("tileset", "thumbnail", "surface-96/skin", "-o", "thumbnail.png")
        picture = (self.folder / "thumbnail.png").read_bytes()
        width, height, colours = self.picture("thumbnail.png")
        self.assertEqual((width, height), (128, 128))
        self.assertGreater(colours, 20)
        self.assertEqual(self.run_json("tileset", "show", "surface-96/skin")["thumbnail"]["size_bytes"], len(picture))
        self.assertIn("thumbnail", {job["kind"] for job in self.run_json("job", "list")["jobs"]})
        self.assertEqual(self.tessera("tileset", "thumbnail", "surface-96/skin", "-o", "thumbnail.exr").code, 2)

        self.assertEqual(self.server.stop(), 0, self.server.log_text())
        with contextlib.closing(sqlite3.connect(self.server.folder / "data" / "catalog.sqlite")) as catalog, catalog:
            catalog.execute("UPDATE tile_sets SET thumbnail_sha256 = NULL WHERE name = 'skin'")
        self.server.start()
        self.assertIsNone(self.run_json("tileset", "show", "surface-96/skin")["thumbnail"])
        self.assert_fails(4, "tileset", "thumbnail", "surface-96/skin", "-o", "none.png", reason="NOT_FOUND",
                          says="has no thumbnail")
        self.assertFalse((self.folder / "none.png").exists())
        self.run_ok("tileset", "certify", "surface-96/skin", "--full")
        self.run_ok("tileset", "thumbnail", "surface-96/skin", "-o", "again.png")
        self.assertEqual((self.folder / "again.png").read_bytes(), picture)

    def test_d_synthesize_by_a_recipe(self):
        feature = {"name": "spot", "rectangle": [20, 20, 12, 12], "seeds": {"feature": [[[24, 26], [27, 26]]]}}
        recipe = {"features": [feature], "colours": [{"of": "spot", "hue_deg": 150, "saturation": 1.5}]}
        (self.folder / "recipe.json").write_text(json.dumps(recipe))
        mask = self.run_json("material", "mask", "leopard", "--recipe", "recipe.json", "-o", "mask.png")
        self.assertEqual(mask["features"][0]["name"], "spot")
        x, y, width, height = mask["features"][0]["box"]
        self.assertTrue(20 <= x and 20 <= y and x + width <= 32 and y + height <= 32, mask)
        self.assertGreater(self.picture("mask.png")[2], 20)
        # In the upper left corner of a tile's inside, as much of the feature as fits there.
        recipe["placements"] = [{"feature": "spot", "tile": 165, "position": [1, 1]}]
        (self.folder / "recipe.json").write_text(json.dumps(recipe))
        made = self.run_json("tileset", "synthesize", "leopard", *SYNTHESIZE, "--force", "--name", "by-recipe",
                             "--recipe", "recipe.json")["tile_set"]
        self.assertEqual(made["metadata"]["recipe"], recipe)
        self.assertEqual(made["metadata"]["features"], mask["features"])
        again = self.run_json("tileset", "certify", "surface-96/by-recipe")["certificate"]
        self.assertEqual(again, made["certificate"])
        recipe["placements"][0]["position"] = [15, 9]
        (self.folder / "recipe.json").write_text(json.dumps(recipe))
        self.assert_fails(6, "tileset", "synthesize", "leopard", *SYNTHESIZE, "--force", "--name", "x", "--recipe", "recipe.json",
                          says="placements[0].position: feature \"spot\" would cover")
        recipe["placements"][0]["tile"] = 1
        (self.folder / "recipe.json").write_text(json.dumps(recipe))
        self.assert_fails(5, "tileset", "synthesize", "leopard", *SYNTHESIZE, "--force", "--name", "x", "--recipe", "recipe.json",
                          reason="ARGUMENT_INVALID", says="placements[0].tile: 1 is not the code of a tile")
        (self.folder / "recipe.json").write_text('{"placement": []}')
        self.assert_fails(5, "material", "mask", "leopard", "--recipe", "recipe.json", "-o", "no.png",
                          says="recipe.json: placement: unknown key")
        self.run_ok("tileset", "delete", "surface-96/by-recipe")

    def test_e_dress_and_redress(self):
        self.assertEqual([a["name"] for a in self.run_json("arrangement", "list")["arrangements"]],
                         ["plane-16", "plane-81", "surface-26", "surface-96"])
        self.assertEqual(self.run_json("arrangement", "show", "plane-81")["num_colours"], 3)
        self.assertEqual(self.run_json("arrangement", "show", "surface-96")["num_tiles"], 96)
        here = self.run_json("mesh", "dress", "builtin:torus", "--arrangement", "surface-96", "--seed", 5, "-o", "here.tsra")
        there = self.run_json("mesh", "dress", "builtin:torus", "--arrangement", "surface-96", "--seed", 5, "--on-server",
                              "-o", "there.tsra")
        self.assertEqual(here["num_quads"], there["num_quads"])
        self.assertEqual((self.folder / "here.tsra").read_bytes(), (self.folder / "there.tsra").read_bytes())
        for tile_set in ("surface-96/leopard", "surface-96/skin", "skin-tiles.tsra"):
            bound = self.run_json("mesh", "redress", "here.tsra", "--tileset", tile_set)
            self.assertEqual(bound["num_quads"], here["num_quads"])
            self.assertLess(bound["bind_ms"], REDRESS_LIMIT_MS)
        self.assertRegex(self.run_ok("mesh", "redress", "here.tsra", "--tileset", "surface-96/skin").out,
                         r"quads bound to surface-96/skin in [\d.]+ ms \([\d.]+ ms with getting the tile set\)")
        self.run_ok("mesh", "dress", "builtin:plane", "--arrangement", "plane-16", "-o", "plane.tsra")
        self.assert_fails(5, "mesh", "redress", "plane.tsra", "--tileset", "surface-96/skin", says="plane-16")
        self.assert_fails(5, "mesh", "dress", "builtin:genus3", "--arrangement", "plane-16", "-o", "g.tsra", says="break")
        for where in ([], ["--on-server"]):
            broken = ["mesh", "dress", "builtin:genus3", "--arrangement", "plane-16", "--allow-breaks", *where, "-o", "g.tsra"]
            listed = self.run_json(*broken)
            self.assertEqual(len(listed["breaks"]), listed["num_breaks"])
            self.assertGreater(listed["num_breaks"], 0)
            self.assertEqual([len(listed["breaks"][0][key]) for key in ("quads", "from", "to")], [2, 3, 3])
            said = self.tessera(*broken)
            self.assertEqual(said.code, 0, said)
            self.assertIn(f"breaks at {listed['num_breaks']} edges", said.err)
            self.assertRegex(said.err, r"edge between vertices .* quads \d+ and \d+")
        # A container of another kind is no dressing.
        self.assert_fails(5, "mesh", "redress", "skin-tiles.tsra", "--tileset", "surface-96/skin")

    def test_e_every_other_arrangement(self):
        for arrangement, mesh, num_tiles in (("plane-81", "torus", 81), ("surface-26", "genus3", 26)):
            name = f"{arrangement}/skin"
            made = self.run_json("tileset", "synthesize", "skin", "--arrangement", arrangement, "--tile", 16, "--strip", 8,
                                 "--force")
            self.assertEqual((made["tile_set"]["name"], made["tile_set"]["num_tiles"]), (name, num_tiles))
            dressed = self.run_json("mesh", "dress", f"builtin:{mesh}", "--arrangement", arrangement, "-o", "other.tsra")
            bound = self.run_json("mesh", "redress", "other.tsra", "--tileset", name)
            self.assertEqual(bound["num_quads"], dressed["num_quads"])
            self.run_ok("tileset", "certify", name)
            self.run_ok("tileset", "sheet", name, "-o", "other-tiles.png")
            self.run_ok("preview", name, "--dressing", "other.tsra", "--size", "64x48", "-o", "other.png")
            self.assertGreater(self.picture("other.png")[2], 100)
            self.assert_fails(5, "mesh", "redress", "here.tsra", "--tileset", name, says=arrangement)
            self.run_ok("tileset", "delete", name)

    def test_f_preview(self):
        self.run_ok("preview", "surface-96/skin", "--dressing", "here.tsra", "--light", "35,120", "--size", "160x120",
                    "-o", "skin.png")
        width, height, colours = self.picture("skin.png")
        self.assertEqual((width, height), (160, 120))
        self.assertGreater(colours, 100)
        several = self.run_json("preview", "surface-96/skin", "surface-96/leopard", "--dressing", "here.tsra", "--light",
                                "35,120", "--light", "point:0,2,2,4", "--size", "160x120", "-o", "both.png")
        self.assertEqual([f["file"] for f in several["files"]],
                         ["both-surface-96-skin.png", "both-surface-96-leopard.png"])
        first, second = [(self.folder / f["file"]).read_bytes() for f in several["files"]]
        self.assertNotEqual(first, second)
        # The mesh dressed on the way with the same seed gives the same picture.
        self.run_ok("preview", "surface-96/skin", "--mesh", "builtin:torus", "--seed", 5, "--light", "35,120", "--size",
                    "160x120", "-o", "mesh.png")
        self.assertEqual((self.folder / "mesh.png").read_bytes(), (self.folder / "skin.png").read_bytes())
        self.run_ok("preview", "surface-96/skin", "--mesh", "builtin:torus", "--size", "64x48", "-o", "skin.exr")
        self.assertEqual((self.folder / "skin.exr").read_bytes()[:4], b"\x76\x2f\x31\x01")
        small = ("preview", "surface-96/skin", "--mesh", "builtin:torus", "--size", "48x36")
        for mips in ("on", "off", "auto"):
            self.run_ok(*small, "--mips", mips, "-o", f"mips-{mips}.png")
        self.assertNotEqual(*((self.folder / f"mips-{mips}.png").read_bytes() for mips in ("on", "off")))
        self.assertEqual(*((self.folder / f"mips-{mips}.png").read_bytes() for mips in ("on", "auto")))
        self.assert_fails(4, "preview", "surface-96/none", "--mesh", "builtin:torus", "-o", "none.png")
        self.assertFalse((self.folder / "none.png").exists())
        # Light, camera and development of the picture.
        plain = (self.folder / "mips-off.png").read_bytes()
        for name, flags in {"shadows": ("--shadows", "--shadow-map", 256, "--light", "70,0", "--light", "point:0,1,1,1,.5,0"),
                            "orbit": ("--orbit", "40,10,1.2"), "eye": ("--eye", "0,2,2", "--up", "0,0,-1", "--fov", 50),
                            "tone": ("--exposure", 1, "--tone", "filmic"), "ground": ("--background", "203040")}.items():
            self.run_ok(*small, "--mips", "off", *flags, "-o", f"{name}.png")
            self.assertNotEqual((self.folder / f"{name}.png").read_bytes(), plain, name)
        # Light from all around: bright above, dark below.
        (self.folder / "sky.hdr").write_bytes(
            b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4 +X 8\n" +
            b"".join(bytes((128, 128, 128, 130 - 2 * (i // 8))) for i in range(32)))
        pictures = {plain}
        for name, flags in {"sky": (), "sky-2": ("--env-order", 2), "sky-10": ("--env-lights", 10),
                            "sky-shadows": ("--shadows",), "sky-dim": ("--env-scale", ".2"),
                            "sky-sun": ("--light", "20,60")}.items():
            self.run_ok(*small, "--mips", "off", "--env", "sky.hdr", *flags, "-o", f"{name}.png")
            pictures.add((self.folder / f"{name}.png").read_bytes())
        self.assertEqual(len(pictures), 7)
        self.assert_fails(2, *small, "--env-order", 2, "-o", "none.png", says="--env")
        self.assert_fails(2, *small, "--env", "sky.hdr", "--env-order", 2, "--env-lights", 2, "-o", "none.png")
        self.assert_fails(5, *small, "--env", "skin.png", "-o", "none.png", says="2:1")
        self.assert_fails(2, *small, "--eye", "0,0,3", "--orbit", "0,0", "-o", "none.png")
        self.assert_fails(5, *small, "--orbit", "0,95", "-o", "none.png", says="elevation")
        self.assert_fails(5, *small, "--tone", "filmic", "-o", "none.exr", says="EXR")
        # Turntables and sheets.
        frames = self.run_json(*small, "--turntable", 3, "-o", "turn.png")["files"]
        self.assertEqual([f["file"] for f in frames], ["turn-000.png", "turn-001.png", "turn-002.png"])
        self.assertEqual(len({(self.folder / f["file"]).read_bytes() for f in frames}), 3)
        for name in ("turn.apng", "again.png"):
            self.run_ok(*small, "--turntable", 3, "--animated", "--fps", 5, "-o", name)
        animation = (self.folder / "turn.apng").read_bytes()
        self.assertEqual(animation.count(b"fcTL"), 3)
        self.assertEqual(animation, (self.folder / "again.png").read_bytes())
        self.assertEqual(self.picture("again.png"), self.picture("turn-000.png"))
        self.run_ok("preview", "surface-96/skin", "surface-96/leopard", "--mesh", "builtin:torus", "--mesh", "builtin:plane",
                    "--size", "64x48", "--sheet", "-o", "table.png")
        width, height, _ = self.picture("table.png")
        self.assertEqual(width, 2 * 72 + 8)
        self.assertGreater(height, 2 * 56 + 8)
        self.run_ok("sheet", "skin.png", "both-surface-96-leopard.png", "--columns", 2, "-o", "sheet.png")
        self.assertEqual(self.picture("sheet.png")[:2], (2 * 168 + 8, 128 + 8))

    def test_g_jobs(self):
        jobs = self.run_json("job", "list")["jobs"]
        self.assertGreaterEqual({job["kind"] for job in jobs}, {"generate", "synthesize"})
        done = next(job for job in jobs if job["state"] == "SUCCEEDED")
        watched = self.run_ok("job", "watch", done["name"], "--json").out.splitlines()
        self.assertEqual(json.loads(watched[-1])["job"]["state"], "SUCCEEDED")
        self.assertIn(done["name"], self.run_ok("job", "show", done["name"]).out)

        slow = self.start_slow("slow")
        self.assertEqual(self.run_json("job", "cancel", slow)["name"], slow)
        self.assertTrue(harness.wait_until(lambda: self.state_of(slow) == "CANCELLED", 5), self.state_of(slow))
        result = self.tessera("job", "watch", slow)
        self.assertEqual(result.code, 6, result)
        self.assertIn("CANCELLED", result.out)

    def start_slow(self, name):
        job = self.run_json("material", "generate", "weave", "--name", name, "--size", 512, "--detach")["name"]
        self.assertTrue(harness.wait_until(lambda: self.state_of(job) == "RUNNING", 20))
        return job

    def state_of(self, job):
        return self.run_json("job", "show", job)["state"]

    def test_h_interrupt_cancels_the_work(self):
        before = {job["name"] for job in self.run_json("job", "list")["jobs"]}
        process = subprocess.Popen(self.command("material", "generate", "weave", "--name", "interrupted", "--size", 512),
                                   cwd=self.folder, env=self.environment(), text=True, stdout=subprocess.PIPE,
                                   stderr=subprocess.PIPE)
        new_jobs = lambda: [job for job in self.run_json("job", "list")["jobs"] if job["name"] not in before]
        self.assertTrue(harness.wait_until(lambda: any(job["state"] == "RUNNING" for job in new_jobs()), 20))
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=20)
        self.assertEqual((process.returncode, out), (130, ""), err)
        self.assertIn("interrupted: cancelling", err)
        job = new_jobs()[0]["name"]
        self.assertTrue(harness.wait_until(lambda: self.state_of(job) == "CANCELLED", 5), self.state_of(job))
        self.assert_fails(4, "material", "show", "interrupted", reason="NOT_FOUND")

    def test_i_import_of_a_folder_and_of_an_archive(self):
        folder = self.folder / "BTF"
        write_ubo_folder(folder)
        imported = self.run_json("material", "import", "BTF", "--name", "tiny", "--kl", 4, "--kv", 4, "--source",
                                 "this test", "--licence", "CC0-1.0", "--citation", "none needed")
        self.assertEqual((imported["material"]["num_views"], imported["material"]["num_lights"]), (5, 5))
        self.assertEqual(imported["material"]["provenance"],
                         {"source": "this test", "licence": "CC0-1.0", "citation": "none needed"})
        self.assertGreaterEqual({stage["stage"] for stage in imported["stages"]}, {"images", "uploading"})
        archive = harness.shutil.make_archive(str(self.folder / "BTF"), "zip", self.folder, "BTF")
        there = self.run_json("material", "import", archive, "--on-server", "--name", "tiny-there", "--kl", 4, "--kv", 4)
        self.assertEqual(there["material"]["num_views"], 5)
        # The same samples, the same codec: the same picture from either.
        for name in ("tiny", "tiny-there"):
            self.run_ok("material", "decode", name, "--light", "30,40", "--view", "20,10", "-o", f"{name}.png")
        self.assertEqual((self.folder / "tiny.png").read_bytes(), (self.folder / "tiny-there.png").read_bytes())

        # A chart needs the source that the record names.
        self.assert_fails(5, "chart", "codecs", "tiny", "-o", "chart", says="this test")
        self.assert_fails(4, "chart", "codecs", "none", "-o", "chart")
        self.assert_fails(5, "material", "import", "BTF", "--on-server", "--name", "x", says="zip")
        next(folder.rglob("*.png")).unlink()
        self.assert_fails(5, "material", "import", "BTF", "--name", "x")
        self.assert_fails(4, "material", "show", "x")

    def test_j_two_clients_at_once(self):
        def start(name, seed, cache):
            words = ["tileset", "synthesize", "skin", "--arrangement", "plane-16", "--tile", 16, "--strip", 8, "--seed", seed,
                     "--name", name, "--json"]
            return subprocess.Popen(self.command(*words), cwd=self.folder, text=True, stdout=subprocess.PIPE,
                                    env=dict(self.environment(), XDG_CACHE_HOME=str(self.folder / cache)),
                                    stderr=subprocess.PIPE)

        def end_both(*clients):
            ended = [(*client.communicate(timeout=harness.COMMAND_TIMEOUT_S), client.returncode) for client in clients]
            return sorted(ended, key=lambda end: end[2])

        # Each its own work: both done.
        both = end_both(start("one", 1, "cache-1"), start("two", 2, "cache-2"))
        self.assertEqual([code for _, _, code in both], [0, 0], both)
        # The same work under one name: one job for both, or, where the first has ended before, the name is taken.
        # Different work under one name: one has it, the other hears why not (5 at once, 6 when the job ends).
        for name, seeds, codes in (("same", (3, 3), (0, 5)), ("either", (4, 5), (5, 6))):
            first, second = end_both(*(start(name, seed, f"cache-{i}") for i, seed in enumerate(seeds)))
            self.assertEqual(first[2], 0, first)
            self.assertIn(second[2], codes, second)
            if second[2] == 0:
                self.assertEqual(json.loads(first[0])["job"], json.loads(second[0])["job"])
            else:
                self.assertEqual(json.loads(second[1].splitlines()[-1])["error"]["reason"], "NAME_TAKEN", second)
        self.assertNotEqual(self.run_json("tileset", "show", "plane-16/one")["blob"],
                            self.run_json("tileset", "show", "plane-16/two")["blob"])

        # Both get the same bytes at the same time, into files of their own.
        pulls = [subprocess.Popen(self.command("tileset", "pull", "plane-16/one", "-o", f"pulled-{i}.tsra"), cwd=self.folder,
                                  env=self.environment(), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
                 for i in range(2)]
        self.assertEqual([pull.wait(harness.COMMAND_TIMEOUT_S) for pull in pulls], [0, 0])
        self.assertEqual((self.folder / "pulled-0.tsra").read_bytes(), (self.folder / "pulled-1.tsra").read_bytes())

    def test_k_a_codec_is_chosen_by_a_bound(self):
        choose = lambda name, *words: [*CHOOSE[:4], name, *CHOOSE[5:], *words]
        made = self.run_json(*choose("loose", "--max-error", 0.3))["material"]
        choice = made["metadata"]["choice"]
        self.assertEqual(choice["chosen"]["codec"], made["codec"])
        self.assertEqual(choice["chosen"]["bytes"], made["blob"]["size_bytes"])
        for held_out in ("held_out_lights_rmse", "held_out_views_rmse"):
            self.assertLessEqual(choice["chosen"][held_out], 0.3)
        self.assertEqual(choice["goal"], {"max_error": 0.3, "scene_light": "point"})
        self.assertEqual({r["codec"] for r in choice["rejected"]} | {made["codec"]}, {"dfmf", "dsh", "dsh-cls", "view-pca"})

        text = self.run_ok(*choose("tight", "--max-error", 0.145, "--for", "environment"))
        self.assertRegex(text.err, r"tight: chose \S+ .* for max_error = 0.145, environment light: .* on held-out lights")
        self.assertRegex(text.err, r"tight: rejected dsh \d+x\d+: ")
        shown = self.run_ok("material", "show", "tight").out
        self.assertRegex(shown, r"(?m)^metadata\.choice\.report: +chose \S+ .* for max_error = 0\.145")
        self.assertRegex(shown, r"(?m)^metadata\.choice\.report: +rejected ")
        self.assertLess(made["blob"]["size_bytes"], self.run_json("material", "show", "tight")["blob"]["size_bytes"])

        small = self.run_json(*choose("small", "--max-bytes", "64KiB"))["material"]
        self.assertLessEqual(small["blob"]["size_bytes"], 64 * 1024)
        self.assertEqual(small["metadata"]["choice"]["goal"]["max_bytes"], 64 * 1024)

        error = self.assert_fails(6, *choose("never", "--max-error", 0.0001), reason="BOUND_NOT_REACHED", says="the best is")
        self.assertIn("max_error = 0.0001", error["message"])
        self.assert_fails(4, "material", "show", "never")

        # Encoded here, and there.
        here = self.run_json("material", "import", "BTF.zip", "--name", "chosen-here", "--codec", "auto", "--max-error", 0.2)
        there = self.run_json("material", "import", "BTF.zip", "--on-server", "--name", "chosen-there", "--codec", "auto",
                              "--max-error", 0.2)
        self.assertEqual(here["material"]["metadata"], there["material"]["metadata"])
        self.assert_fails(5, "material", "import", "BTF.zip", "--name", "y", "--codec", "auto", "--max-error", 0.00001,
                          reason="BOUND_NOT_REACHED")
        # The bounds of dfmf itself, and codecs that have none.
        ranked = self.run_json("material", "import", "BTF.zip", "--name", "ranked", "--codec", "dfmf", "--rank", 3)
        self.assertLessEqual(ranked["material"]["num_coefficients"], 3)
        bounded = self.run_json("material", "import", "BTF.zip", "--name", "bounded", "--codec", "dfmf", "--max-error", 0.05)
        self.assertLessEqual(bounded["material"]["metadata"]["encode_rmse"], 0.05)
        for words, name in ((["--codec", "auto"], "max_error"), (["--codec", "dsh", "--max-error", 0.1], "max_error"),
                            (["--codec", "auto", "--rank", 3], "rank"), (["--for", "point"], "scene_light")):
            self.assert_fails(5, "material", "import", "BTF.zip", "--name", "y", *words, reason="ARGUMENT_INVALID", says=name)
            self.assert_fails(5, *CHOOSE[:-2], *words, reason="ARGUMENT_INVALID", says=name)

    def test_l_replace_and_delete(self):
        before = self.run_json("material", "show", "leopard")["blob"]["sha256"]
        after = self.run_json("material", "generate", "reactdiffuse", "--name", "leopard", "--seed", 4, "--replace", *GENERATE)
        self.assertNotEqual(before, after["material"]["blob"]["sha256"])
        self.run_ok("tileset", "delete", "surface-96/leopard")
        self.assert_fails(4, "tileset", "show", "surface-96/leopard")
        self.run_ok("material", "delete", "leopard")
        self.assert_fails(4, "material", "delete", "leopard")
        status = self.run_json("server", "status")
        self.assertEqual(status["address"], self.server.address)
        self.assertEqual(status["num_tile_sets"], len(self.run_json("tileset", "list")["tile_sets"]))
        self.assertRegex(self.run_ok("server", "status").out, re.compile(r"^num_materials: +\d", re.M))

    def test_m_a_stopped_server_is_no_server(self):
        self.assertEqual(self.server.stop(), 0, self.server.log_text())
        self.assert_fails(3, "material", "list", says="tessera-server --data")


def write_ubo_folder(folder):
    """5 views by 5 lights of 32x32 texels in the UBO2003 layout."""
    import numpy

    directions = [(0, 0), (60, 0), (60, 90), (60, 180), (60, 270)]
    x, y = numpy.meshgrid(numpy.arange(32), numpy.arange(32))
    height = numpy.sin(2 * numpy.pi * x / 8) * numpy.cos(2 * numpy.pi * y / 8)
    for view_polar, view_azimuth in directions:
        view = folder / f"tv{view_polar:03}_pv{view_azimuth:03}"
        view.mkdir(parents=True)
        for i, (polar, azimuth) in enumerate(directions):
            lit = numpy.cos(numpy.radians(polar)) * (0.5 + 0.3 * height * numpy.cos(numpy.radians(azimuth)))
            grey = numpy.round(255 * lit * numpy.cos(numpy.radians(view_polar / 2))).astype(numpy.uint8)
            name = f"{i:05} tl{polar:03} pl{azimuth:03} tv{view_polar:03} pv{view_azimuth:03}.png"
            (view / name).write_bytes(harness.encode_png(numpy.stack([grey, grey, grey], axis=-1)))


if __name__ == "__main__":
    harness.main()
