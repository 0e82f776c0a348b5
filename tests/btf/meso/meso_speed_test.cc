// The size of the main job: 128x128 texels, 81 views, 81 lights, 16 area samples, 2 bounces.
#include <chrono>
#include <cstdio>

#include <sys/resource.h>

#include <gtest/gtest.h>

#include "btf/meso/generate.h"
#include "tests/btf/meso/small_fields.h"

namespace tessera {
namespace {

double CpuSeconds(const rusage& usage) {
  return static_cast<double>(usage.ru_utime.tv_sec + usage.ru_stime.tv_sec) +
         1e-6 * static_cast<double>(usage.ru_utime.tv_usec + usage.ru_stime.tv_usec);
}

TEST(MesoSpeedTest, TheMainJobStaysWithinItsTimeAndMemory) {
  // 40 s on two quiet cores are 80 CPU seconds; CPU time does not depend on what else runs.
  constexpr double kCpuLimit = 80.0;
  constexpr double kMemoryLimitMib = 700.0;
  rusage before{};
  getrusage(RUSAGE_SELF, &before);
  const auto start = std::chrono::steady_clock::now();
  const auto seconds = [&] {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  };
  GenerateParams params;
  params.kind = "reactdiffuse";
  params.views = UboDirections();
  params.lights = UboDirections();
  auto source = GenerateBtf(params, {});
  ASSERT_TRUE(source.ok()) << source.status();
  EXPECT_EQ((*source)->info().provenance.source, "generated:reactdiffuse");  // the defaults need no naming
  const double generated = seconds();
  std::vector<float> rows((*source)->SamplesPerRow() * 8);
  for (int row = 0; row < 128; row += 8) {
    ASSERT_TRUE((*source)->ReadRows(row, 8, rows, {}).ok());
  }
  rusage after{};
  getrusage(RUSAGE_SELF, &after);
  const double cpu = CpuSeconds(after) - CpuSeconds(before);
  const double mib = static_cast<double>(after.ru_maxrss) / 1024.0;
  std::printf("reactdiffuse 128x128x81x81: GenerateBtf %.1f s, ReadRows %.1f s, %.1f CPU s, %.0f MiB\n",
              generated, seconds() - generated, cpu, mib);
  EXPECT_LT(cpu, kCpuLimit);
  EXPECT_LT(mib, kMemoryLimitMib);
}

}  // namespace
}  // namespace tessera
