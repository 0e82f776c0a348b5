// The largest published BTFs within a fixed amount of memory: 800x800 texels, 81 views x 81 lights, the size
// of FLOORTILE (12.6 GB) in [Leung2007], with noise in every sample, made while it is read. The process may
// not have more than 1 GiB of its own, by RLIMIT_DATA; the encoder gets three quarters of that as its budget.
// What counts is the time of the encoder over that of the source and of the bare matrix products of the same
// shapes, all of the same run; processor time beside it, which other programs disturb less. CSV on stdout,
// progress on stderr; minutes a codec, and up to 6 GB of temporary files.
//
//   out_of_core_bench [size [codec..]]      exits 1 when a codec takes more than twice that or fails
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <sys/resource.h>
#include <Eigen/Core>

#include "btf/base/parallel.h"
#include "btf/base/sha256.h"
#include "btf/base/status_macros.h"
#include "btf/codec/codec.h"
#include "btf/codec/dfmf/sample_matrix.h"
#include "btf/data/direction_sets.h"
#include "tests/support/noise_btf.h"

namespace tessera {
namespace {

using Clock = std::chrono::steady_clock;
constexpr double kLargestRatio = 2.0;
constexpr uint64_t kMiB = uint64_t{1} << 20;
constexpr uint64_t kProcessBytes = 1024 * kMiB;
constexpr uint64_t kBudgetBytes = 768 * kMiB;

// Seconds on the clock, and of all threads on processors.
struct Seconds {
  double wall = 0.0;
  double cpu = 0.0;

  static Seconds Now() {
    timespec cpu{};
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &cpu);
    return {std::chrono::duration<double>(Clock::now().time_since_epoch()).count(),
            static_cast<double>(cpu.tv_sec) + 1e-9 * static_cast<double>(cpu.tv_nsec)};
  }
  friend Seconds operator-(const Seconds& a, const Seconds& b) { return {a.wall - b.wall, a.cpu - b.cpu}; }
  Seconds& operator+=(const Seconds& other) {
    wall += other.wall;
    cpu += other.cpu;
    return *this;
  }
};

// The source, timed on both clocks.
class TimedNoise final : public BtfSource {
 public:
  TimedNoise(int size, const std::vector<Direction>& directions)
      : noise_(size, size, directions, directions) {}
  [[nodiscard]] const BtfInfo& info() const override { return noise_.info(); }
  [[nodiscard]] absl::Status ReadRows(int row_begin, int num_rows, std::span<float> samples,
                                      const RunContext& context) override {
    const Seconds start = Seconds::Now();
    TESSERA_RETURN_IF_ERROR(noise_.ReadRows(row_begin, num_rows, samples, context));
    seconds_ += Seconds::Now() - start;
    return absl::OkStatus();
  }
  [[nodiscard]] const Seconds& seconds() const { return seconds_; }

