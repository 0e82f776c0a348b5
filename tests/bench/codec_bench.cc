// Encoding of every codec on 128x128 texels, 81 views x 81 lights, and the embedding. `dsh*`, 25x25, against
// the bare Eigen products of the same shapes and data sizes in the same run, with the same threads: one of
// 25x81 a pass, for dsh-cls also the rotation back by Q, 25x25. CSV on stdout.
//
//   codec_bench [runs]      exits 1 when the best runs are above a limit
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <string>

#include <Eigen/Core>

#include "btf/base/parallel.h"
#include "btf/codec/codec.h"
#include "tests/bench/repeated_row.h"

namespace tessera {
namespace {

using bench::kSize;
using Clock = std::chrono::steady_clock;
constexpr int kCoefficients = 25;
constexpr int kDfmfRank = 32;
constexpr int kDirections = 81;
// Encoding may take so many seconds on two cores.
constexpr double kDfmfSeconds = 20.0;
constexpr double kViewPcaSeconds = 10.0;
constexpr int64_t kLightSignals = int64_t{kSize} * kSize * 3 * kDirections;
constexpr int64_t kViewSignals = int64_t{kSize} * kSize * 3 * kCoefficients;

double SecondsSince(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

// Seconds of P [25][rows] times [rows][signals], one signal a column, two texels' signals a product. The
// samples come from a buffer larger than the caches, as the encoder's do; result pages are there before the
// clock starts.
double BareProduct(const Eigen::MatrixXf& samples, int64_t num_signals, const RunContext& context) {
  constexpr int64_t kSignalsPerProduct = 486;
  const Eigen::MatrixXf projection = Eigen::MatrixXf::Random(kCoefficients, samples.rows());
  Eigen::MatrixXf result = Eigen::MatrixXf::Zero(kCoefficients, num_signals);
  const Clock::time_point start = Clock::now();
  const int64_t num_blocks = samples.cols() / kSignalsPerProduct;
  ParallelFor(context, 0, num_signals, kSignalsPerProduct, [&](int64_t first, int64_t last) {
    const int64_t block = first / kSignalsPerProduct % num_blocks;
    result.middleCols(first, last - first).noalias() =
        projection * samples.middleCols(block * kSignalsPerProduct, last - first);
  });
  return SecondsSince(start);
}

int Run(int runs) {
  const RunContext context;
  bench::RepeatedRow source;
  constexpr int kRows = 6;  // 64 MB of samples
  const Eigen::MatrixXf samples =
      Eigen::Map<const Eigen::MatrixXf>(source.row().data(), kDirections, kSize * 3 * kDirections)
          .replicate(1, kRows);
  const Eigen::MatrixXf coefficients = samples.topRows(kCoefficients);

  bool ok = true;
  std::printf("name,value,unit,limit,verdict\n");
  for (const std::string_view id : CodecIds()) {
    const Codec* const codec = FindCodec(id);
    const std::string name(id);
    const bool is_dsh = name.starts_with("dsh");
    double encode = std::numeric_limits<double>::infinity();
    double bare = encode;
    Material material;
    for (int run = 0; run < runs; ++run) {
      if (is_dsh) {
        double seconds =
            BareProduct(samples, kLightSignals, context) + BareProduct(samples, kViewSignals, context);
        if (id == "dsh-cls") {
          seconds += BareProduct(coefficients, kLightSignals, context) +
                     BareProduct(coefficients, kViewSignals, context);
        }
        bare = std::min(bare, seconds);
      }
      const Clock::time_point start = Clock::now();
      absl::StatusOr<Material> result =
          codec->Encode(source, {.kl = kCoefficients, .kv = kCoefficients, .rank = kDfmfRank}, context);
      const double seconds = SecondsSince(start) - source.TakeSeconds();
      if (!result.ok()) {
        std::fprintf(stderr, "%s: %s\n", name.c_str(), result.status().ToString().c_str());
        return EXIT_FAILURE;
      }
      material = *std::move(result);
      encode = std::min(encode, seconds);
    }
    if (!is_dsh) {
      const double limit = id == "dfmf" ? kDfmfSeconds : kViewPcaSeconds;
      std::printf("encode %s,%.3f,s,%.0f,%s\n", name.c_str(), encode, limit,
                  encode <= limit ? "ok" : "missed");
      ok &= encode <= limit;
    } else {
      std::printf("encode %s,%.3f,s,,\n", name.c_str(), encode);
      const double limit = id == "dsh-cls" ? 2.5 : 1.5;
      std::printf("bare products for %s,%.3f,s,,\n", name.c_str(), bare);
      std::printf("encode %s / bare products,%.2f,ratio,%.1f,%s\n", name.c_str(), encode / bare, limit,
                  encode <= limit * bare ? "ok" : "missed");
      ok &= encode <= limit * bare;
    }
    const Clock::time_point start = Clock::now();
    if (!codec->Embed(material, 32, context).ok()) {
      return EXIT_FAILURE;
    }
    std::printf("embed %s in 32 dimensions,%.3f,s,,\n", name.c_str(), SecondsSince(start));
    std::fflush(stdout);
  }
  return ok ? EXIT_SUCCESS : EXIT_FAILURE;
}

}  // namespace
}  // namespace tessera

int main(int argc, char** argv) {
  return tessera::Run(argc > 1 ? std::max(1, std::atoi(argv[1])) : 5);
}
