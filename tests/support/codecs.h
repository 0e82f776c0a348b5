// Codecs in tests: encoding by name, and tests that run for each codec.
//
//   INSTANTIATE_TEST_SUITE_P(AllCodecs, MyTest, ::testing::ValuesIn(AllCodecs()), CodecTestName);
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include <absl/status/statusor.h>
#include <gtest/gtest.h>

#include "btf/codec/codec.h"

namespace tessera {

inline absl::StatusOr<Material> Encode(std::string_view codec, BtfSource& source, const EncodeParams& params,
                                       int threads = 2) {
  RunContext context;
  context.num_threads = threads;
  return FindCodec(codec)->Encode(source, params, context);
}

inline std::vector<std::string> AllCodecs() {
  const std::vector<std::string_view> ids = CodecIds();
  return {ids.begin(), ids.end()};
}

// The codec's id without what a test's name cannot hold.
inline std::string CodecTestName(const ::testing::TestParamInfo<std::string>& info) {
  std::string name = info.param;
  std::erase_if(name, [](char c) { return c == '-'; });
  return name;
}

}  // namespace tessera
