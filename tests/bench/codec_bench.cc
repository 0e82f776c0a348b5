// Encoding against its two bare products: the time of dsh-cls on 128x128 texels, 81 views x 81 lights, 25x25
// coefficients, over that of the two Eigen products of the same shapes and data sizes in the same run, with
// the same threads. Also the embedding and the decoder, as absolute figures. CSV on stdout.
//
//   codec_bench [runs]      exits 1 when the ratio of the best runs is above 3
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <memory>
#include <vector>

#include <Eigen/Core>

#include "btf/base/parallel.h"
#include "btf/base/rng.h"
#include "btf/base/status_macros.h"
#include "btf/codec/codec.h"
#include "btf/codec/decoder.h"
#include "btf/data/btf_source.h"

namespace tessera {
namespace {

using Clock = std::chrono::steady_clock;
constexpr double kLargestRatio = 3.0;
constexpr int kSize = 128;
constexpr int kCoefficients = 25;

double SecondsSince(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

// The UBO2003 directions.
std::vector<Direction> Ubo81() {
  constexpr int kCounts[] = {1, 6, 12, 18, 20, 24};
  std::vector<Direction> directions;
  for (int ring = 0; ring < 6; ++ring) {
    for (int i = 0; i < kCounts[ring]; ++i) {
      directions.push_back({RadFromDeg(15.0 * ring), 2.0 * kPi * i / kCounts[ring]});
    }
  }
  return directions;
}

// One prepared row, copied for every request; the copies' time is taken out of the encoder's.
class RepeatedRow final : public BtfSource {
 public:
  RepeatedRow() {
    info_.width = kSize;
    info_.height = kSize;
    info_.views = Ubo81();
    info_.lights = Ubo81();
    row_.resize(SamplesPerRow());
    Rng rng(1);
    size_t index = 0;
    for (int x = 0; x < kSize; ++x) {
      const Eigen::Vector3d normal =
          Eigen::Vector3d(rng.NextDouble() - 0.5, rng.NextDouble() - 0.5, 1.0).normalized();
      for (int channel = 0; channel < 3; ++channel) {
        const double albedo = rng.NextDouble();
        for (const Direction& view : info_.views) {
          for (const Direction& light : info_.lights) {
            const Eigen::Vector3d wi = VectorFromDirection(light);
            const double lobe = normal.dot((wi + VectorFromDirection(view)).normalized());
            row_[index++] = static_cast<float>(albedo * std::max(0.0, normal.dot(wi)) +
                                               0.3 * lobe * lobe * lobe + 0.02 * rng.NextDouble());
          }
        }
      }
    }
  }
  [[nodiscard]] const BtfInfo& info() const override { return info_; }
  [[nodiscard]] absl::Status ReadRows(int /*row_begin*/, int num_rows, std::span<float> samples,
                                      const RunContext& context) override {
    const Clock::time_point start = Clock::now();
    ParallelFor(context, 0, num_rows, 1, [&](int64_t first, int64_t last) {
      for (int64_t row = first; row < last; ++row) {
        std::ranges::copy(row_, samples.begin() + static_cast<ptrdiff_t>(row_.size()) * row);
      }
    });
    seconds_ += SecondsSince(start);
    return absl::OkStatus();
  }
  [[nodiscard]] double TakeSeconds() { return std::exchange(seconds_, 0.0); }
  [[nodiscard]] const std::vector<float>& row() const { return row_; }

 private:
  BtfInfo info_;
  std::vector<float> row_;
  double seconds_ = 0.0;
};

// Seconds of P [25][81] times [81][signals], one signal a column, two texels' signals a product. The samples
// come from a buffer larger than the caches, as the encoder's do; result pages are there before the clock
// starts.
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
  RunContext context;
  RepeatedRow source;
  const Codec* codec = FindCodec("dsh-cls");
  constexpr int kDirections = 81;
  const int64_t light_signals = int64_t{kSize} * kSize * 3 * kDirections;
  const int64_t view_signals = int64_t{kSize} * kSize * 3 * kCoefficients;
  constexpr int kRows = 6;  // 64 MB of samples
  const Eigen::MatrixXf samples =
      Eigen::Map<const Eigen::MatrixXf>(source.row().data(), kDirections, kSize * 3 * kDirections)
          .replicate(1, kRows);

  double encode = std::numeric_limits<double>::infinity();
  double bare = encode;
  Material material;
  std::printf("name,value,unit,limit,verdict\n");
  for (int run = 0; run < runs; ++run) {
    const double bare_light = BareProduct(samples, light_signals, context);
    const double bare_view = BareProduct(samples, view_signals, context);
    const Clock::time_point start = Clock::now();
    absl::StatusOr<Material> result =
        codec->Encode(source, {.kl = kCoefficients, .kv = kCoefficients}, context);
    const double seconds = SecondsSince(start) - source.TakeSeconds();
    if (!result.ok()) {
      std::fprintf(stderr, "%s\n", result.status().ToString().c_str());
      return EXIT_FAILURE;
    }
    material = *std::move(result);
    std::printf("run %d: encode,%.3f,s,,\nrun %d: bare products,%.3f,s,,\n", run, seconds, run,
                bare_light + bare_view);
    encode = std::min(encode, seconds);
    bare = std::min(bare, bare_light + bare_view);
  }
  const double ratio = encode / bare;
  std::printf("encode / bare products (best of each),%.2f,,%.1f,%s\n", ratio, kLargestRatio,
              ratio <= kLargestRatio ? "ok" : "missed");

  const Clock::time_point embed_start = Clock::now();
  const absl::StatusOr<Embedding> embedding = codec->Embed(material, 32, context);
  const double embed = SecondsSince(embed_start);
  const absl::StatusOr<std::unique_ptr<Decoder>> decoder = MakeDecoder(material.btfels);
  if (!embedding.ok() || !decoder.ok()) {
    return EXIT_FAILURE;
  }
  const Clock::time_point decode_start = Clock::now();
  constexpr int kDecodes = 4096;
  double sum = 0.0;
  for (int i = 0; i < kDecodes; ++i) {
    sum += (*decoder)->Decode(material.btfels.btfel(i), {0, 0.6, 0.8}, {0.6, 0, 0.8}, 0).sum();
  }
  std::printf("embed in 32 dimensions,%.3f,s,,\ndecode a texel (checksum %.3f),%.2f,us,,\n", embed, sum,
              SecondsSince(decode_start) / kDecodes * 1e6);
  return ratio <= kLargestRatio ? EXIT_SUCCESS : EXIT_FAILURE;
}

}  // namespace
}  // namespace tessera

int main(int argc, char** argv) {
  return tessera::Run(argc > 1 ? std::max(1, std::atoi(argv[1])) : 5);
}
