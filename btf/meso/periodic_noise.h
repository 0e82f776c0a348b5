// Periodic random fields: band-limited noise that prefers no direction, and blue-noise points.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace tessera {

// An n x n field, row-major, that repeats in both directions.
struct PeriodicField {
  int n = 0;
  std::vector<float> values;

  explicit PeriodicField(int n) : n(n), values(static_cast<size_t>(n) * n) {}

  // Catmull-Rom interpolation at (x, y) in samples, any real numbers; sample (i, j) lies at (i, j).
  [[nodiscard]] float Cubic(double x, double y) const;
};

// Gaussian-like noise of mean 0 and variance 1: plane waves of whole periods per n, in pairs at right angles,
// their directions stratified over the half circle, their wavelengths (in samples) within a factor 1 +-
// bandwidth of `wavelength`. The pairs make the spectrum equal to its own quarter turn, for every seed.
[[nodiscard]] PeriodicField BandNoise(int n, double wavelength, double bandwidth, uint64_t seed);

// Points of the n x n torus no two of which are closer than `distance`, thrown until 64 candidates per
// place have been tried [Cook1986]. In [0, size)^2.
[[nodiscard]] std::vector<std::array<double, 2>> BlueNoisePoints(double size, double distance, uint64_t seed);

// The difference a - b on a torus of this size, in [-size / 2, size / 2].
[[nodiscard]] double TorusDifference(double a, double b, double size);

// 0 below `low`, 1 above `high`, a cubic between with flat ends.
[[nodiscard]] float SmoothStep(float low, float high, float x);

}  // namespace tessera
