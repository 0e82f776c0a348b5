#include "btf/meso/periodic_noise.h"

#include <algorithm>
#include <cmath>

#include "btf/base/rng.h"
#include "btf/math/conventions.h"

namespace tessera {
namespace {

constexpr int kWavePairs = 64;

int WrapIndex(int64_t i, int n) {
  const auto wrapped = static_cast<int>(i % n);
  return wrapped < 0 ? wrapped + n : wrapped;
}

std::array<float, 4> CatmullRom(float t) {
  const float t2 = t * t;
  const float t3 = t2 * t;
  return {0.5F * (-t3 + 2.0F * t2 - t), 0.5F * (3.0F * t3 - 5.0F * t2 + 2.0F),
          0.5F * (-3.0F * t3 + 4.0F * t2 + t), 0.5F * (t3 - t2)};
}

void AddWave(PeriodicField& field, double periods_x, double periods_y, double phase, float amplitude) {
  const int n = field.n;
  std::vector<float> cos_x(n);
  std::vector<float> sin_x(n);
  for (int i = 0; i < n; ++i) {
    const double angle = 2.0 * kPi * periods_x * i / n + phase;
    cos_x[i] = static_cast<float>(std::cos(angle));
    sin_x[i] = static_cast<float>(std::sin(angle));
  }
  for (int j = 0; j < n; ++j) {
    const double angle = 2.0 * kPi * periods_y * j / n;
    const float cos_y = amplitude * static_cast<float>(std::cos(angle));
    const float sin_y = amplitude * static_cast<float>(std::sin(angle));
    float* row = field.values.data() + static_cast<size_t>(j) * n;
    for (int i = 0; i < n; ++i) {
      row[i] += cos_y * cos_x[i] - sin_y * sin_x[i];
    }
  }
}

}  // namespace

float PeriodicField::Cubic(double x, double y) const {
  const double floor_x = std::floor(x);
  const double floor_y = std::floor(y);
  const auto weights_x = CatmullRom(static_cast<float>(x - floor_x));
  const auto weights_y = CatmullRom(static_cast<float>(y - floor_y));
  float sum = 0.0F;
  for (int b = 0; b < 4; ++b) {
    const float* row =
        values.data() + static_cast<size_t>(WrapIndex(static_cast<int64_t>(floor_y) + b - 1, n)) * n;
    float along = 0.0F;
    for (int a = 0; a < 4; ++a) {
      along += weights_x[a] * row[WrapIndex(static_cast<int64_t>(floor_x) + a - 1, n)];
    }
    sum += weights_y[b] * along;
  }
  return sum;
}

PeriodicField BandNoise(int n, double wavelength, double bandwidth, uint64_t seed) {
  PeriodicField field(n);
  Rng rng(seed);
  const auto amplitude = static_cast<float>(std::sqrt(2.0 / (2 * kWavePairs)));
  const double centre_x = rng.NextDouble();
  const double centre_y = rng.NextDouble();
  for (int pair = 0; pair < kWavePairs; ++pair) {
    const double angle = (pair + rng.NextDouble()) * kPi / kWavePairs;
    const double length = wavelength * (1.0 + bandwidth * (2.0 * rng.NextDouble() - 1.0));
    const double periods_x = std::round(n / length * std::cos(angle));
    const double periods_y = std::round(n / length * std::sin(angle));
    const double phase = 2.0 * kPi * rng.NextDouble();
    AddWave(field, periods_x, periods_y, phase, amplitude);
    // The same field, turned about a point of its own: waves that round to the same periods add up alike.
    const double turned_phase = phase + 2.0 * kPi * (-periods_y * centre_x + periods_x * centre_y);
    AddWave(field, -periods_y, periods_x, turned_phase, amplitude);
  }
  return field;
}

std::vector<std::array<double, 2>> BlueNoisePoints(double size, double distance, uint64_t seed) {
  constexpr int kTriesPerPlace = 64;
  const int bins = std::max(1, static_cast<int>(size / distance));
  const double bin_size = size / bins;
  std::vector<std::vector<int>> grid(static_cast<size_t>(bins) * bins);
  std::vector<std::array<double, 2>> points;
  Rng rng(seed);
  const auto tries = static_cast<int64_t>(kTriesPerPlace * size * size / (distance * distance));
  for (int64_t t = 0; t < tries; ++t) {
    const std::array<double, 2> candidate{rng.NextDouble() * size, rng.NextDouble() * size};
    const int bx = std::min(bins - 1, static_cast<int>(candidate[0] / bin_size));
    const int by = std::min(bins - 1, static_cast<int>(candidate[1] / bin_size));
    bool free = true;
    for (int dy = -1; dy <= 1 && free; ++dy) {
      for (int dx = -1; dx <= 1 && free; ++dx) {
        for (const int other :
             grid[static_cast<size_t>(WrapIndex(by + dy, bins)) * bins + WrapIndex(bx + dx, bins)]) {
          const double x = TorusDifference(candidate[0], points[other][0], size);
          const double y = TorusDifference(candidate[1], points[other][1], size);
          free = free && x * x + y * y >= distance * distance;
        }
      }
    }
    if (free) {
      grid[static_cast<size_t>(by) * bins + bx].push_back(static_cast<int>(points.size()));
      points.push_back(candidate);
    }
  }
  return points;
}

double TorusDifference(double a, double b, double size) {
  const double difference = a - b;
  return difference - size * std::round(difference / size);
}

float SmoothStep(float low, float high, float x) {
  const float t = std::clamp((x - low) / (high - low), 0.0F, 1.0F);
  return t * t * (3.0F - 2.0F * t);
}

}  // namespace tessera
