// Dressing of 100,000 quads: a torus of 400 x 250, for each arrangement. CSV on stdout.
//
//   dress_bench [runs]      exits 1 when the best run is above the limit
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <string>

#include <Eigen/Core>

#include "btf/math/conventions.h"
#include "btf/wang/dress.h"

namespace tessera {
namespace {

constexpr int kMajorQuads = 400;
constexpr int kMinorQuads = 250;
constexpr double kMajorRadius = 0.7;
constexpr double kMinorRadius = 0.45;
constexpr double kLimitMs = 100.0;

QuadMesh MakeTorus() {
  QuadMesh mesh;
  for (int i = 0; i < kMajorQuads; ++i) {
    const double u = 2.0 * kPi * i / kMajorQuads;
    const Eigen::Vector3d outward(std::sin(u), 0.0, std::cos(u));
    for (int j = 0; j < kMinorQuads; ++j) {
      const double v = 2.0 * kPi * j / kMinorQuads;
      const Eigen::Vector3d normal = std::cos(v) * outward + std::sin(v) * Eigen::Vector3d::UnitY();
      mesh.positions.push_back((kMajorRadius * outward + kMinorRadius * normal).cast<float>());
      mesh.normals.push_back(normal.cast<float>());
      const auto at = [](int a, int b) {
        return static_cast<uint32_t>(a % kMajorQuads * kMinorQuads + b % kMinorQuads);
      };
      mesh.quads.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  }
  return mesh;
}

int Run(int runs) {
  const QuadMesh mesh = MakeTorus();
  const DressParams params{.target_quads = static_cast<uint32_t>(mesh.quads.size())};
  bool ok = true;
  std::printf("name,value,unit,limit,verdict\n");
  for (const Arrangement& arrangement : BuiltinArrangements()) {
    double best = std::numeric_limits<double>::infinity();
    size_t num_quads = 0;
    for (int run = 0; run < runs; ++run) {
      const auto start = std::chrono::steady_clock::now();
      const absl::StatusOr<DressResult> dressed = DressMesh(mesh, arrangement, params, RunContext{});
      best = std::min(
          best, std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count());
      if (!dressed.ok()) {
        std::fprintf(stderr, "%s: %s\n", arrangement.id.c_str(), dressed.status().ToString().c_str());
        return EXIT_FAILURE;
      }
      num_quads = dressed->dressing.mesh.quads.size();
    }
    std::printf("dress %zu quads for %s,%.1f,ms,%.0f,%s\n", num_quads, arrangement.id.c_str(), best, kLimitMs,
                best <= kLimitMs ? "ok" : "missed");
    ok &= best <= kLimitMs;
  }
  return ok ? EXIT_SUCCESS : EXIT_FAILURE;
}

}  // namespace
}  // namespace tessera

int main(int argc, char** argv) {
  return tessera::Run(argc > 1 ? std::max(1, std::atoi(argv[1])) : 5);
}
