#include "btf/chart/paper_table.h"

#include <algorithm>
#include <chrono>
#include <limits>
#include <memory>
#include <span>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include "btf/base/cpu_time.h"
#include "btf/base/parallel.h"
#include "btf/base/status_macros.h"
#include "btf/codec/codec.h"
#include "btf/data/half_btf.h"
#include "btf/measure/held_out.h"
#include "btf/meso/generated_source.h"
#include "btf/report/page.h"

namespace tessera {
namespace {

constexpr char kSource[] = "generated:reactdiffuse";

double Seconds(int hours, int minutes, int seconds) {
  return 3600.0 * hours + 60.0 * minutes + seconds;
}

std::vector<PaperRow> Rows() {
  return {{128, 25, 25, Seconds(0, 10, 13), 0.0953}, {128, 36, 25, Seconds(0, 12, 41), 0.1373},
          {256, 25, 25, Seconds(0, 17, 47), 0.0953}, {256, 36, 25, Seconds(0, 20, 51), 0.1373},
          {800, 25, 25, Seconds(2, 51, 29), 0.0953}, {800, 36, 25, Seconds(3, 22, 0), 0.1373}};
}

// A periodic BTF repeated to side x side texels, with the time that reading it takes.
class RepeatedBtf final : public BtfSource {
 public:
  RepeatedBtf(BtfSource& period, int side) : period_(period), info_(period.info()) {
    info_.width = side;
    info_.height = side;
  }

  [[nodiscard]] const BtfInfo& info() const override { return info_; }

  [[nodiscard]] absl::Status ReadRows(int row_begin, int num_rows, std::span<float> samples,
                                      const RunContext& context) override {
    const auto start = std::chrono::steady_clock::now();
    const double cpu_start = ProcessCpuSeconds();
    const size_t period_samples = period_.SamplesPerRow();
    const size_t row_samples = SamplesPerRow();
    row_.resize(period_samples);
    for (int row = 0; row < num_rows; ++row) {
      TESSERA_RETURN_IF_ERROR(period_.ReadRows((row_begin + row) % period_.info().height, 1, row_, context));
      const std::span<float> out = samples.subspan(row * row_samples, row_samples);
      const auto repeats = static_cast<int64_t>((row_samples + period_samples - 1) / period_samples);
      ParallelFor(context, 0, repeats, 1, [&](int64_t begin, int64_t end) {
        for (int64_t i = begin; i < end; ++i) {
          const size_t first = i * period_samples;
          std::copy_n(row_.begin(), std::min(period_samples, row_samples - first),
                      out.begin() + static_cast<ptrdiff_t>(first));
        }
      });
    }
    seconds_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    cpu_seconds_ += ProcessCpuSeconds() - cpu_start;
    return context.CheckStop();
  }

  [[nodiscard]] double seconds() const { return seconds_; }
  [[nodiscard]] double cpu_seconds() const { return cpu_seconds_; }

 private:
  BtfSource& period_;
  BtfInfo info_;
  std::vector<float> row_;
  double seconds_ = 0.0;
  double cpu_seconds_ = 0.0;
};

struct PaperMethod {
  std::string name;
  std::string codec;
  EncodeParams params;
};

absl::StatusOr<PaperRun> RunMethod(BtfSource& period, int side, const PaperMethod& method,
                                   const RunContext& context) {
  RepeatedBtf source(period, side);
  const auto start = std::chrono::steady_clock::now();
  const double cpu_start = ProcessCpuSeconds();
  TESSERA_ASSIGN_OR_RETURN(const Material material,
                           FindCodec(method.codec)->Encode(source, method.params, context));
  PaperRun run{.method = method.name};
  run.encode_s =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count() - source.seconds();
  run.encode_cpu_s = ProcessCpuSeconds() - cpu_start - source.cpu_seconds();
  TESSERA_ASSIGN_OR_RETURN(const ContainerFile file, MaterialFile(material));
  run.size_bytes = file.size_bytes();
  TESSERA_ASSIGN_OR_RETURN(const PairErrors errors,
                           MeasureMaterial(source, material, MeasuredPairs(source.info(), Split::kSampled),
                                           side / kPaperMeasuredRows, context));
  run.relative_rmse = Total(errors).relative_rmse();
  return run;
}

}  // namespace

absl::StatusOr<std::vector<PaperRow>> RunPaperTable(PaperSize size, const RunContext& context) {
  TESSERA_ASSIGN_OR_RETURN(const GenerateParams params, ParseGeneratedSource(kSource));
  TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<BtfSource> generated, GenerateBtf(params, context));
  TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<HalfBtf> period,
                           HalfBtf::CopyOf(*generated, std::numeric_limits<uint64_t>::max(), context));
  RunContext quiet = context;
  quiet.progress = nullptr;
  std::vector<PaperRow> rows = Rows();
  const auto is_run = [&](const PaperRow& row) { return size == PaperSize::kAll || row.side <= 256; };
  constexpr size_t kMethods = 3;
  const size_t total = kMethods * static_cast<size_t>(std::ranges::count_if(rows, is_run));
  size_t done = 0;
  for (PaperRow& row : rows) {
    if (!is_run(row)) {
      continue;
    }
    const EncodeParams dsh{.kl = row.kl, .kv = row.kv};
    for (const PaperMethod& method : {PaperMethod{"dsh-cls", "dsh-cls", dsh}, PaperMethod{"dsh", "dsh", dsh},
                                      PaperMethod{"dfmf", "dfmf", {}}}) {
      context.Report("paper", done++, total, "encodings");
      // "dfmf" has no such coefficients: it is the same in both rows of a size.
      const auto same = std::ranges::find_if(rows, [&](const PaperRow& other) {
        return method.codec == "dfmf" && other.side == row.side && other.runs.size() == kMethods;
      });
      if (same != rows.end()) {
        row.runs.push_back(same->runs.back());
        continue;
      }
      TESSERA_ASSIGN_OR_RETURN(PaperRun run, RunMethod(*period, row.side, method, quiet));
      row.runs.push_back(std::move(run));
    }
  }
  context.Report("paper", total, total, "encodings");
  return rows;
}

std::string PaperCsv(const std::vector<PaperRow>& rows) {
  std::string csv = CsvLine({"texels", "views", "lights", "kv", "kl", "raw_bytes", "method", "encode_s",
                             "encode_cpu_s", "bytes", "rate", "relative_rmse"});
  for (const PaperRow& row : rows) {
    const std::vector<std::string> start = {
        absl::StrCat(row.side, "x", row.side), "81", "81", absl::StrCat(row.kv), absl::StrCat(row.kl),
        absl::StrCat(row.RawBytes())};
    const auto add = [&](const std::vector<std::string>& rest) {
      std::vector<std::string> cells = start;
      cells.insert(cells.end(), rest.begin(), rest.end());
      csv += CsvLine(cells);
    };
    add({"paper", absl::StrCat(row.paper_s), "", "", absl::StrFormat("%.4f", row.paper_rate), ""});
    for (const PaperRun& run : row.runs) {
      add({run.method, absl::StrFormat("%.3f", run.encode_s), absl::StrFormat("%.3f", run.encode_cpu_s),
           absl::StrCat(run.size_bytes),
           absl::StrFormat("%.6f", static_cast<double>(run.size_bytes) / static_cast<double>(row.RawBytes())),
           absl::StrFormat("%.5f", run.relative_rmse)});
    }
  }
  return csv;
}

}  // namespace tessera