 private:
  NoiseBtf noise_;
  Seconds seconds_;
};

// `count` products [rows][inner] times [inner][columns].
struct Product {
  int rows;
  int inner;
  int columns;
  int64_t count;
};

// What a codec cannot do without, for `texels` texels of n views and n lights.
std::vector<Product> ProductsOf(std::string_view codec, int64_t texels, int n) {
  if (codec.starts_with("dsh")) {
    // [Leung2007, 3.1]: the lights of every view, then the views of every light coefficient; constrained
    // least squares also rotates both back by Q.
    constexpr int kCoefficients = 25;
    std::vector<Product> products = {{kCoefficients, n, 3 * n, texels},
                                     {kCoefficients, n, 3 * kCoefficients, texels}};
    if (codec == "dsh-cls") {
      products.push_back({kCoefficients, kCoefficients, 3 * n, texels});
      products.push_back({kCoefficients, kCoefficients, 3 * kCoefficients, texels});
    }
    return products;
  }
  if (codec == "dfmf") {
    // Onto the space and back in every pass of the Lanczos iteration, and once onto what it found, for
    // luminance and for half as many candidates of both chrominances; 64 texels a product.
    constexpr int kTexels = 64;
    const int pairs = n * n;
    const int64_t count = (2 * kLanczosPasses + 1) * texels / kTexels;
    return {{kDefaultDfmfRank, pairs, kTexels, count}, {kDefaultDfmfRank / 2, 2 * pairs, kTexels, count}};
  }
  // "view-pca": half of a symmetric covariance of the lights, and five eigen-textures, of every view.
  constexpr int kEigenTextures = 5;
  return {{(n + 1) / 2, n, 3 * n, texels}, {kEigenTextures, n, 3 * n, texels}};
}

// Time of the share `part` of the products. The operands come from a buffer larger than the caches, as an
// encoder's samples do.
Seconds BareProducts(const std::vector<Product>& products, double part, const RunContext& context) {
  Seconds seconds;
  for (const Product& product : products) {
    constexpr int64_t kBufferValues = int64_t{16} << 20;  // 64 MiB
    const int64_t num_operands = std::max<int64_t>(1, kBufferValues / (product.inner * product.columns));
    const Eigen::MatrixXf left = Eigen::MatrixXf::Random(product.rows, product.inner);
    const Eigen::MatrixXf right =
        Eigen::MatrixXf::Constant(product.inner, product.columns * num_operands, 0.5F);
    Eigen::MatrixXf result = Eigen::MatrixXf::Zero(product.rows, right.cols());
    const Seconds start = Seconds::Now();
    const auto total = static_cast<int64_t>(part * static_cast<double>(product.count));
    for (int64_t begin = 0; begin < total; begin += num_operands) {
      ParallelFor(context, 0, std::min(num_operands, total - begin), 2, [&](int64_t first, int64_t last) {
        const int64_t column = first * product.columns;
        const int64_t num_columns = (last - first) * product.columns;
        result.middleCols(column, num_columns).noalias() = left * right.middleCols(column, num_columns);
      });
    }
    seconds += Seconds::Now() - start;
  }
  return seconds;
}

// A figure of /proc/self/status in MiB.
double StatusMiB(std::string_view key) {
  std::ifstream status("/proc/self/status");
  std::string line;
  while (std::getline(status, line)) {
    if (line.starts_with(key)) {
      return std::strtod(line.c_str() + key.size() + 1, nullptr) / 1024.0;
    }
  }
  return -1.0;
}

// Reads the container piece by piece, as an upload does.
absl::Status HashContainer(const Material& material, uint64_t& size_bytes) {
  TESSERA_ASSIGN_OR_RETURN(const ContainerFile file, MaterialFile(material));
  size_bytes = file.size_bytes();
  std::string piece;
  Sha256 digest;
  for (uint64_t offset = 0; offset < size_bytes; offset += piece.size()) {
    piece.resize(std::min(kMiB, size_bytes - offset));
    TESSERA_RETURN_IF_ERROR(file.Read(offset, std::as_writable_bytes(std::span(piece))));
    digest.Update(std::as_bytes(std::span(piece)));
  }
  std::printf("container %s,%.1f,MB,,\n", digest.HexDigest().substr(0, 12).c_str(),
              static_cast<double>(size_bytes) * 1e-6);
  return absl::OkStatus();
}

// False when the codec misses a limit.
absl::StatusOr<bool> RunCodec(const std::string& id, int size, const std::vector<Direction>& directions) {
  const Codec* codec = FindCodec(id);
  if (codec == nullptr) {
    return absl::NotFoundError("no codec " + id);
  }
  RunContext context;
  int reported = 0;
  context.progress = [&](const Progress& p) {
    const int percent = static_cast<int>(100 * p.done / std::max<uint64_t>(p.total, 1));
    if (percent >= reported + 5 || percent < reported) {
      reported = percent;
      std::fprintf(stderr, "%s: %s %d%%\n", id.c_str(), std::string(p.stage).c_str(), percent);
    }
  };
  TimedNoise source(size, directions);
  const std::vector<Product> products =
      ProductsOf(id, int64_t{size} * size, static_cast<int>(directions.size()));
  std::ofstream("/proc/self/clear_refs") << "5";  // the high-water mark starts again

  // Half of the products before and half after, so that a machine that gets slower or faster weighs on both.
  Seconds least = BareProducts(products, 0.5, context);
  const Seconds start = Seconds::Now();
  TESSERA_ASSIGN_OR_RETURN(const Material material,
                           codec->Encode(source, {.memory_budget_bytes = kBudgetBytes}, context));
  const Seconds encode = Seconds::Now() - start;
  const double own_mib = StatusMiB("RssAnon");
  least += BareProducts(products, 0.5, context);
  std::printf("%s: encode,%.1f,s,,\n%s: of that the source,%.1f,s,,\n%s: bare products,%.1f,s,,\n",
              id.c_str(), encode.wall, id.c_str(), source.seconds().wall, id.c_str(), least.wall);
  least += source.seconds();
  const Seconds container_start = Seconds::Now();
  uint64_t container_bytes = 0;
  TESSERA_RETURN_IF_ERROR(HashContainer(material, container_bytes));
  std::printf("%s: container put together and hashed,%.1f,s,,\n", id.c_str(),
              (Seconds::Now() - container_start).wall);
  const double peak_mib = StatusMiB("VmHWM");
  const bool fits = peak_mib <= static_cast<double>(kProcessBytes / kMiB);
  std::printf("%s: own memory after encoding (RssAnon),%.0f,MiB,,\n", id.c_str(), own_mib);
  std::printf("%s: most memory at any time (VmHWM),%.0f,MiB,%llu,%s\n", id.c_str(), peak_mib,
              static_cast<unsigned long long>(kProcessBytes / kMiB), fits ? "ok" : "missed");
  const double ratio = encode.wall / least.wall;
  const bool fast = ratio <= kLargestRatio;
  std::printf("%s: encode / (bare products + source),%.2f,,%.1f,%s\n", id.c_str(), ratio, kLargestRatio,
              fast ? "ok" : "missed");
  std::printf("%s: the same in processor time,%.2f,,,\n", id.c_str(), encode.cpu / least.cpu);
  std::fflush(stdout);
  return fits && fast;
}

int Run(int size, std::vector<std::string> codecs) {
  const rlimit limit = {kProcessBytes, kProcessBytes};
  if (setrlimit(RLIMIT_DATA, &limit) != 0) {
    std::perror("setrlimit");
    return EXIT_FAILURE;
  }
  const absl::StatusOr<std::vector<Direction>> directions = DirectionSet("ubo81");
  if (!directions.ok()) {
    return EXIT_FAILURE;
  }
  if (codecs.empty()) {
    for (const std::string_view id : CodecIds()) {
      codecs.emplace_back(id);
    }
  }
  std::printf("name,value,unit,limit,verdict\n");
  bool all = true;
  for (const std::string& id : codecs) {
    const absl::StatusOr<bool> ok = RunCodec(id, size, *directions);
    if (!ok.ok()) {
      std::printf("%s: %s,,,,missed\n", id.c_str(), ok.status().ToString().c_str());
    }
    all = all && ok.ok() && *ok;
  }
  return all ? EXIT_SUCCESS : EXIT_FAILURE;
}

}  // namespace
}  // namespace tessera

int main(int argc, char** argv) {
  const int size = argc > 1 ? std::atoi(argv[1]) : 800;
  return tessera::Run(std::clamp(size, 1, 4096),
                      std::vector<std::string>(argv + std::min(argc, 2), argv + argc));
}
