// Rays against an endless, periodic height field, with Embree.
//
// One period and a narrow margin are triangulated. A ray that leaves them sideways before it has left the
// slab between the lowest and the highest point is moved back by whole periods and goes on, so that no ray
// leaves the field wrongly, however grazing. Rays go in packets of eight.
//
//   RayPacket rays = ...;            // 8 origins and unit directions; unused lanes off
//   HitPacket hits;
//   scene->Intersect(rays, RayKind::kCoherent, hits);
#pragma once

#include <array>
#include <cstdint>
#include <memory>

#include <absl/status/statusor.h>

#include "btf/meso/surface_maps.h"

namespace tessera {

inline constexpr int kPacketSize = 8;

// Whether the rays of a packet run alike; a hint for speed only.
enum class RayKind { kCoherent, kScattered };

struct RayPacket {
  alignas(32) std::array<float, kPacketSize> x{}, y{}, z{};     // origins, texels, any period
  alignas(32) std::array<float, kPacketSize> dx{}, dy{}, dz{};  // unit directions
  std::array<bool, kPacketSize> active{};
};

struct HitPacket {
  std::array<int64_t, kPacketSize> facet{};  // index within the period (surface_maps.h), -1 for none
  std::array<float, kPacketSize> u{}, v{};   // point = (1 - u - v) p0 + u p1 + v p2 of the facet's corners
};

class HeightFieldScene {
 public:
  // Heights must be finite. The tree is built by one thread, so that it is the same every time.
  // Errors: INTERNAL with Embree's code.
  static absl::StatusOr<std::unique_ptr<HeightFieldScene>> Create(const SurfaceMaps& maps);
  ~HeightFieldScene();

  // The first facet met by each active lane. Thread-safe.
  void Intersect(const RayPacket& rays, RayKind kind, HitPacket& hits) const;
  // Whether each active lane meets any facet; false for the others. Thread-safe.
  [[nodiscard]] std::array<bool, kPacketSize> Occluded(const RayPacket& rays, RayKind kind) const;

  [[nodiscard]] float lowest() const { return lowest_; }
  [[nodiscard]] float highest() const { return highest_; }

 private:
  struct Embree;
  explicit HeightFieldScene(std::unique_ptr<Embree> embree);

  template <typename Trace>
  void TraceWrapped(const RayPacket& rays, const Trace& trace) const;

  std::unique_ptr<Embree> embree_;
  float size_ = 0.0F;
  float lowest_ = 0.0F;
  float highest_ = 0.0F;
  int resolution_ = 0;
  int margin_cells_ = 0;
};

}  // namespace tessera
