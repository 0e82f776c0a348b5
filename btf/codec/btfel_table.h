// BTFels and all that decoding one needs: the part that a material and a tile set have in common.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "btf/codec/code_buffer.h"
#include "btf/codec/container.h"
#include "btf/data/btf_source.h"
#include "btf/math/conventions.h"

namespace tessera {

// A named table shared by all texels, row-major.
struct CodecTable {
  std::vector<int64_t> shape;
  std::vector<float> values;  // finite
  // As it is stored: f32, or u8 or u16 where every value is a whole number of that range.
  DType dtype = DType::kF32;
};

// Quantised coefficient vectors with their shared tables. value = offset[i] + step[i] * code.
struct BtfelTable {
  std::string codec_id;  // "dsh-cls"
  int codec_version = 0;
  int num_coefficients = 0;   // k
  std::vector<float> offset;  // [k]
  std::vector<float> step;    // [k]
  std::map<std::string, CodecTable> tables;
  nlohmann::json parameters = nlohmann::json::object();  // what the codec recorded: kl, kv, ...
  std::vector<Direction> views;
  std::vector<Direction> lights;
  CodeBuffer codes;  // [n][k]

  [[nodiscard]] size_t size() const { return num_coefficients == 0 ? 0 : codes.size() / num_coefficients; }
  [[nodiscard]] std::span<const uint8_t> btfel(size_t index) const {
    return std::span(codes).subspan(index * num_coefficients, num_coefficients);
  }
  // All but the codes.
  [[nodiscard]] BtfelTable WithoutCodes() const {
    return {.codec_id = codec_id,
            .codec_version = codec_version,
            .num_coefficients = num_coefficients,
            .offset = offset,
            .step = step,
            .tables = tables,
            .parameters = parameters,
            .views = views,
            .lights = lights,
            .codes = {}};
  }
};

}  // namespace tessera
