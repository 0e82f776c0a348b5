// Decoding on one core, every codec: random access (one texel, light and view a time) and streaming (all
// texels of one light and view), as shares of the memory bandwidth and of the arithmetic peak measured in the
// same run. Times are the thread's own, so that others on the machine do not count. CSV on stdout.
//
//   decode_bench      exits 1 when streaming reaches neither 40% of the one nor of the other
#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <limits>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "btf/base/cpu_time.h"
#include "btf/base/rng.h"
#include "btf/codec/codec.h"
#include "btf/codec/decoder.h"
#include "tests/bench/repeated_row.h"

namespace tessera {
namespace {

constexpr double kLeastShare = 0.4;
constexpr int kRounds = 7;
// Rounds go on so long: other programs slow a processor for a good part of a second.
constexpr double kLeastSeconds = 0.5;

double BestSeconds(const std::function<void()>& work) {
  double best = std::numeric_limits<double>::infinity();
  const double first = ThreadCpuSeconds();
  for (int round = 0; round < kRounds || ThreadCpuSeconds() - first < kLeastSeconds; ++round) {
    const double start = ThreadCpuSeconds();
    work();
    best = std::min(best, ThreadCpuSeconds() - start);
  }
  return best;
}

// Bytes a second of summing a buffer far larger than the caches.
double MemoryBandwidth(double* checksum) {
  const std::vector<uint64_t> buffer(size_t{32} << 20, 1);
  const double seconds = BestSeconds([&] {
    std::array<uint64_t, 32> sums{};
    for (size_t i = 0; i < buffer.size(); i += sums.size()) {
      for (size_t lane = 0; lane < sums.size(); ++lane) {
        sums[lane] += buffer[i + lane];
      }
    }
    for (const uint64_t sum : sums) {
      *checksum += static_cast<double>(sum);
    }
  });
  return static_cast<double>(buffer.size() * sizeof(uint64_t)) / seconds;
}

// Float operations a second of a product of matrices that stay in the caches.
double ArithmeticPeak(double* checksum) {
  constexpr Eigen::Index kSide = 384;
  const Eigen::MatrixXf a = Eigen::MatrixXf::Random(kSide, kSide);
  const Eigen::MatrixXf b = Eigen::MatrixXf::Random(kSide, kSide);
  Eigen::MatrixXf c(kSide, kSide);
  const double seconds = BestSeconds([&] { c.noalias() = a * b; });
  *checksum += static_cast<double>(c.sum());
  return 2.0 * kSide * kSide * kSide / seconds;
}

// Bytes of a BTFel's codes that a form makes the memory deliver: whole lines of 64.
double BytesTouched(const LinearForm& form, int num_coefficients) {
  constexpr int kLine = 64;
  std::set<int> lines;
  for (const LinearForm::Run& run : form.runs) {
    for (int i = run.first / kLine; i <= (run.first + run.count - 1) / kLine; ++i) {
      lines.insert(i);
    }
  }
  return std::min<double>(num_coefficients, static_cast<double>(kLine * lines.size()));
}

int Run() {
  double checksum = 0.0;
  std::printf("name,value,unit,limit,verdict\n");
  bench::RepeatedRow source;
  bool ok = true;
  for (const std::string_view id : CodecIds()) {
    const std::string name(id);
    const absl::StatusOr<Material> material = FindCodec(id)->Encode(source, {}, {});
    if (!material.ok()) {
      std::fprintf(stderr, "%s: %s\n", name.c_str(), material.status().ToString().c_str());
      return EXIT_FAILURE;
    }
    const BtfelTable& table = material->btfels;
    const absl::StatusOr<std::unique_ptr<Decoder>> decoder = MakeDecoder(table);
    if (!decoder.ok()) {
      std::fprintf(stderr, "%s: %s\n", name.c_str(), decoder.status().ToString().c_str());
      return EXIT_FAILURE;
    }

    constexpr int kDecodes = 4096;
    struct Query {
      size_t texel;
      Eigen::Vector3d light, view;
    };
    std::vector<Query> queries;
    Rng rng(1);
    for (int i = 0; i < kDecodes; ++i) {
      const auto direction = [&] {
        return VectorFromDirection({1.4 * rng.NextDouble(), 2.0 * kPi * rng.NextDouble()});
      };
      queries.push_back({rng.NextBelow(table.size()), direction(), direction()});
    }
    double used = 0.0;  // coefficients that take part, a decode
    for (const Query& query : queries) {
      used += static_cast<double>((*decoder)->Form(query.light, query.view).weights.size()) / kDecodes;
    }
    // Anew for each codec: a shared machine is not equally fast all the time.
    const double bandwidth = MemoryBandwidth(&checksum);
    const double peak = ArithmeticPeak(&checksum);
    std::printf("memory bandwidth for %s,%.2f,GB/s,,\narithmetic peak for %s,%.1f,GFLOP/s,,\n", name.c_str(),
                bandwidth * 1e-9, name.c_str(), peak * 1e-9);
    const double random = BestSeconds([&] {
      for (const Query& query : queries) {
        checksum += (*decoder)->Decode(table.btfel(query.texel), query.light, query.view, 0).sum();
      }
    });
    std::printf("%s random access,%.3f,us,,\n", name.c_str(), random / kDecodes * 1e6);
    std::printf("%s random access by bandwidth,%.4f,share,,\n", name.c_str(),
                used * kDecodes / random / bandwidth);
    std::printf("%s random access by peak,%.4f,share,,\n", name.c_str(),
                2.0 * used * kDecodes / random / peak);

    const Eigen::Vector3d light(0.0, 0.6, 0.8);
    const Eigen::Vector3d view(0.36, 0.48, 0.8);
    std::vector<float> rgb(table.size() * 3);
    const double streaming = BestSeconds([&] { (*decoder)->DecodeTexels(table.codes, light, view, 0, rgb); });
    checksum += rgb[rgb.size() / 2];
    const LinearForm form = (*decoder)->Form(light, view);
    const double bytes = static_cast<double>(table.size()) * (BytesTouched(form, table.num_coefficients) +
                                                              3.0 * static_cast<double>(sizeof(float)));
    const double operations = 2.0 * static_cast<double>(form.weights.size() * table.size());
    const double by_bandwidth = bytes / streaming / bandwidth;
    const double by_peak = operations / streaming / peak;
    const bool reached = std::max(by_bandwidth, by_peak) >= kLeastShare;
    ok &= reached;
    std::printf("%s streaming,%.2f,ns a texel,,\n", name.c_str(),
                streaming / static_cast<double>(table.size()) * 1e9);
    std::printf("%s streaming by bandwidth,%.3f,share,%.1f,%s\n", name.c_str(), by_bandwidth, kLeastShare,
                reached ? "ok" : "missed");
    std::printf("%s streaming by peak,%.3f,share,,\n", name.c_str(), by_peak);
    std::fflush(stdout);
  }
  std::fprintf(stderr, "checksum %g\n", checksum);
  return ok ? EXIT_SUCCESS : EXIT_FAILURE;
}

}  // namespace
}  // namespace tessera

int main() {
  return tessera::Run();
}
