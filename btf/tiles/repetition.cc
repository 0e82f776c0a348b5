#include "btf/tiles/repetition.h"

#include <algorithm>
#include <complex>
#include <cstdlib>
#include <memory>
#include <vector>

#include <kiss_fftnd.h>

#include "btf/base/parallel.h"
#include "btf/base/status_macros.h"
#include "btf/tiles/tile_sides.h"
#include "btf/wang/dress.h"

namespace tessera {
namespace {

constexpr int kTilesAcross = 16;
constexpr int kLargestSide = 1024;  // of a plane that is not averaged down

using Complex = std::complex<float>;
static_assert(sizeof(kiss_fft_cpx) == sizeof(Complex));

// Points of the embedding, one a pixel.
struct Field {
  int width = 0;
  int height = 0;
  std::vector<const float*> points;  // [height][width]
};

Field FieldOfExemplar(const Exemplar& exemplar) {
  Field field{exemplar.width(), exemplar.height(), {}};
  for (int pixel = 0; pixel < exemplar.num_pixels(); ++pixel) {
    field.points.push_back(exemplar.Point(static_cast<uint32_t>(pixel)));
  }
  return field;
}

absl::StatusOr<Field> FieldOfPlane(const Exemplar& exemplar, const Arrangement& arrangement,
                                   const IndexMaps& maps, const RunContext& context) {
  QuadMesh mesh;
  const auto vertex = [](int i, int j) { return static_cast<uint32_t>(j * (kTilesAcross + 1) + i); };
  for (int j = 0; j <= kTilesAcross; ++j) {
    for (int i = 0; i <= kTilesAcross; ++i) {
      mesh.positions.emplace_back(static_cast<float>(i), static_cast<float>(j), 0.0f);
      mesh.normals.emplace_back(0.0f, 0.0f, 1.0f);
      if (i < kTilesAcross && j < kTilesAcross) {
        mesh.quads.push_back({vertex(i, j), vertex(i + 1, j), vertex(i + 1, j + 1), vertex(i, j + 1)});
      }
    }
  }
  RunContext quiet = context;
  quiet.progress = nullptr;
  TESSERA_ASSIGN_OR_RETURN(
      const DressResult dressed,
      DressMesh(mesh, arrangement, {.target_quads = static_cast<uint32_t>(mesh.quads.size())}, quiet));
  const Dressing& dressing = dressed.dressing;
  const int size = maps.tile_size;
  const int side = kTilesAcross * size;
  Field field{side, side, std::vector<const float*>(static_cast<size_t>(side) * side)};
  for (size_t quad = 0; quad < dressing.mesh.quads.size(); ++quad) {
    const Eigen::Vector3f corner = dressing.mesh.positions[dressing.mesh.quads[quad][0]];
    const int left = static_cast<int>(corner.x()) * size;
    const int top = (kTilesAcross - 1 - static_cast<int>(corner.y())) * size;
    const auto tile = static_cast<int>(dressing.tile[quad]);
    for (int v = 0; v < size; ++v) {
      for (int u = 0; u < size; ++u) {
        const auto [x, y] = TilePixelBeforeTurns(u, v, dressing.turns[quad], size);
        field.points[static_cast<size_t>(top + v) * side + left + u] =
            exemplar.Point(TurnTexel(maps.texel(tile, x, y), dressing.turns[quad]));
      }
    }
  }
  return field;
}

// The mean of dimension `dim` over each shrink x shrink pixels, about the mean of all.
std::vector<float> Channel(const Field& field, int dim, int shrink) {
  const int width = field.width / shrink;
  const int height = field.height / shrink;
  std::vector<float> values(static_cast<size_t>(width) * height, 0.0f);
  double sum = 0.0;
  for (int y = 0; y < height * shrink; ++y) {
    for (int x = 0; x < width * shrink; ++x) {
      const float value =
          field.points[static_cast<size_t>(y) * field.width + x][dim] / static_cast<float>(shrink * shrink);
      values[static_cast<size_t>(y / shrink) * width + x / shrink] += value;
      sum += value;
    }
  }
  const auto mean = static_cast<float>(sum / static_cast<double>(values.size()));
  for (float& value : values) {
    value -= mean;
  }
  return values;
}

// See MeasureRepetition. Shifts in averaged pixels: at least `least` along one axis, up to `share` of a side.
absl::StatusOr<double> HighestPeak(const Field& field, int dims, int shrink, int least, double share,
                                   const RunContext& context) {
  const int width = field.width / shrink;
  const int height = field.height / shrink;
  const int most_x = static_cast<int>(share * width);
  const int most_y = static_cast<int>(share * height);
  // Padded, so that no shift looked at wraps around.
  const int padded_width = kiss_fft_next_fast_size(width + most_x);
  const int padded_height = kiss_fft_next_fast_size(height + most_y);
  const size_t padded = static_cast<size_t>(padded_width) * padded_height;
  const std::array<int, 2> extents = {padded_height, padded_width};
  using Plan = std::unique_ptr<kiss_fftnd_state, decltype(&free)>;
  const Plan forward(kiss_fftnd_alloc(extents.data(), 2, 0, nullptr, nullptr), &free);
  const Plan inverse(kiss_fftnd_alloc(extents.data(), 2, 1, nullptr, nullptr), &free);
  const auto transform = [](const Plan& plan, const std::vector<Complex>& in, std::vector<Complex>& out) {
    kiss_fftnd(plan.get(), reinterpret_cast<const kiss_fft_cpx*>(in.data()),
               reinterpret_cast<kiss_fft_cpx*>(out.data()));
  };
  // Two dimensions a transform: the real part of the autocorrelation of x + i y is that of x and that of y.
  std::vector<Complex> power(padded);
  std::vector<Complex> plane(padded);
  std::vector<Complex> spectrum(padded);
  for (int dim = 0; dim < dims; dim += 2) {
    const std::vector<float> real = Channel(field, dim, shrink);
    const std::vector<float> imaginary =
        dim + 1 < dims ? Channel(field, dim + 1, shrink) : std::vector<float>(real.size(), 0.0f);
    std::ranges::fill(plane, Complex());
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        const size_t index = static_cast<size_t>(y) * width + x;
        plane[static_cast<size_t>(y) * padded_width + x] = {real[index], imaginary[index]};
      }
    }
    transform(forward, plane, spectrum);
    for (size_t i = 0; i < padded; ++i) {
      power[i] += std::norm(spectrum[i]);
    }
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
  }
  transform(inverse, power, plane);
  const double at_rest = plane[0].real() / (static_cast<double>(width) * height);
  double peak = 0.0;
  for (int dy = 0; dy <= most_y; ++dy) {
    for (int dx = -most_x; dx <= most_x && at_rest > 0.0; ++dx) {
      if (std::max(std::abs(dx), dy) >= least) {
        const double overlap = static_cast<double>(width - std::abs(dx)) * (height - dy);
        const size_t column = dx < 0 ? padded_width + dx : dx;
        peak =
            std::max(peak, plane[dy * static_cast<size_t>(padded_width) + column].real() / overlap / at_rest);
      }
    }
  }
  return peak;
}

}  // namespace

absl::StatusOr<nlohmann::json> MeasureRepetition(const Exemplar& exemplar, const Arrangement& arrangement,
                                                 const IndexMaps& maps, int strip_height,
                                                 const RunContext& context) {
  const int shrink = (kTilesAcross * maps.tile_size + kLargestSide - 1) / kLargestSide;
  const int least = std::max(1, strip_height / shrink);
  const int dims = exemplar.search_dims();
  TESSERA_ASSIGN_OR_RETURN(const Field plane, FieldOfPlane(exemplar, arrangement, maps, context));
  constexpr double kPlaneShare = 0.25;
  constexpr double kExemplarShare = 0.5;
  TESSERA_ASSIGN_OR_RETURN(const double plane_peak,
                           HighestPeak(plane, dims, shrink, least, kPlaneShare, context));
  TESSERA_ASSIGN_OR_RETURN(const double exemplar_peak, HighestPeak(FieldOfExemplar(exemplar), dims, shrink,
                                                                   least, kExemplarShare, context));
  return nlohmann::json{{"plane_peak", plane_peak},
                        {"exemplar_peak", exemplar_peak},
                        {"ratio", exemplar_peak > 0.0 ? plane_peak / exemplar_peak : 1.0}};
}

}  // namespace tessera
