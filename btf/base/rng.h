// Seeded random numbers and the one fixed 64-bit mix. Same seed, same values, on every machine; <random>'s
// distributions differ between libraries and are not used.
//
//   Rng rng(Mix64(seed, item_index));   // a generator per work item, so threads cannot change a result
//   int i = rng.NextBelow(n);
#pragma once

#include <cstdint>

namespace tessera {

// The finaliser of SplitMix64 (Steele, Lea and Flood 2014, "Fast splittable pseudorandom number generators").
// Bijective on 64 bits. Edge colours of a dressing are defined by it, so it never changes.
constexpr uint64_t Mix64(uint64_t x) {
  x += 0x9e3779b97f4a7c15ULL;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ULL;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebULL;
  return x ^ (x >> 31);
}

// Order-dependent mix of two values.
constexpr uint64_t Mix64(uint64_t a, uint64_t b) {
  return Mix64(Mix64(a) ^ (b * 0xd6e8feb86659fd93ULL));
}

// SplitMix64 as a stream.
class Rng {
 public:
  explicit constexpr Rng(uint64_t seed) : state_(seed) {}

  constexpr uint64_t Next() {
    const uint64_t value = Mix64(state_);
    state_ += 0x9e3779b97f4a7c15ULL;
    return value;
  }

  // Uniform in [0, n), n > 0; multiply-shift, bias below n / 2^64.
  constexpr uint64_t NextBelow(uint64_t n) {
    return static_cast<uint64_t>((static_cast<unsigned __int128>(Next()) * n) >> 64);
  }

  // Uniform in [0, 1), 53 bits.
  constexpr double NextDouble() { return static_cast<double>(Next() >> 11) * 0x1.0p-53; }

 private:
  uint64_t state_;
};

}  // namespace tessera
