// The device and the scene of one Embree ray caster. For the folders that link Embree.
#pragma once

#include <absl/status/status.h>
#include <absl/strings/str_cat.h>
#include <embree3/rtcore.h>

namespace tessera {

// Owns both; null until opened or set.
struct EmbreeScene {
  RTCDevice device = nullptr;
  RTCScene scene = nullptr;

  EmbreeScene() = default;
  EmbreeScene(const EmbreeScene&) = delete;
  EmbreeScene& operator=(const EmbreeScene&) = delete;
  ~EmbreeScene() {
    if (scene != nullptr) {
      rtcReleaseScene(scene);
    }
    if (device != nullptr) {
      rtcReleaseDevice(device);
    }
  }

  // Opens the device. Errors: INTERNAL with Embree's code.
  [[nodiscard]] absl::Status OpenDevice() {
    device = rtcNewDevice(nullptr);
    return device != nullptr
               ? absl::OkStatus()
               : absl::InternalError(
                     absl::StrCat("Embree: no device, error ", static_cast<int>(rtcGetDeviceError(nullptr))));
  }
};

}  // namespace tessera
