#include "btf/codec/container.h"

#include "btf/codec/container_frame.h"

#include <algorithm>
#include <cstring>
#include <string>
#include <string_view>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "btf/codec/code_buffer.h"

namespace tessera {
namespace {

using ::testing::HasSubstr;

std::span<const std::byte> Bytes(std::string_view text) {
  return std::as_bytes(std::span(text));
}

Container Example() {
  Container container;
  container.kind = "material";
  container.header["source"] = "made by the test";
  container.header["future_key"] = {1, 2, 3};
  const std::vector<float> f = {1.0F, -2.0F, 0.5F};
  const std::vector<uint32_t> u = {7, 8, 9, 10};
  const std::vector<uint8_t> zeros(40000, 3);
  container.sections.push_back(MakeSection<float>("offset", {3}, std::span(f)));
  container.sections.push_back(MakeSection<uint32_t>("tile", {2, 2}, std::span(u)));
  container.sections.push_back(MakeSection<uint8_t>("btfels.0", {200, 200}, std::span(zeros)));
  container.sections.back().encoding = Encoding::kZstd;
  container.sections.back().other_keys["note"] = "kept";
  return container;
}

std::string Serialized(const Container& container) {
  auto bytes = SerializeContainer(container);
  EXPECT_TRUE(bytes.ok()) << bytes.status();
  return bytes.ok() ? *bytes : std::string();
}

// A container around hand-written header text and a body that starts at the next multiple of 64.
std::string WithHeader(std::string header, std::string_view body, uint32_t version = 1) {
  header.resize((16 + header.size() + 63) / 64 * 64 - 16, ' ');
  std::string file("TESSERA\0", 8);
  const auto size = static_cast<uint32_t>(header.size());
  file.append(reinterpret_cast<const char*>(&version), 4);
  file.append(reinterpret_cast<const char*>(&size), 4);
  file += header;
  file += body;
  return file;
}

// The status of a container whose only section has this header entry and whose body is 64 zero bytes.
absl::Status StatusOfEntry(const std::string& entry) {
  std::string header = R"({"kind":"k","sections":[)" + entry + "]}";
  // Offsets in the entries below count from the body: every header here fits in 512 bytes.
  header.resize(512 - 16, ' ');
  return ParseContainer(Bytes(WithHeader(header, std::string(64, '\0')))).status();
}

TEST(ContainerFileTest, AnyPieceIsThatOfTheWhole) {
  CodeBuffer codes = *CodeBuffer::Create(3000, /*memory_limit_bytes=*/0);
  for (size_t i = 0; i < codes.size(); ++i) {
    codes[i] = static_cast<uint8_t>(i * 7);
  }
  Container copied = Example();
  copied.sections.push_back(MakeSection<uint8_t>("coefficients", {30, 100}, std::span<const uint8_t>(codes)));
  Container borrowed = Example();
  borrowed.sections.push_back({.name = "coefficients", .shape = {30, 100}, .codes = &codes});
  for (Container* container : {&copied, &borrowed}) {  // and something behind it
    container->sections.push_back(
        MakeSection<uint8_t>("last", {5}, std::span<const uint8_t>(codes).first(5)));
  }
  const std::string whole = Serialized(copied);
  const auto file = ContainerFile::Create(borrowed);
  ASSERT_TRUE(file.ok()) << file.status();
  ASSERT_EQ(file->size_bytes(), whole.size());
  EXPECT_EQ(*file->ReadAll(), whole);
  for (const size_t step : {1, 7, 64, 1000}) {
    for (size_t offset = 0; offset < whole.size(); offset += step) {
      std::string piece(std::min(step, whole.size() - offset), '?');
      ASSERT_TRUE(file->Read(offset, std::as_writable_bytes(std::span(piece))).ok());
      ASSERT_EQ(piece, whole.substr(offset, step)) << offset << " step " << step;
    }
  }
}

TEST(ContainerTest, RoundTripKeepsEverything) {
  const Container before = Example();
  const std::string bytes = Serialized(before);
  auto after = ParseContainer(Bytes(bytes));
  ASSERT_TRUE(after.ok()) << after.status();
  EXPECT_EQ(after->kind, "material");
  EXPECT_EQ(after->header, before.header);
  ASSERT_EQ(after->sections.size(), before.sections.size());
  for (size_t i = 0; i < before.sections.size(); ++i) {
    EXPECT_EQ(after->sections[i].name, before.sections[i].name);
    EXPECT_EQ(after->sections[i].dtype, before.sections[i].dtype);
    EXPECT_EQ(after->sections[i].shape, before.sections[i].shape);
    EXPECT_EQ(after->sections[i].bytes, before.sections[i].bytes);
    EXPECT_EQ(after->sections[i].encoding, before.sections[i].encoding);
    EXPECT_EQ(after->sections[i].other_keys, before.sections[i].other_keys);
  }
  EXPECT_EQ(Serialized(*after), bytes);
}

TEST(ContainerTest, SectionsStartAtMultiplesOf64) {
  const std::string bytes = Serialized(Example());
  uint32_t header_bytes = 0;
  std::memcpy(&header_bytes, bytes.data() + 12, 4);
  const auto header = nlohmann::json::parse(bytes.substr(16, header_bytes));
  EXPECT_EQ(header["sections"].size(), 3U);
  for (const auto& section : header["sections"]) {
    EXPECT_EQ(section["offset"].get<uint64_t>() % 64, 0U);
  }
  EXPECT_EQ(header["sections"][0]["offset"].get<uint64_t>(), 16U + header_bytes);
}

TEST(ContainerTest, EveryTruncationIsDetected) {
  const std::string bytes = Serialized(Example());
  for (size_t size = 0; size < bytes.size(); ++size) {
    const auto parsed = ParseContainer(Bytes(std::string_view(bytes).substr(0, size)));
    EXPECT_FALSE(parsed.ok()) << "cut to " << size << " of " << bytes.size();
  }
  EXPECT_FALSE(ParseContainer(Bytes(bytes + "x")).ok());
}

TEST(ContainerTest, EveryBitFlipInASectionNamesIt) {
  const std::string bytes = Serialized(Example());
  uint32_t header_bytes = 0;
  std::memcpy(&header_bytes, bytes.data() + 12, 4);
  const auto header = nlohmann::json::parse(bytes.substr(16, header_bytes));
  for (const auto& section : header["sections"]) {
    const uint64_t offset = section["offset"];
    const uint64_t stored = section["stored_bytes"];
    for (uint64_t bit = 0; bit < stored * 8; ++bit) {
      std::string damaged = bytes;
      damaged[offset + bit / 8] ^= static_cast<char>(1 << (bit % 8));
      const auto parsed = ParseContainer(Bytes(damaged));
      ASSERT_EQ(parsed.status().code(), absl::StatusCode::kDataLoss);
      EXPECT_THAT(std::string(parsed.status().message()), HasSubstr(section["name"].get<std::string>()));
    }
  }
  // Padding and preamble: detected too.
  for (uint64_t i = 0; i < bytes.size(); ++i) {
    if (i >= 16 && i < 16 + header_bytes) {
      continue;
    }
    std::string damaged = bytes;
    damaged[i] ^= 4;
    EXPECT_FALSE(ParseContainer(Bytes(damaged)).ok()) << "byte " << i;
  }
}

TEST(ContainerTest, AnyHeaderFlipIsAnErrorOrAContainer) {
  const std::string bytes = Serialized(Example());
  uint32_t header_bytes = 0;
  std::memcpy(&header_bytes, bytes.data() + 12, 4);
  for (uint64_t bit = 0; bit < (16 + header_bytes) * 8ULL; ++bit) {
    std::string damaged = bytes;
    damaged[bit / 8] ^= static_cast<char>(1 << (bit % 8));
    const auto parsed = ParseContainer(Bytes(damaged));
    if (parsed.ok()) {
      EXPECT_TRUE(SerializeContainer(*parsed).ok());
    }
  }
}

TEST(ContainerTest, RefusesHostileHeaders) {
  EXPECT_EQ(ParseContainer({}).status().code(), absl::StatusCode::kDataLoss);
  EXPECT_THAT(std::string(ParseContainer(Bytes("PK\3\4 not ours at all")).status().message()),
              HasSubstr("magic"));
  EXPECT_EQ(ParseContainer(Bytes(WithHeader("{}", "", 2))).status().code(), absl::StatusCode::kUnimplemented);

  std::string huge = WithHeader(R"({"kind":"k","sections":[]})", "");
  const uint32_t size = (16U << 20) + 1;
  std::memcpy(huge.data() + 12, &size, 4);
  EXPECT_THAT(std::string(ParseContainer(Bytes(huge)).status().message()), HasSubstr("16777217"));
  const uint32_t beyond = 16U << 20;
  std::memcpy(huge.data() + 12, &beyond, 4);
  EXPECT_EQ(ParseContainer(Bytes(huge)).status().code(), absl::StatusCode::kDataLoss);

  EXPECT_THAT(std::string(ParseContainer(Bytes(WithHeader(std::string(100000, '['), ""))).status().message()),
              HasSubstr("deeper than 64"));
  std::string many = "[";
  for (int i = 0; i < (1 << 20) + 1; ++i) {
    many += "0,";
  }
  EXPECT_THAT(std::string(ParseContainer(Bytes(WithHeader(many + "0]", ""))).status().message()),
              HasSubstr("more than 1048576 values"));
  for (const std::string header : {"", "[]", "{", R"({"kind":1,"sections":[]})", R"({"kind":"k"})",
                                   R"({"kind":"k","sections":{}})", "{\"kind\":\"\xff\",\"sections\":[]}",
                                   R"({"kind":"k","sections":[7]})", R"({"kind":"k","x":1e999})"}) {
    EXPECT_EQ(ParseContainer(Bytes(WithHeader(header, ""))).status().code(),
              absl::StatusCode::kInvalidArgument)
        << header;
  }
}

TEST(ContainerTest, RefusesHostileSections) {
  const auto entry = [](std::string_view key, std::string_view value) {
    nlohmann::json json = {{"name", "a"},        {"dtype", "u8"},      {"shape", {64}},
                           {"offset", 512},      {"raw_bytes", 64},    {"stored_bytes", 64},
                           {"encoding", "none"}, {"crc32", 0x758D6336}};
    if (!key.empty()) {
      json[std::string(key)] = nlohmann::json::parse(value);
    }
    return json.dump();
  };
  ASSERT_TRUE(StatusOfEntry(entry("", "")).ok()) << StatusOfEntry(entry("", ""));
  struct Case {
    std::string_view key, value, message;
    absl::StatusCode code = absl::StatusCode::kInvalidArgument;
  };
  const Case cases[] = {
      {"name", R"("A/..")", "name"},
      {"name", "[]", "name"},
      {"dtype", R"("f16")", "unknown dtype 'f16'", absl::StatusCode::kUnimplemented},
      {"encoding", R"("lzma")", "unknown encoding 'lzma'", absl::StatusCode::kUnimplemented},
      {"shape", "[63]", "raw_bytes 64"},
      {"shape", "[-64]", "extent"},
      {"shape", "[64.0]", "extent"},
      {"shape", "[18446744073709551615]", "extent"},
      {"shape", "[4294967296, 4294967296, 64]", "raw_bytes"},
      {"shape", "[4611686018427387904, 4, 16]", "raw_bytes"},
      {"shape", "[64,1,1,1,1,1,1,1,1]", "at most 8"},
      {"offset", "448", "behind the header"},
      {"offset", "513", "multiple"},
      {"offset", "576", "exceed", absl::StatusCode::kDataLoss},
      {"offset", "18446744073709551552", "exceed", absl::StatusCode::kDataLoss},
      {"offset", "-64", "offset"},
      {"stored_bytes", "18446744073709551615", "stored_bytes"},
      {"stored_bytes", "63", "stored_bytes"},
      {"crc32", "1", "crc32", absl::StatusCode::kDataLoss},
      {"crc32", "4294967296", "32 bits"},
  };
  for (const Case& c : cases) {
    const absl::Status status = StatusOfEntry(entry(c.key, c.value));
    EXPECT_EQ(status.code(), c.code) << c.key << " " << c.value << ": " << status;
    EXPECT_THAT(std::string(status.message()), HasSubstr(std::string(c.message)));
    EXPECT_THAT(std::string(status.message()), HasSubstr("section '"));
  }
  EXPECT_THAT(std::string(StatusOfEntry(entry("", "") + "," + entry("", "")).message()), HasSubstr("twice"));
  EXPECT_THAT(std::string(StatusOfEntry(entry("", "") + "," + entry("name", R"("b")")).message()),
              HasSubstr("overlaps"));
}

TEST(ContainerTest, RefusesACompressionBomb) {
  // 64 stored bytes that claim 4 GiB, and a claim within the ratio that the stream does not keep.
  const auto bomb = [](std::string_view raw) {
    return StatusOfEntry(
        R"({"name":"a","dtype":"u8","shape":[)" + std::string(raw) +
        R"(],"offset":512,"stored_bytes":64,"encoding":"zstd","crc32":1972200246,"raw_bytes":)" +
        std::string(raw) + "}");
  };
  EXPECT_THAT(std::string(bomb("4294967296").message()), HasSubstr("expand"));
  EXPECT_EQ(bomb("65536").code(), absl::StatusCode::kDataLoss);
  EXPECT_THAT(std::string(bomb("65536").message()), HasSubstr("zstd"));
}

TEST(ContainerTest, StoresPlainlyWhatWouldExpandBeyondTheLimit) {
  Container container{.kind = "k"};
  const std::vector<uint8_t> zeros(10 << 20, 0);
  container.sections.push_back(
      MakeSection<uint8_t>("a", {static_cast<int64_t>(zeros.size())}, std::span(zeros)));
  container.sections.back().encoding = Encoding::kZstd;
  const std::string bytes = Serialized(container);
  EXPECT_GT(bytes.size(), zeros.size());
  EXPECT_TRUE(ParseContainer(Bytes(bytes)).ok());
}

TEST(ContainerTest, RefusesToWriteWhatItWouldNotRead) {
  Container container = Example();
  container.sections[0].shape = {4};
  EXPECT_THAT(std::string(SerializeContainer(container).status().message()), HasSubstr("'offset'"));
  container = Example();
  container.sections[1].name = "offset";
  EXPECT_THAT(std::string(SerializeContainer(container).status().message()), HasSubstr("twice"));
  container = Example();
  container.header["source"] = "\xff";
  EXPECT_EQ(SerializeContainer(container).status().code(), absl::StatusCode::kInvalidArgument);
}

TEST(ContainerFrameTest, ComesBackSmallerAndDamageIsAnError) {
  Container container;
  container.kind = "test";
  for (int i = 0; i < 40; ++i) {
    const std::vector<float> values = {static_cast<float>(i)};
    container.sections.push_back(MakeSection<float>("section_" + std::to_string(i), {1}, std::span(values)));
  }
  const std::string plain = *SerializeContainer(container);
  const auto frame = FrameContainer(container);
  ASSERT_TRUE(frame.ok()) << frame.status();
  EXPECT_LT(frame->size(), plain.size() / 4);
  for (const std::string& bytes : {plain, *frame}) {
    const auto parsed = ParseFrame(std::as_bytes(std::span(bytes)));
    ASSERT_TRUE(parsed.ok()) << parsed.status();
    EXPECT_EQ(SectionValues<float>(*parsed->Find("section_17")), std::vector<float>{17.0F});
  }
  for (size_t size = 0; size < frame->size(); ++size) {
    EXPECT_FALSE(ParseFrame(std::as_bytes(std::span(*frame).first(size))).ok()) << size;
  }
  for (size_t i = 0; i < frame->size(); ++i) {
    std::string damaged = *frame;
    damaged[i] = static_cast<char>(damaged[i] ^ 0x10);
    (void)ParseFrame(std::as_bytes(std::span(damaged)));  // an error, or what it says
  }
  // A frame that claims 1 TiB.
  const std::string bomb = {'\x28', '\xb5', '\x2f', '\xfd', '\xe0', 0, 0, 0, 0, 0, 1, 0, 0, 1, 0, 0};
  const auto refused = ParseFrame(std::as_bytes(std::span(bomb)));
  EXPECT_TRUE(absl::IsDataLoss(refused.status()));
  EXPECT_THAT(refused.status().message(), HasSubstr("expand to 1099511627776"));
}

TEST(ContainerTest, KeepsEmptySections) {
  Container container{.kind = "k"};
  container.sections.push_back(MakeSection<float>("empty", {0, 3}, {}));
  const std::vector<uint8_t> one = {1};
  container.sections.push_back(MakeSection<uint8_t>("one", {1}, std::span(one)));
  container.sections.push_back(MakeSection<float>("last", {0}, {}));
  const auto parsed = ParseContainer(Bytes(Serialized(container)));
  ASSERT_TRUE(parsed.ok()) << parsed.status();
  EXPECT_EQ(parsed->sections.size(), 3U);
  EXPECT_EQ(parsed->Find("empty")->shape, (std::vector<int64_t>{0, 3}));
}

}  // namespace
}  // namespace tessera
