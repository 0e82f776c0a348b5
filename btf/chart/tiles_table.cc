#include "btf/chart/tiles_table.h"

#include <algorithm>
#include <chrono>
#include <memory>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include "btf/base/status_macros.h"
#include "btf/codec/codec.h"
#include "btf/meso/generated_source.h"
#include "btf/report/page.h"
#include "btf/tiles/certificate.h"
#include "btf/tiles/index_maps.h"
#include "btf/tiles/seam_embedding.h"

namespace tessera {
namespace {

constexpr char kTilesArrangement[] = "surface-96";

// [Leung2007] Tables I and III. FLOORTILE has fewer directions than the paper's, so that its images are small
// enough to make; synthesis takes as long, for it sees coefficients.
std::vector<TilesRow> PaperTilesRows() {
  return {{.material = "FLOORTILE",
           .source = "generated:holes,size=800,views=5x8,lights=5x8",
           .side = 800,
           .tile_size = 128,
           .k = 16,
           .paper_minutes = 33,
           .paper_share = 0.3786,
           .paper_megabytes = 186.10,
           .run = {}},
          {.material = "IMPALLA",
           .source = "generated:wrinkles,size=256",
           .side = 256,
           .tile_size = 256,
           .k = 25,
           .paper_minutes = 51,
           .paper_share = 0.4992,
           .paper_megabytes = 61.36,
           .run = {}},
          {.material = "WRINKLES",
           .source = "generated:wrinkles",
           .side = 128,
           .tile_size = 64,
           .k = 25,
           .paper_minutes = 15,
           .paper_share = 0.7692,
           .paper_megabytes = 23.64,
           .run = {}},
          {.material = "HOLES",
           .source = "generated:holes",
           .side = 128,
           .tile_size = 100,
           .k = 25,
           .paper_minutes = 25,
           .paper_share = 0.3486,
           .paper_megabytes = 10.72,
           .run = {}},
          {.material = "REACTDIFFUSE",
           .source = "generated:reactdiffuse",
           .side = 128,
           .tile_size = 64,
           .k = 25,
           .paper_minutes = 16,
           .paper_share = 0.5501,
           .paper_megabytes = 16.91,
           .run = {}}};
}

double SecondsSince(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

absl::StatusOr<TilesRun> RunRow(const TilesRow& row, const RunContext& context) {
  TESSERA_ASSIGN_OR_RETURN(const GenerateParams generate, ParseGeneratedSource(row.source));
  TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<BtfSource> source, GenerateBtf(generate, context));
  const Codec& codec = *FindCodec("dsh");
  TESSERA_ASSIGN_OR_RETURN(const Material material,
                           codec.Encode(*source, {.kl = row.k, .kv = row.k}, context));
  TilesRun run;
  auto start = std::chrono::steady_clock::now();
  TESSERA_ASSIGN_OR_RETURN(const Embedding laid_in, EmbedForSeams(material, kCutDims, context));
  run.embed_s = SecondsSince(start);
  const SynthesisParams params{.tile_size = row.tile_size, .force = true};
  const Arrangement& arrangement = **FindArrangement(kTilesArrangement);
  start = std::chrono::steady_clock::now();
  TESSERA_ASSIGN_OR_RETURN(const IndexMaps maps, SynthesizeIndexMaps(Exemplar(laid_in, params.seam_rule),
                                                                     arrangement, params, context));
  run.seconds = SecondsSince(start);
  const TileSet tiles = TileSetOfMaps(material, arrangement, maps, params);
  run.referenced_share =
      static_cast<double>(tiles.btfels.size()) / static_cast<double>(material.btfels.size());
  run.btfel_bytes = tiles.btfels.size() * tiles.btfels.num_coefficients;
  TESSERA_ASSIGN_OR_RETURN(const Embedding embedding, codec.Embed(material, kCutDims, context));
  TESSERA_ASSIGN_OR_RETURN(const Certificate certificate,
                           CertifyTiles(material, Exemplar(embedding), arrangement, maps, params.strip_height,
                                        CertificateImages::kStratified, context));
  run.insides_ratio = certificate.figures["insides"]["ratio"].get<double>();
  return run;
}

}  // namespace

absl::StatusOr<std::vector<TilesRow>> RunTilesTable(const RunContext& context) {
  std::vector<TilesRow> rows = PaperTilesRows();
  RunContext quiet = context;
  quiet.progress = nullptr;
  for (size_t row = 0; row < rows.size(); ++row) {
    context.Report("paper", row, rows.size(), "tile sets");
    TESSERA_ASSIGN_OR_RETURN(rows[row].run, RunRow(rows[row], quiet));
  }
  context.Report("paper", rows.size(), rows.size(), "tile sets");
  return rows;
}

std::string TilesCsv(const std::vector<TilesRow>& rows) {
  std::string csv = CsvLine({"material", "texels", "tile_size", "kv", "kl", "method", "source", "seconds",
                             "embed_s", "referenced_share", "megabytes", "insides_ratio"});
  for (const TilesRow& row : rows) {
    const std::vector<std::string> start = {row.material, absl::StrCat(row.side, "x", row.side),
                                            absl::StrCat(row.tile_size), absl::StrCat(row.k),
                                            absl::StrCat(row.k)};
    const auto add = [&](const std::vector<std::string>& rest) {
      std::vector<std::string> cells = start;
      cells.insert(cells.end(), rest.begin(), rest.end());
      csv += CsvLine(cells);
    };
    add({"paper", "", absl::StrCat(60.0 * row.paper_minutes), "", absl::StrFormat("%.4f", row.paper_share),
         absl::StrFormat("%.2f", row.paper_megabytes), ""});
    add({"frame", row.source, absl::StrFormat("%.2f", row.run.seconds),
         absl::StrFormat("%.2f", row.run.embed_s), absl::StrFormat("%.4f", row.run.referenced_share),
         absl::StrFormat("%.2f", 1e-6 * static_cast<double>(row.run.btfel_bytes)),
         absl::StrFormat("%.4f", row.run.insides_ratio)});
  }
  return csv;
}

}  // namespace tessera
